//! `cargo +nightly fuzz run --features libfuzzer edits`
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    viscera_fuzz::edits(bytes);
});
