#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::sdo_server_session(bytes));
