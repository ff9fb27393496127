//! Loads arbitrary bytes as a checkpoint, with the checksum corrected first as an attacker would,
//! and trains what loads.
#![no_main]

use gdg::train::{Registry, from_bytes, with_updated_checksum};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let whole = with_updated_checksum(bytes);
    if let Ok(mut trainer) = from_bytes(whole.as_deref().unwrap_or(bytes), &Registry::builtin(), 1)
    {
        (0..4).for_each(|_| drop(trainer.tick()));
    }
});
