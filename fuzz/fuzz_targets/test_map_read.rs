#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::properties::test_map_read(bytes));
