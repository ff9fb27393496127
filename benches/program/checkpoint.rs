//! What a checkpoint consists of, and how long saving and loading take.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use miette::{IntoDiagnostic, Report, miette};
use safetensors::SafeTensors;

use super::{CheckpointPart, CheckpointSize};
use gdg::env::PointMaze;
use gdg::map::builtin;
use gdg::train::{self, Method, Preset, Registry, Run, SaveTo, Settings, Trainer};

/// Updates after which the checkpoint is saved.
const UPDATES: u64 = 6_000;

/// Measures the checkpoint of a run of the default preset with seed 1.
pub fn measure(map: &'static str, threads: usize) -> Result<CheckpointSize, Report> {
    let Some(grid) = builtin(map).map(Arc::new) else { unreachable!("{map} is built in") };
    let registry = Registry::builtin();
    let run = Run {
        method: Method::default(),
        preset: Preset::Default,
        seed: 1,
        settings: Settings::default(),
    };
    let mut trainer =
        Trainer::new(run, &PointMaze::new(grid, 0), &registry, threads).into_diagnostic()?;
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
    let part = |(part, bytes): (&&'static str, &usize)| CheckpointPart {
        part,
        bytes: *bytes,
        stored_bytes: stored.get(*part).copied().unwrap_or(0),
    };
    Ok(CheckpointSize {
        map,
        updates: UPDATES,
        bytes: plain.len(),
        stored_bytes: bytes.len(),
        save_ms: 1e3 * saved.as_secs_f64(),
        load_ms: 1e3 * loaded.as_secs_f64(),
        parts: unpacked.iter().map(part).collect(),
    })
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
