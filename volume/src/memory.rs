//! How much memory this process may have: the machine's, that of every group of processes it is in (containers), and
//! its own limit.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::small_file::system_text;

/// Bytes, and what sets them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limit {
    pub bytes: u64,
    pub by: LimitBy,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LimitBy {
    Machine,
    /// The group of processes with this folder.
    Group(PathBuf),
    /// The process's own address space.
    Process,
}

impl fmt::Display for LimitBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Machine => f.write_str("the machine's memory"),
            Self::Group(path) => write!(f, "the limit of the container or group {}", path.display()),
            Self::Process => f.write_str("the process's own limit (ulimit -v)"),
        }
    }
}

/// Bytes that this process can still get without swapping or being killed; nothing where the system does not tell.
#[must_use]
pub fn available() -> Option<Limit> {
    System::here().available()
}

/// The most that this process could ever have; nothing where the system does not tell.
#[must_use]
pub fn most() -> Option<Limit> {
    System::here().most()
}

/// Where the system tells it.
struct System {
    root: PathBuf,
}

/// The files of a group, by the version of groups.
struct Names {
    max: &'static str,
    now: &'static str,
    /// Bytes of files that the system keeps in memory and gives up when it is short of it, as they are called in
    /// `memory.stat`.
    files: [&'static str; 2],
}

const VERSION_1: Names = Names {
    max: "memory.limit_in_bytes",
    now: "memory.usage_in_bytes",
    files: ["total_inactive_file", "total_active_file"],
};
const VERSION_2: Names = Names { max: "memory.max", now: "memory.current", files: ["inactive_file", "active_file"] };

/// Version 1 says a number about this large where there is no limit.
const NO_LIMIT: u64 = 1 << 60;

impl System {
    fn here() -> Self {
        Self { root: PathBuf::from("/") }
    }

    fn text(&self, path: impl AsRef<Path>) -> Option<String> {
        system_text(self.root.join(path))
    }

    /// Of a line such as `MemTotal:  123 kB`.
    fn kib(&self, path: &str, key: &str) -> Option<u64> {
        let text = self.text(path)?;
        let line = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
    }

    fn available(&self) -> Option<Limit> {
        let machine = self.kib("proc/meminfo", "MemAvailable").map(|bytes| Limit { bytes, by: LimitBy::Machine });
        let groups = self.groups().into_iter().filter_map(|(folder, names)| {
            let left = self.max(&folder, names)?.saturating_sub(self.held(&folder, names)?);
            Some(Limit { bytes: left, by: LimitBy::Group(folder) })
        });
        let own = self.own_limit().map(|bytes| {
            let left = bytes.saturating_sub(self.kib("proc/self/status", "VmSize").unwrap_or(0));
            Limit { bytes: left, by: LimitBy::Process }
        });
        groups.chain(machine).chain(own).min_by_key(|limit| limit.bytes)
    }

    fn most(&self) -> Option<Limit> {
        let machine = self.kib("proc/meminfo", "MemTotal").map(|bytes| Limit { bytes, by: LimitBy::Machine });
        let groups = self
            .groups()
            .into_iter()
            .filter_map(|(folder, names)| Some(Limit { bytes: self.max(&folder, names)?, by: LimitBy::Group(folder) }));
        let own = self.own_limit().map(|bytes| Limit { bytes, by: LimitBy::Process });
        groups.chain(machine).chain(own).min_by_key(|limit| limit.bytes)
    }

    /// The folders of this process's group and of all that it lies in: each of them limits it.
    fn groups(&self) -> Vec<(PathBuf, &'static Names)> {
        let Some(text) = self.text("proc/self/cgroup") else { return Vec::new() };
        let mut folders = Vec::new();
        for line in text.lines() {
            let mut fields = line.splitn(3, ':').skip(1);
            let (Some(controllers), Some(path)) = (fields.next(), fields.next()) else { continue };
            let (mount, names) = match controllers {
                "" => ("sys/fs/cgroup", &VERSION_2),
                list if list.split(',').any(|c| c == "memory") => ("sys/fs/cgroup/memory", &VERSION_1),
                _ => continue,
            };
            // A container often sees its own group as the root, and is told a path that only its host knows: the root
            // counts anyway.
            let relative = Path::new(path.trim_start_matches('/'));
            let inside = relative.components().all(|c| matches!(c, std::path::Component::Normal(_)));
            let relative = if inside { relative } else { Path::new("") };
            folders.extend(relative.ancestors().map(|part| (Path::new("/").join(mount).join(part), names)));
        }
        folders
    }

    fn in_group(&self, folder: &Path, file: &str) -> Option<String> {
        self.text(folder.strip_prefix("/").unwrap_or(folder).join(file))
    }

    fn max(&self, folder: &Path, names: &Names) -> Option<u64> {
        self.in_group(folder, names.max)?.trim().parse::<u64>().ok().filter(|max| *max < NO_LIMIT)
    }

