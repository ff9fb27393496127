//! The memory that Linux leaves to this process: that of the machine, and of the control groups
//! around the process.
//!
//! Limits that cannot be read are ignored: /proc may be missing or incomplete. Crates that read
//! limits know those of a container, not those of a job around the process, count the page cache as
//! used, or panic without /proc.

use std::path::{Component, Path, PathBuf};

use crate::files;

const MAX_BYTES: u64 = 16 << 20;

/// A version of control groups.
struct Version {
    mount: &'static str,
    /// Files with a group's limits, and with what it uses of them.
    limits: [(&'static str, &'static str); 2],
    /// What the kernel takes back before it refuses memory, copies of files and its own caches: names
    /// in `memory.stat`.
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
    let in_groups = groups.lines().filter_map(parse_group);
    let in_groups = in_groups.filter_map(|(version, group)| version.free(root, group));
    let on_machine =
        read(&root.join("proc/meminfo")).and_then(|text| kilobytes(&text, "MemAvailable:"));
    in_groups.chain(on_machine).min()
}

pub fn address_space(root: &Path) -> u64 {
    let status = read(&root.join("proc/self/status"));
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

/// Parses a line of `/proc/self/cgroup`, `ID:CONTROLLERS:GROUP`; returns the group if it may limit
/// memory.
fn parse_group(line: &str) -> Option<(Version, &str)> {
    let mut parts = line.splitn(3, ':');
    let (id, controllers, group) = (parts.next()?, parts.next()?, parts.next()?);
    if controllers.split(',').any(|name| name == "memory") {
        return Some((V1, group));
    }
    (id == "0" && controllers.is_empty()).then_some((V2, group))
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

    /// Returns the bytes that the group in `folder` may still use; `None` if it has no limit.
    fn free_in(&self, folder: &Path) -> Option<u64> {
        let number = |name: &str| read(&folder.join(name))?.trim().parse::<u64>().ok();
        let free = self.limits.into_iter();
        let free = free
            .filter_map(|(limit, usage)| Some(number(limit)?.saturating_sub(number(usage)?)))
            .min()?;
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

    const ALL: u64 = 8_000_000 << 10;

    /// Returns the free memory of a machine with 8 GB available, a process in `groups`, and files of
    /// control groups.
    fn free(groups: &str, files: &[(&str, &str)]) -> Option<u64> {
        let machine = tempfile::tempdir().expect("a folder");
        let write = |path: &str, text: &str| {
            let path = machine.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            std::fs::write(path, text).expect("written");
        };
        write("proc/meminfo", "MemTotal: 16000000 kB\nMemAvailable:    8000000 kB\n");
        write("proc/self/cgroup", groups);
        files.iter().for_each(|(path, text)| write(&format!("sys/fs/cgroup/{path}"), text));
        free_memory(machine.path())
    }

    #[test]
    fn page_cache_is_free_in_both_versions() {
        let v2 = [("memory.max", "1500\n"), ("memory.current", "1490\n")];
        let stat = "anon 300\nfile 900\nshmem 100\ninactive_file 500\nactive_file 300\n\
                    slab_reclaimable 50\n";
        let with_stat = [&v2[..], &[("memory.stat", stat)]].concat();
        assert_eq!(free("0::/\n", &with_stat), Some(10 + 850));
        assert_eq!(free("0::/\n", &v2), Some(10), "no statistics");
        let v1 = [
            ("memory/memory.limit_in_bytes", "1500\n"),
            ("memory/memory.usage_in_bytes", "1490\n"),
            ("memory/memory.stat", "inactive_file 1\ntotal_inactive_file 500\n"),
        ];
        assert_eq!(free("5:cpu,memory:/\n2:pids:/x\n0::/x\n", &v1), Some(10 + 500));
    }

    #[test]
    fn the_strictest_limit_on_the_way_to_the_top_counts() {
        let job = [
            ("slurm/memory.max", "90000"),
            ("slurm/memory.current", "1000"),
            ("slurm/job 7/memory.max", "3000"),
            ("slurm/job 7/memory.current", "1000"),
            ("slurm/job 7/step/memory.max", "max"),
            ("slurm/job 7/step/memory.current", "1000"),
        ];
        let free = |more: &[_]| free("0::/slurm/job 7/step/task\n", &[&job[..], more].concat());
        assert_eq!(free(&[]), Some(2000), "the task's own folder has no files at all");
        assert_eq!(free(&[("slurm/job 7/step/memory.high", "2500")]), Some(1500));
        assert_eq!(free(&[("slurm/job 7/memory.current", "5000")]), Some(0), "all is used");
    }

    #[test]
    fn swap_counts_too_and_containers_see_their_own_group_at_the_top() {
        let limits =
            [("memory/memory.limit_in_bytes", "4000"), ("memory/memory.usage_in_bytes", "1000")];
        for group in ["/docker/abc", "/", "/elsewhere", "/../.."] {
            assert_eq!(free(&format!("4:memory:{group}\n"), &limits), Some(3000), "{group}");
        }
        let swap = [
            ("memory/memory.memsw.limit_in_bytes", "800"),
            ("memory/memory.memsw.usage_in_bytes", "700"),
        ];
        assert_eq!(free("4:memory:/\n", &[limits, swap].concat()), Some(100));
    }

    #[test]
    fn what_cannot_be_read_limits_nothing() {
        let nothing = tempfile::tempdir().expect("a folder");
        let nothing = nothing.path();
        assert_eq!((free_memory(nothing), address_space(nothing)), (None, 0), "no /proc");
        assert_eq!(free("0::/\n", &[]), Some(ALL), "no control groups");
        for garbage in ["", "max", "-1", "99999999999999999999999", "\u{0}", "1 2"] {
            let files =
                [("a/memory.max", garbage), ("a/memory.current", "5"), ("a/memory.stat", garbage)];
            assert_eq!(free("0::/a\nx\n::\n", &files), Some(ALL), "{garbage:?}");
        }
        assert!(free_memory(Path::new("/")).is_none_or(|free| free > 1 << 20), "of this machine");
    }
}
