//! Runs in the library.

use gdg::store::{Array, Store};
use gdg::train::Trainer;

/// Trains until `updates` are done.
pub fn train_to(trainer: &mut Trainer, updates: u64) {
    while trainer.counters().updates < updates {
        trainer.tick().unwrap();
    }
}

/// Returns the saved state as bits, without the elapsed time.
pub fn state(trainer: &Trainer) -> Store {
    let mut store = trainer.save().unwrap();
    let mut state: serde_json::Value = store.json("trainer").unwrap();
    state.as_object_mut().unwrap().remove("seconds").unwrap();
    store.put_text("trainer", state.to_string());
    for (name, array) in store.arrays().clone() {
        if let Array::F32(numbers) = array {
            store.put(name, numbers.iter().map(|number| number.to_bits()).collect::<Vec<u32>>());
        }
    }
    store
}