    /// Bytes that the group cannot be made to give up.
    fn held(&self, folder: &Path, names: &Names) -> Option<u64> {
        let now: u64 = self.in_group(folder, names.now)?.trim().parse().ok()?;
        let stat = self.in_group(folder, "memory.stat").unwrap_or_default();
        let of = |key: &str| {
            let line = stat.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
            line.and_then(|n| n.trim().parse::<u64>().ok()).unwrap_or(0)
        };
        Some(now.saturating_sub(names.files.map(of).iter().sum()))
    }

    /// Of the address space.
    fn own_limit(&self) -> Option<u64> {
        let text = self.text("proc/self/limits")?;
        text.lines().find_map(|line| line.strip_prefix("Max address space"))?.split_whitespace().next()?.parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(files: &[(&str, &str)]) -> (tempfile::TempDir, System) {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let root = folder.path().to_path_buf();
        (folder, System { root })
    }

    const MEMINFO: (&str, &str) = ("proc/meminfo", "MemTotal:       9000 kB\nMemAvailable:    8000 kB\n");

    fn group(path: &str) -> LimitBy {
        LimitBy::Group(PathBuf::from(path))
    }

    #[test]
    fn a_machine_without_groups_gives_what_it_has() {
        let (_folder, bare) =
            system(&[MEMINFO, ("proc/self/limits", "Max address space   unlimited   unlimited  bytes\n")]);
        assert_eq!(bare.available(), Some(Limit { bytes: 8000 << 10, by: LimitBy::Machine }));
        assert_eq!(bare.most(), Some(Limit { bytes: 9000 << 10, by: LimitBy::Machine }));
        let (_folder, mute) = system(&[("proc/meminfo", "MemTotal: 8 kB\n")]);
        assert_eq!(mute.available(), None);
    }

    /// A pod's limit often stands above the container's, which has none of its own.
    #[test]
    fn the_narrowest_group_on_the_whole_way_counts() {
        let (_folder, nested) = system(&[
            MEMINFO,
            ("proc/self/cgroup", "0::/pod/container/inner\n"),
            ("sys/fs/cgroup/pod/memory.max", "5000000\n"),
            ("sys/fs/cgroup/pod/memory.current", "3000000\n"),
            ("sys/fs/cgroup/pod/memory.stat", "anon 1\ninactive_file 700000\nactive_file 300000\n"),
            ("sys/fs/cgroup/pod/container/memory.max", "max\n"),
            ("sys/fs/cgroup/pod/container/memory.current", "10\n"),
            ("sys/fs/cgroup/pod/container/inner/memory.max", "6000000\n"),
            ("sys/fs/cgroup/pod/container/inner/memory.current", "1000000\n"),
        ]);
        // What the system keeps of files it gives up again.
        assert_eq!(nested.available(), Some(Limit { bytes: 3_000_000, by: group("/sys/fs/cgroup/pod") }));
        assert_eq!(nested.most(), Some(Limit { bytes: 5_000_000, by: group("/sys/fs/cgroup/pod") }));
    }

    #[test]
    fn a_container_that_sees_itself_as_the_root_is_limited_too() {
        let files = [("sys/fs/cgroup/memory.max", "4096000\n"), ("sys/fs/cgroup/memory.current", "96000\n"), MEMINFO];
        for path in ["0::/\n", "0::/docker/1234\n", "0::/../..\n"] {
            let (_folder, own) = system(&[&files[..], &[("proc/self/cgroup", path)]].concat());
            assert_eq!(own.available(), Some(Limit { bytes: 4_000_000, by: group("/sys/fs/cgroup/") }), "{path}");
        }
    }

    #[test]
    fn groups_of_version_1_and_the_limit_of_the_process_count() {
        let mut files = vec![
            MEMINFO,
            ("proc/self/cgroup", "5:cpu,cpuacct:/x\n4:memory:/user/job\n0::/\n"),
            ("sys/fs/cgroup/memory/user/memory.limit_in_bytes", "2000000\n"),
            ("sys/fs/cgroup/memory/user/memory.usage_in_bytes", "1500000\n"),
            ("sys/fs/cgroup/memory/user/memory.stat", "cache 9\ntotal_inactive_file 500000\ntotal_active_file 0\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n"),
        ];
        let (_folder, old) = system(&files);
        assert_eq!(old.available(), Some(Limit { bytes: 1_000_000, by: group("/sys/fs/cgroup/memory/user") }));
        files.push(("proc/self/limits", "Max cpu time  1 1 seconds\nMax address space   900000   900000   bytes\n"));
        files.push(("proc/self/status", "VmPeak: 9999 kB\nVmSize:  100 kB\n"));
        let (_folder, limited) = system(&files);
        assert_eq!(limited.available(), Some(Limit { bytes: 900_000 - 102_400, by: LimitBy::Process }));
    }
}
