//! What a checkpoint consists of, and how long saving and loading take.

use std::collections::BTreeMap;
use std::time::Instant;

use miette::{IntoDiagnostic, Report};

use super::{built_in, trainer};
use gdg::train::{self, Registry, SaveTo};

/// Updates after which the checkpoint is saved.
const UPDATES: u64 = 6_000;

/// Measures the checkpoint of a run of the default preset with seed 1.
pub fn measure(map: &'static str, threads: usize) -> Result<String, Report> {
    let registry = Registry::builtin();
    let mut trainer = trainer(&built_in(map), 1, threads).into_diagnostic()?;
    while trainer.counters().updates < UPDATES {
        trainer.tick().into_diagnostic()?;
    }
    let folder = tempfile::tempdir().into_diagnostic()?;
    let to = SaveTo::CreateNew(folder.path().join("run.safetensors"));
    let path = train::save(&trainer, &to).into_diagnostic()?;
    let bytes = std::fs::read(path).into_diagnostic()?;
    let began = Instant::now();
    let again = train::from_bytes(&bytes, &registry, threads).into_diagnostic()?;
    let loaded = began.elapsed();
    // The first save may have waited for a bridge graph.
    let began = Instant::now();
    train::save(&again, &to).into_diagnostic()?;
    let saved = began.elapsed();
    let mut sizes = BTreeMap::new();
    for (name, part) in train::read_saved(&bytes).into_diagnostic()?.state.parts() {
        *sizes.entry(part_of(&name)).or_insert(0) += part.len();
    }
    let [save, load] = [saved, loaded].map(|took| 1e3 * took.as_secs_f64());
    let mut out = format!("{map}: checkpoint after {UPDATES} updates, ");
    out += &format!("saved in {save:.0} ms, loaded in {load:.0} ms\n");
    let all = [("all", sizes.values().sum()), ("packed", bytes.len())];
    for (part, size) in sizes.into_iter().chain(all) {
        out += &format!("  {part:<36}{:>8.2} MB\n", size as f64 / 1e6);
    }
    Ok(out)
}

fn part_of(name: &str) -> &'static str {
    match name.split('.').next() {
        Some("replay") => "replay",
        Some("candidates") => "bridge candidates",
        Some("graphs") => "bridge graphs",
        Some("agents" | "visits" | "film") => "agents, visits and film",
        _ if name.contains(".table") => "grid tables",
        _ if name.contains(".dense") => "other weights",
        _ => "others",
    }
}
