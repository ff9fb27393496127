//! Runs in the library.

use std::collections::BTreeMap;

use gdg::train::Trainer;

/// Trains until `updates` are done.
pub fn train_to(trainer: &mut Trainer, updates: u64) {
    while trainer.counters().updates < updates {
        trainer.tick().unwrap();
    }
}

/// Returns the saved state as bytes by name, without the elapsed time.
pub fn state(trainer: &Trainer) -> BTreeMap<String, Vec<u8>> {
    let mut parts = trainer.save().unwrap().state.parts();
    parts.remove("seconds").unwrap();
    parts
}
