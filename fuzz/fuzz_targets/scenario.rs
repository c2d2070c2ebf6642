#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| echocast_fuzz::scenario::run(text));
