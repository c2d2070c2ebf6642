#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| echocast_fuzz::table::run(bytes));
