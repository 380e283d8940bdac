#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::eds_read(bytes));
