//! Checks that a run fits into memory before it starts: a process that runs out of memory is killed
//! without a message. Limits that cannot be read are ignored.

use super::TrainError;
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

const BASE_BYTES: u64 = 90 << 20;

/// Address space that threads and allocators reserve but do not use; counts only where address
/// space is limited.
const RESERVED_BYTES: u64 = 600 << 20;

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
/// and process limits leave.
pub fn available_bytes() -> u64 {
    system_memory().min(address_space_left())
}

#[cfg(target_os = "linux")]
fn system_memory() -> u64 {
    linux::free_memory(std::path::Path::new("/")).unwrap_or(u64::MAX)
}

#[cfg(not(target_os = "linux"))]
fn system_memory() -> u64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    system.available_memory()
}

fn address_space_left() -> u64 {
    #[cfg(target_os = "linux")]
    if let Ok((limit, _)) = nix::sys::resource::getrlimit(nix::sys::resource::Resource::RLIMIT_AS)
        && limit != nix::sys::resource::RLIM_INFINITY
    {
        return limit.saturating_sub(linux::address_space() + RESERVED_BYTES);
    }
    u64::MAX
}

pub fn check(run: &Run, world: &dyn Environment, registry: &Registry) -> Result<(), TrainError> {
    let parameters =
        (registry.learner(&run.method.learner)?.parameters)(world.spec(), &run.settings.learn);
    let (needed, available) = (required_bytes(run, world, parameters), available_bytes());
    if needed as f64 <= MAX_MEMORY_SHARE * available as f64 {
        return Ok(());
    }
    let is_limited = available < system_memory();
    let by = if is_limited { " under the limit of address space (ulimit -v)" } else { "" };
    let [needed, available] = [needed, available].map(|bytes| bytes as f64 / 1e9);
    Err(TrainError::Memory(format!(
        "these settings need about {needed:.1} GB of memory, but {available:.1} GB are available{by}: \
         reduce hidden, layers, batch_size, candidates or buffer_size"
    )))
}

/// Crates that read limits know those of a container, not those of a job around the process, count the
/// page cache as used, or panic without /proc.
#[cfg(target_os = "linux")]
mod linux {
    use std::path::{Component, Path, PathBuf};

    use crate::files;

    const MAX_BYTES: u64 = 16 << 20;

