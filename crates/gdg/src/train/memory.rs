//! Checks that a run fits into memory before it starts: a process that runs out of memory is killed
//! without a message.

#[cfg(target_os = "linux")]
mod linux;

#[cfg(target_os = "linux")]
use std::path::Path;

use super::error::TrainError;
use super::registry::Registry;
use super::run::Run;
use crate::env::{Environment, Recorded};
use crate::learn::ReplaySizes;

/// Copies of the network parameters in a run: value, average and two moments; the last good copy of
/// these four; packed weights; gradients of the batch shards; frozen copies for graphs, evaluations
/// and the screen. Saving adds four more copies of the first four: as numbers, as bytes, as a file,
/// and read back. (Measured with 1024 hidden units: 30.)
const PARAMETER_COPIES: u64 = 36;

/// Memory per bridge candidate of the target number: observed paths, edges and distilled distances,
/// including all copies. Where there are more candidates, each has fewer paths.
const BYTES_PER_CANDIDATE: u64 = 60_000;

/// The program itself, its threads and buffers, and the places of excursions.
const BASE_BYTES: u64 = 90 << 20;

/// Address space that threads and allocators reserve but do not use; counts only where address
/// space is limited.
const RESERVED_BYTES: u64 = 600 << 20;

/// Fraction of the free memory that a run may use.
const MAX_MEMORY_SHARE: f64 = 0.9;

/// Estimates the bytes that a run in `world` needs, including saving; `parameters` is the learner's
/// number of trainable parameters.
pub fn required_bytes(run: &Run, world: &dyn Environment, parameters: u64) -> u64 {
    let (learn, bridge) = (&run.settings.learn, &run.settings.bridge);
    let f32s = |count: u64| 4 * count;
    let spec = world.spec();
    let widest = learn.hidden.max(64) as u64;
    // Activations and their gradients, for each network that a batch shard passes through.
    let batch = learn.batch_size as u64 * widest * (learn.layers as u64 + 2) * 12;
    // One live copy, and two more while saving.
    let slots = learn.buffer_size + run.settings.train.agents;
    let replay = 3 * ReplaySizes::of(spec).bytes(slots);
    let candidates = bridge.candidates as u64 * BYTES_PER_CANDIDATE;
    BASE_BYTES
        + f32s(parameters * PARAMETER_COPIES)
        + f32s(batch)
        + replay
        + candidates
        + world.abilities().recorded.map_or(0, Recorded::memory_bytes)
}

/// Estimates the bytes this process can still allocate: the minimum of what machine, container, job
/// and process limits leave. Unknown limits are ignored.
pub fn available_bytes() -> u64 {
    let left = |limit: u64| limit.saturating_sub(address_space() + RESERVED_BYTES);
    system_memory().min(address_space_limit().map_or(u64::MAX, left))
}

fn address_space_limit() -> Option<u64> {
    #[cfg(unix)]
    if let Ok((limit, _)) = nix::sys::resource::getrlimit(nix::sys::resource::Resource::RLIMIT_AS) {
        return Some(limit).filter(|limit| *limit != nix::sys::resource::RLIM_INFINITY);
    }
    None
}

#[cfg(target_os = "linux")]
fn system_memory() -> u64 {
    linux::free_memory(Path::new("/")).unwrap_or(u64::MAX)
}

#[cfg(not(target_os = "linux"))]
fn system_memory() -> u64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    system.available_memory()
}

/// Returns the size of this process's address space, 0 if it is unknown.
#[cfg(target_os = "linux")]
fn address_space() -> u64 {
    linux::address_space(Path::new("/"))
}

#[cfg(all(unix, not(target_os = "linux")))]
fn address_space() -> u64 {
    0
}

/// Checks that a run fits into memory.
pub fn check(run: &Run, world: &dyn Environment, registry: &Registry) -> Result<(), TrainError> {
    let parameters =
        (registry.learner(&run.method.learner)?.parameters)(world.spec(), &run.settings.learn);
    let (needed, available) = (required_bytes(run, world, parameters), available_bytes());
    if needed as f64 <= MAX_MEMORY_SHARE * available as f64 {
        return Ok(());
    }
    Err(match address_space_limit().filter(|_| available < system_memory()) {
        Some(limit) => {
            let space =
                (needed as f64 / MAX_MEMORY_SHARE) as u64 + RESERVED_BYTES + address_space();
            TrainError::AddressSpace { needed, space, limit }
        }
        None => TrainError::Memory { needed, available },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::PointMaze;
    use crate::map::builtin;
    use crate::train::{Method, Preset, Settings};

    #[test]
    fn the_default_fits_into_memory_and_oversized_settings_do_not() {
        let world = PointMaze::new(builtin("fourrooms").expect("built in").into(), 0);
        let registry = Registry::builtin();
        let run = |change: fn(&mut Settings)| {
            let mut settings = Preset::Default.settings();
            change(&mut settings);
            Run { method: Method::default(), preset: Preset::Default, seed: 0, settings }
        };
        let bytes = |change: fn(&mut Settings)| {
            let run = run(change);
            let parameters = (registry.learner("gdg").expect("built in").parameters)(
                world.spec(),
                &run.settings.learn,
            );
            required_bytes(&run, &world, parameters)
        };
        let default = bytes(|_| {});
        assert!((50_000_000..400_000_000).contains(&default), "{default}");
        assert!(bytes(|s| (s.learn.hidden, s.learn.layers) = (4096, 8)) > 15_000_000_000);
        assert!(bytes(|s| s.bridge.candidates = 5_000) < 1_000_000_000);
        assert!(bytes(|s| s.learn.buffer_size = 100_000_000) > 5_000_000_000);
        let error = check(&run(|s| s.learn.buffer_size = 100_000_000_000), &world, &registry);
        assert!(error.expect_err("no machine has that much").to_string().contains("GB of memory"));
    }
}
