#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::properties::device_file_read(bytes));
