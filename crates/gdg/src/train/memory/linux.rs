//! The memory that Linux leaves to this process: that of the machine, and of the control groups
//! around the process.
//!
//! Limits that cannot be read are ignored: /proc may be missing or incomplete.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use crate::files;

/// Size limit of the files read here: the table of mounts of a busy host is some hundred kilobytes.
const MAX_BYTES: u64 = 16 << 20;

/// Files with the limits of a group in version 2 and their use; beyond `memory.high` the kernel
/// slows a group down so much that it makes no progress.
const V2_LIMITS: [(&str, &str); 2] =
    [("memory.max", "memory.current"), ("memory.high", "memory.current")];

/// The same in version 1: without and with swap.
const V1_LIMITS: [(&str, &str); 2] = [
    ("memory.limit_in_bytes", "memory.usage_in_bytes"),
    ("memory.memsw.limit_in_bytes", "memory.memsw.usage_in_bytes"),
];

/// The version of a hierarchy of control groups.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    V1,
    V2,
}

/// A place where control groups are mounted.
struct Mount {
    version: Version,
    /// The group at its top.
    root: PathBuf,
    folder: PathBuf,
}

/// Returns the free memory in bytes according to the tree at `proc`; `None` if unknown.
pub fn free_memory(proc: &Path) -> Option<u64> {
    let groups = read(&proc.join("self/cgroup")).unwrap_or_default();
    let mounts = read(&proc.join("self/mountinfo")).unwrap_or_default();
    let folders = mounts.lines().filter_map(parse_mount).flat_map(|mount| {
        let own = groups.lines().find_map(|line| parse_group(line, mount.version));
        own.map(|group| folders_of(&mount, Path::new(group)))
            .into_iter()
            .flatten()
            .map(move |dir| (mount.version, dir))
    });
    let free = folders.filter_map(|(version, folder)| free_in_group(version, &folder));
    free.chain(free_on_machine(proc)).min()
}

/// Returns the size of this process's address space, 0 if it is unknown.
pub fn address_space(proc: &Path) -> u64 {
    read(&proc.join("self/status")).and_then(|status| kilobytes(&status, "VmSize:")).unwrap_or(0)
}

