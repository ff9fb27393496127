//! Plays arbitrary bytes as a recording, to its end.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use gdg_tui::commands::frames::play;
use gdg_tui_fuzz::memory_file;
use libfuzzer_sys::fuzz_target;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| memory_file("cast"));

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(&*FILE, bytes).expect("written");
    let _ = play(&FILE, vec![0.0, f64::MAX], &Default::default(), |screen, _| {
        assert!(screen.size().0.get() <= 500 && screen.size().1.get() <= 1000);
        Ok(())
    });
});
