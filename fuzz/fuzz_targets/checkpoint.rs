//! Loads arbitrary bytes as the state of a checkpoint, packed and with the right checksum as an
//! attacker would, and trains what loads.
#![no_main]

use gdg::train::{Registry, from_bytes, with_changed_state};
use libfuzzer_sys::fuzz_target;

/// The checkpoint that the states in `seeds/checkpoint` belong to.
const BASE: &[u8] = include_bytes!("../checkpoint.safetensors");

fuzz_target!(|bytes: &[u8]| {
    let changed = with_changed_state(BASE, |state| *state = bytes.to_vec());
    let forged = changed.as_deref().unwrap_or(bytes);
    if let Ok(mut trainer) = from_bytes(forged, &Registry::builtin(), 1) {
        (0..4).for_each(|_| drop(trainer.tick()));
    }
});