/// Returns the text of a file of the kernel.
fn read(path: &Path) -> Option<String> {
    files::read(path, MAX_BYTES).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

/// Returns the number of bytes in a line like `MemAvailable:  8000 kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

fn free_on_machine(proc: &Path) -> Option<u64> {
    kilobytes(&read(&proc.join("meminfo"))?, "MemAvailable:")
}

/// Parses a line of `/proc/self/cgroup`, `ID:CONTROLLERS:GROUP`; returns the group if it may limit
/// memory.
fn parse_group(line: &str, version: Version) -> Option<&str> {
    let mut parts = line.splitn(3, ':');
    let (id, controllers, group) = (parts.next()?, parts.next()?, parts.next()?);
    let is_meant = match version {
        Version::V1 => controllers.split(',').any(|name| name == "memory"),
        Version::V2 => id == "0" && controllers.is_empty(),
    };
    is_meant.then_some(group)
}

/// Parses a line of `/proc/self/mountinfo` (proc(5)); returns a mount of control groups that may
/// limit memory.
fn parse_mount(line: &str) -> Option<Mount> {
    let (place, kind) = line.split_once(" - ")?;
    let mut place = place.split(' ').skip(3);
    let (root, folder) = (unescaped(place.next()?), unescaped(place.next()?));
    let mut kind = kind.split(' ');
    let version = match kind.next()? {
        "cgroup2" => Version::V2,
        "cgroup" if kind.nth(1)?.split(',').any(|option| option == "memory") => Version::V1,
        _ => return None,
    };
    Some(Mount { version, root, folder })
}

/// Returns a path in which the kernel has written some characters as `\040`, their octal codes.
fn unescaped(text: &str) -> PathBuf {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('\\') {
        out += before;
        let code = after.get(..3).and_then(|code| u8::from_str_radix(code, 8).ok());
        out.push(code.map_or('\\', char::from));
        rest = if code.is_some() { &after[3..] } else { after };
    }
    PathBuf::from(out + rest)
}

/// Returns the folders of `group` and of all groups around it, up to the top of the mount. A
/// container may not see its own folder below the mount, whose top is then the container's group.
fn folders_of(mount: &Mount, group: &Path) -> Vec<PathBuf> {
    let below = group.strip_prefix(&mount.root).unwrap_or(Path::new(""));
    let is_inside = below.components().all(|part| matches!(part, Component::Normal(_)));
    let own = mount.folder.join(if is_inside { below } else { Path::new("") });
    own.ancestors()
        .take_while(|folder| folder.starts_with(&mount.folder))
        .map(Path::to_owned)
        .collect()
}

/// Returns the bytes that the group in `folder` may still use; `None` if it has no limit.
fn free_in_group(version: Version, folder: &Path) -> Option<u64> {
    let number = |name: &str| read(&folder.join(name))?.trim().parse::<u64>().ok();
    let limits = if version == Version::V2 { V2_LIMITS } else { V1_LIMITS };
    let free = limits
        .into_iter()
        .filter_map(|(limit, usage)| Some(number(limit)?.saturating_sub(number(usage)?)))
        .min()?;
    Some(free.saturating_add(reclaimable(
        version,
        &read(&folder.join("memory.stat")).unwrap_or_default(),
    )))
}

/// Returns the bytes that the kernel takes back before it refuses memory: copies of files, and its
/// own caches.
fn reclaimable(version: Version, stat: &str) -> u64 {
    let numbers: HashMap<&str, u64> = stat
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter_map(|(name, number)| Some((name, number.trim().parse().ok()?)))
        .collect();
    let sum = |names: &[&str]| {
        let found: Vec<u64> = names.iter().filter_map(|name| numbers.get(name)).copied().collect();
        (!found.is_empty()).then(|| found.into_iter().fold(0, u64::saturating_add))
    };
    match version {
        Version::V2 => sum(&["inactive_file", "active_file", "slab_reclaimable"]),
        // In version 1, the plain numbers leave out the groups below.
        Version::V1 => sum(&["total_inactive_file", "total_active_file"]).or_else(|| {
            Some(
                numbers
                    .get("total_cache")?
                    .saturating_sub(*numbers.get("total_shmem").unwrap_or(&0)),
            )
        }),
    }
    .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A made-up machine: files of /proc and control groups below a folder.
    struct Machine(tempfile::TempDir);

    impl Machine {
        /// Creates one with 8 GB available, in `groups` (`/proc/self/cgroup`), with `mounts`, in
        /// which @ is the folder.
        fn new(groups: &str, mounts: &str) -> Self {
            let machine = Self(tempfile::tempdir().expect("a folder"));
            machine.write("proc/meminfo", "MemTotal: 16000000 kB\nMemAvailable:    8000000 kB\n");
            machine.write("proc/self/cgroup", groups);
            let folder = machine.0.path().to_string_lossy().into_owned();
            machine.write("proc/self/mountinfo", &mounts.replace('@', &folder));
            machine
        }

        fn write(&self, path: &str, text: &str) -> &Self {
            let path = self.0.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            std::fs::write(path, text).expect("written");
            self
        }

        fn free(&self) -> Option<u64> {
            free_memory(&self.0.path().join("proc"))
        }
    }

    const ALL: u64 = 8_000_000 << 10;
    const V2: &str = "30 1 0:26 / @/cg rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate\n";
    const V1: &str = "30 1 0:26 / @/cg/memory rw shared:4 - cgroup cgroup rw,memory\n";

    #[test]
    fn page_cache_is_free_in_both_versions() {
        let stat = "anon 300\nfile 900\nshmem 100\ninactive_file 500\nactive_file 300\nslab_reclaimable 50\n";
        let machine = Machine::new("0::/\n", V2);
        machine
            .write("cg/memory.max", "1500\n")
            .write("cg/memory.current", "1490\n")
            .write("cg/memory.stat", stat);
        assert_eq!(machine.free(), Some(10 + 850));
        let machine = Machine::new("5:memory:/\n2:cpu:/x\n0::/x\n", V1);
        machine
            .write("cg/memory/memory.limit_in_bytes", "1500\n")
            .write("cg/memory/memory.usage_in_bytes", "1490\n");
        assert_eq!(machine.free(), Some(10), "no statistics");
        machine.write(
            "cg/memory/memory.stat",
            "inactive_file 1\ntotal_inactive_file 500\ntotal_active_file 300\n",
        );
        assert_eq!(machine.free(), Some(810));
        machine.write("cg/memory/memory.stat", "total_cache 700\ntotal_shmem 200\n");
        assert_eq!(machine.free(), Some(510));
    }

    #[test]
    fn the_strictest_limit_on_the_way_to_the_top_counts() {
        let machine = Machine::new("0::/slurm/job 7/step/task\n", V2);
        for (group, max) in [
            ("", "max"),
            ("/slurm", "90000"),
            ("/slurm/job 7", "3000"),
            ("/slurm/job 7/step", "max"),
        ] {
            machine
                .write(&format!("cg{group}/memory.max"), max)
                .write(&format!("cg{group}/memory.current"), "1000");
        }
        assert_eq!(machine.free(), Some(2000), "the task's own folder has no files at all");
        machine.write("cg/slurm/job 7/step/memory.high", "2500");
        assert_eq!(machine.free(), Some(1500));
        machine.write("cg/slurm/job 7/memory.current", "5000");
        assert_eq!(machine.free(), Some(0), "more is used than allowed");
    }

    #[test]
    fn the_memory_controller_may_be_mounted_anywhere_and_with_others() {
        let hybrid = "31 1 0:27 / @/cg/unified rw - cgroup2 cgroup2 rw\n\
                      32 1 0:28 / @/odd\\040place rw,relatime master:3 - cgroup cgroup rw,cpu,memory\n";
        let machine = Machine::new("9:cpu,memory:/job\n0::/other\n", hybrid);
        machine
            .write("odd place/job/memory.limit_in_bytes", "700")
            .write("odd place/job/memory.usage_in_bytes", "200");
        machine
            .write("odd place/memory.limit_in_bytes", "9223372036854771712")
            .write("odd place/memory.usage_in_bytes", "1");
        assert_eq!(machine.free(), Some(500));
        machine.write("odd place/job/memory.memsw.limit_in_bytes", "800");
        machine.write("odd place/job/memory.memsw.usage_in_bytes", "700");
        assert_eq!(machine.free(), Some(100), "swap counts too");
    }

    #[test]
    fn containers_see_their_own_group_at_the_top_of_the_mount() {
        let docker = "30 1 0:26 /docker/abc @/cg ro - cgroup cgroup rw,memory\n";
        for group in ["/docker/abc", "/", "/elsewhere", "/../.."] {
            let machine = Machine::new(&format!("4:memory:{group}\n"), docker);
            machine
                .write("cg/memory.limit_in_bytes", "4000")
                .write("cg/memory.usage_in_bytes", "1000");
            assert_eq!(machine.free(), Some(3000), "{group}");
        }
        let machine = Machine::new("4:memory:/docker/abc/sub\n", docker);
        machine
            .write("cg/sub/memory.limit_in_bytes", "400")
            .write("cg/sub/memory.usage_in_bytes", "100");
        assert_eq!(machine.free(), Some(300));
    }

    #[test]
    fn what_cannot_be_read_limits_nothing() {
        let nothing = tempfile::tempdir().expect("a folder");
        assert_eq!(
            (free_memory(nothing.path()), address_space(nothing.path())),
            (None, 0),
            "no /proc"
        );
        assert_eq!(Machine::new("0::/\n", V2).free(), Some(ALL), "no control groups");
        for garbage in ["", "max", "-1", "99999999999999999999999", "\u{0}", "1 2"] {
            let machine = Machine::new(
                "0::/a\nx\n::\n",
                &format!("x\n - \n1 2 3 - cgroup2\n - cgroup x\n{V2}"),
            );
            machine
                .write("cg/a/memory.max", garbage)
                .write("cg/a/memory.current", "5")
                .write("cg/a/memory.stat", garbage);
            assert_eq!(machine.free(), Some(ALL), "{garbage:?}");
        }
        // Only the part of /proc about processes.
        let machine = Machine::new("0::/\n", V2);
        machine.write("cg/memory.max", "900").write("cg/memory.current", "100");
        std::fs::remove_file(machine.0.path().join("proc/meminfo")).expect("removed");
        assert_eq!(machine.free(), Some(800));
    }

    #[test]
    fn this_machine_has_memory() {
        assert!(free_memory(Path::new("/proc")).is_none_or(|free| free > 1 << 20));
    }
}
