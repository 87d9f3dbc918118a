#![no_main]
//! Any bytes as a file of this format.
libfuzzer_sys::fuzz_target!(|data: &[u8]| brickcast_fuzz::read("x.txm", data));