    struct Version {
        mount: &'static str,
        limits: [(&'static str, &'static str); 2],
        /// What the kernel takes back before it refuses memory, copies of files and its own caches:
        /// names in `memory.stat`.
        reclaimable: &'static [&'static str],
    }

    /// Beyond `memory.high` the kernel slows a group down so much that it makes no progress.
    const V2: Version = Version {
        mount: "sys/fs/cgroup",
        limits: [("memory.max", "memory.current"), ("memory.high", "memory.current")],
        reclaimable: &["inactive_file", "active_file", "slab_reclaimable"],
    };

    /// Limits without and with swap. Statistics by other names leave out the groups below.
    const V1: Version = Version {
        mount: "sys/fs/cgroup/memory",
        limits: [
            ("memory.limit_in_bytes", "memory.usage_in_bytes"),
            ("memory.memsw.limit_in_bytes", "memory.memsw.usage_in_bytes"),
        ],
        reclaimable: &["total_inactive_file", "total_active_file"],
    };

    /// Returns the free memory in bytes according to /proc and /sys in `root`; `None` if unknown.
    pub fn free_memory(root: &Path) -> Option<u64> {
        let groups = read(&root.join("proc/self/cgroup")).unwrap_or_default();
        let in_groups = groups.lines().filter_map(|line| {
            let mut parts = line.splitn(3, ':');
            let (id, controllers, group) = (parts.next()?, parts.next()?, parts.next()?);
            match controllers {
                "" if id == "0" => V2.free(root, group),
                _ if controllers.split(',').any(|name| name == "memory") => V1.free(root, group),
                _ => None,
            }
        });
        let machine = read(&root.join("proc/meminfo"));
        in_groups.chain(machine.and_then(|text| kilobytes(&text, "MemAvailable:"))).min()
    }

    /// Returns the size of this process's address space, 0 if it is unknown.
    pub fn address_space() -> u64 {
        let status = read(Path::new("/proc/self/status"));
        status.and_then(|status| kilobytes(&status, "VmSize:")).unwrap_or(0)
    }

    fn read(path: &Path) -> Option<String> {
        files::read(path, MAX_BYTES).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Returns the number of bytes in a line like `MemAvailable:  8000 kB`.
    fn kilobytes(text: &str, name: &str) -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
    }

    impl Version {
        /// Returns the bytes that `group` and all groups around it leave; `None` if they are not
        /// limited. A container may see its own group only at the top.
        fn free(&self, root: &Path, group: &str) -> Option<u64> {
            let names = Path::new(group).components();
            let names = names.filter(|name| matches!(name, Component::Normal(_)));
            let top = root.join(self.mount);
            top.join(names.collect::<PathBuf>())
                .ancestors()
                .take_while(|folder| folder.starts_with(&top))
                .filter_map(|folder| self.free_in(folder))
                .min()
        }

        fn free_in(&self, folder: &Path) -> Option<u64> {
            let number = |name: &str| read(&folder.join(name))?.trim().parse::<u64>().ok();
            let left = |(limit, usage)| Some(number(limit)?.saturating_sub(number(usage)?));
            let free = self.limits.into_iter().filter_map(left).min()?;
            let stat = read(&folder.join("memory.stat")).unwrap_or_default();
            let numbers = stat.lines().filter_map(|line| line.split_once(' '));
            let reclaimable = numbers
                .filter(|(name, _)| self.reclaimable.contains(name))
                .filter_map(|(_, number)| number.trim().parse().ok());
            Some(reclaimable.fold(free, u64::saturating_add))
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        /// Returns the free memory of a machine with 8 GB available, a process in `groups`, and files
        /// of control groups, as `path = text`.
        fn free(groups: &str, files: &[&str]) -> Option<u64> {
            let machine = tempfile::tempdir().expect("a folder");
            let write = |path: &str, text: &str| {
                let path = machine.path().join(path);
                std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
                std::fs::write(path, text).expect("written");
            };
            write("proc/meminfo", "MemTotal: 16000000 kB\nMemAvailable:    8000000 kB\n");
            write("proc/self/cgroup", groups);
            for (path, text) in files.iter().filter_map(|file| file.split_once(" = ")) {
                write(&format!("sys/fs/cgroup/{path}"), text);
            }
            free_memory(machine.path())
        }

        #[test]
        fn the_strictest_limit_on_the_way_to_the_top_counts_and_page_cache_is_free() {
            let v2 = ["memory.max = 1500\n", "memory.current = 1490\n"];
            let stat = "memory.stat = anon 300\nfile 900\ninactive_file 500\nactive_file 300\n\
                        slab_reclaimable 50\n";
            let job = [
                "slurm/memory.max = 90000",
                "slurm/memory.current = 1000",
                "slurm/job 7/memory.max = 3000",
                "slurm/job 7/memory.current = 1000",
                "slurm/job 7/step/memory.max = max",
                "slurm/job 7/step/memory.current = 1000",
            ];
            let high = "slurm/job 7/step/memory.high = 2500";
            let v1 = [
                "memory/memory.limit_in_bytes = 4000",
                "memory/memory.usage_in_bytes = 3990",
                "memory/memory.stat = inactive_file 1\ntotal_inactive_file 500\n",
            ];
            let swap = [
                "memory/memory.memsw.limit_in_bytes = 800",
                "memory/memory.memsw.usage_in_bytes = 795",
            ];
            let task = "0::/slurm/job 7/step/task\n";
            for (groups, files, bytes) in [
                ("0::/\n", vec![], 8_000_000 << 10),
                ("0::/\n", v2.to_vec(), 10),
                ("0::/\n", [&v2[..], &[stat]].concat(), 10 + 850),
                (task, job.to_vec(), 2000),
                (task, [&job[..], &[high]].concat(), 1500),
                (task, [&job[..], &["slurm/job 7/memory.current = 5000"]].concat(), 0),
                ("5:cpu,memory:/\n2:pids:/x\n0::/x\n", v1.to_vec(), 10 + 500),
                // A container sees its own group at the top.
                ("4:memory:/docker/abc\n", v1.to_vec(), 510),
                ("4:memory:/../..\n", [&v1[..], &swap].concat(), 5 + 500),
                ("0::/a\nx\n::\n", vec!["a/memory.max = -1"], 8_000_000 << 10),
                ("0::/a\n", vec!["a/memory.max = 5", "a/memory.current = \0"], 8_000_000 << 10),
            ] {
                assert_eq!(free(groups, &files), Some(bytes), "{groups:?} {files:?}");
            }
            let nothing = tempfile::tempdir().expect("a folder");
            assert_eq!(free_memory(nothing.path()), None, "no /proc");
        }
    }
}
