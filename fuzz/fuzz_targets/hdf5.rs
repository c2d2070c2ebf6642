#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| echocast_fuzz::hdf5::run(data));
