#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| echocast_fuzz::yaml::run(text));
