//! What a checkpoint consists of, and how long saving and loading take.

use std::collections::BTreeMap;
use std::time::Instant;

use miette::{IntoDiagnostic, Report, miette};
use safetensors::SafeTensors;

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
    let plain = train::unpacked(&bytes).map_err(|e| miette!("{e}"))?;
    let (stored, unpacked) = (sizes(&bytes)?, sizes(&plain)?);
    let [save, load] = [saved, loaded].map(|took| 1e3 * took.as_secs_f64());
    let mut out = format!("{map}: checkpoint after {UPDATES} updates, ");
    out += &format!("saved in {save:.0} ms, loaded in {load:.0} ms\n");
    let mb = |bytes: usize| bytes as f64 / 1e6;
    let parts = unpacked.iter().map(|(part, size)| (*part, *size, stored.get(part).copied()));
    for (part, size, stored) in parts.chain([("all", plain.len(), Some(bytes.len()))]) {
        let stored = mb(stored.unwrap_or(0));
        out += &format!("  {part:<36}{:>8.2} MB{stored:>8.2} MB stored\n", mb(size));
    }
    Ok(out)
}

/// Returns the bytes of each part of a checkpoint.
fn sizes(bytes: &[u8]) -> Result<BTreeMap<&'static str, usize>, Report> {
    let tensors = SafeTensors::deserialize(bytes).into_diagnostic()?;
    let mut sizes = BTreeMap::new();
    for (name, tensor) in tensors.iter() {
        *sizes.entry(part_of(name)).or_insert(0) += tensor.data().len();
    }
    let all: usize = sizes.values().sum();
    sizes.insert("texts and names", bytes.len() - all);
    Ok(sizes)
}

fn part_of(name: &str) -> &'static str {
    match name.split(['.', '_']).next() {
        Some("replay") => "replay",
        Some("bridge") => "bridge candidates",
        Some("graph" | "next") if name.contains(".edges.") => "edges of graphs",
        Some("graph" | "next") => "candidates of graphs",
        Some("places" | "excursions" | "visited" | "film") => "places, visits and film",
        _ if name.contains(".table") => "grid tables",
        _ => "other weights",
    }
}
