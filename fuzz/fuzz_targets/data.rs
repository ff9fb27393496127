//! Reads arbitrary bytes as recorded transitions in the trap.
#![no_main]

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use gdg::env::PointMaze;
use gdg::map::builtin;
use gdg::train::Dataset;
use gdg_tui_fuzz::memory_file;
use libfuzzer_sys::fuzz_target;

static TRAP: LazyLock<PointMaze> =
    LazyLock::new(|| PointMaze::new(Arc::new(builtin("trap").expect("built in")), 0));

static FILE: LazyLock<PathBuf> = LazyLock::new(|| memory_file("npz"));

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("written");
    match Dataset::read(&FILE, &*TRAP, &Default::default()) {
        Ok(data) => {
            assert!(data.states().iter().all(|number| number.is_finite()));
            let replay = data.replay(2, || vec![0.5; 2]);
            assert!(replay.has_transitions());
        }
        Err(error) => assert!(error.to_string().len() < 10_000),
    }
});
