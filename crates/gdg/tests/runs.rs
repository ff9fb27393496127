//! Runs in the library.

use gdg::store::Store;
use gdg::train::Trainer;

/// Trains until `updates` are done.
pub fn train_to(trainer: &mut Trainer, updates: u64) {
    while trainer.counters().updates < updates {
        trainer.tick().unwrap();
    }
}

/// Returns the saved state without the elapsed time.
pub fn state(trainer: &Trainer) -> Store {
    let mut store = trainer.save().unwrap();
    let mut state: serde_json::Value = store.json("trainer").unwrap();
    state.as_object_mut().unwrap().remove("seconds").unwrap();
    store.put_text("trainer", state.to_string());
    store
}
