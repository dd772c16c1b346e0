//! `cargo +nightly fuzz run map` (from the root of the repository).
#![no_main]

#[allow(dead_code)] // every target uses one of the entry functions
#[path = "../../tests/fuzz_entries/mod.rs"]
mod entries;

libfuzzer_sys::fuzz_target!(|data: &[u8]| entries::map(data));
