#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::candump_parse(bytes));
