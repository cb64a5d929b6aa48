//! `cargo +nightly fuzz run --features libfuzzer case`
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    viscera_fuzz::case(bytes);
});
