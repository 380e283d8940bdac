#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| properties::device_file_read(bytes));
