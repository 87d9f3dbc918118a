//! Where the cache is, and that only its user writes there: whoever could put a store into it would choose what others
//! see.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    /// Named by whoever runs the program, who knows who else writes there.
    Named,
    /// In the user's own folders.
    Users,
    /// Below the folder of temporary files, where everyone may make folders.
    Temporary,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) folder: PathBuf,
    kind: Kind,
}

impl Place {
    pub(super) fn of(named: Option<&Path>) -> Self {
        if let Some(folder) = named {
            return Self { folder: folder.to_path_buf(), kind: Kind::Named };
        }
        let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
        let users = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|p| p.is_absolute()).or_else(home);
        match users.filter(|p| p.is_absolute()) {
            Some(base) => Self { folder: base.join("brickcast"), kind: Kind::Users },
            None => Self { folder: std::env::temp_dir().join(temporary_name()), kind: Kind::Temporary },
        }
    }

    /// Makes the folder where there is none, and checks that it is the user's own.
    pub(super) fn ready(self) -> anyhow::Result<PathBuf> {
        let made = match self.kind {
            Kind::Named => std::fs::create_dir_all(&self.folder),
            Kind::Users => make_private(&self.folder, true),
            Kind::Temporary => match make_private(&self.folder, false) {
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => Ok(()),
                made => made,
            },
        };
        made.with_context(|| {
            format!("cache folder {}: cannot be made; name another with --cache-dir", self.folder.display())
        })?;
        #[cfg(unix)]
        if self.kind != Kind::Named {
            self.check(rustix::process::geteuid().as_raw())?;
        }
        Ok(self.folder)
    }

    /// Whether the folder is that of `user`, whoever runs the program.
    #[cfg(unix)]
    fn check(&self, user: u32) -> anyhow::Result<()> {
        use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};

        let shown = self.folder.display();
        let looked = match self.kind {
            // A link there is someone else's choice of a folder.
            Kind::Temporary => std::fs::symlink_metadata(&self.folder),
            Kind::Named | Kind::Users => std::fs::metadata(&self.folder),
        };
        let data = looked.with_context(|| format!("cache folder {shown}: cannot be looked at"))?;
        let (owner, mode) = (data.uid(), data.mode() & 0o7777);
        if !data.is_dir() {
            return Err(anyhow::anyhow!(
                "cache folder {shown}: is no folder, and someone else may have put it there; name another with \
                 --cache-dir"
            ));
        }
        if owner != user {
            return Err(anyhow::anyhow!(
                "cache folder {shown}: belongs to user {owner} and not to you (user {user}), who could put other \
                 volumes there; name a folder of your own with --cache-dir"
            ));
        }
        match self.kind {
            Kind::Temporary if mode & 0o077 != 0 => Err(anyhow::anyhow!(
                "cache folder {shown}: others may read or write there (mode {mode:o}); remove it, or name another with \
                 --cache-dir"
            )),
            // Made under a wide umask: nothing that its owner meant.
            Kind::Users if mode & 0o022 != 0 => {
                let narrowed = std::fs::Permissions::from_mode(mode & !0o022);
                let set = std::fs::set_permissions(&self.folder, narrowed);
                set.with_context(|| {
                    format!(
                        "cache folder {shown}: others may write there (mode {mode:o}); `chmod go-w` it, or name \
                         another with --cache-dir"
                    )
                })
            }
            _ => Ok(()),
        }
    }
}

/// Each user's own, so that nobody meets another's.
#[cfg(unix)]
fn temporary_name() -> String {
    format!("brickcast-{}", rustix::process::geteuid().as_raw())
}

/// The folder of temporary files is the user's own there.
#[cfg(not(unix))]
fn temporary_name() -> String {
    "brickcast".to_owned()
}

fn make_private(folder: &Path, recursive: bool) -> std::io::Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(recursive);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

#[cfg(all(test, unix))]
mod tests {
    #![allow(clippy::unwrap_used)] // helpers of tests are tests

    use super::*;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    fn mode(path: &Path) -> u32 {
        std::fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    fn place(folder: &Path, kind: Kind) -> Place {
        Place { folder: folder.to_path_buf(), kind }
    }

    fn set(folder: &Path, mode: u32) {
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn a_folder_below_the_temporary_one_that_others_can_write_to_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("brickcast-1");
        place(&folder, Kind::Temporary).ready().unwrap();
        assert_eq!(mode(&folder), 0o700);
        place(&folder, Kind::Temporary).ready().unwrap();
        for open in [0o777, 0o720, 0o701] {
            set(&folder, open);
            let error = place(&folder, Kind::Temporary).ready().unwrap_err().to_string();
            assert!(error.contains(&format!("mode {open:o}")) && error.contains("--cache-dir"), "{error}");
        }
        set(&folder, 0o700);
        let link = dir.path().join("link");
        symlink(&folder, &link).unwrap();
        assert!(place(&link, Kind::Temporary).ready().unwrap_err().to_string().contains("is no folder"));
    }

    #[test]
    fn the_users_folder_is_made_private_and_closed_where_others_may_write() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("a/brickcast");
        place(&folder, Kind::Users).ready().unwrap();
        assert_eq!(mode(&folder), 0o700);
        set(&folder, 0o775);
        place(&folder, Kind::Users).ready().unwrap();
        assert_eq!(mode(&folder), 0o755);
        let link = dir.path().join("link");
        symlink(&folder, &link).unwrap();
        place(&link, Kind::Users).ready().unwrap();
    }

    /// Only root may give files away: the folder is one's own, and someone else asks.
    #[test]
    fn another_users_folder_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("brickcast");
        place(&folder, Kind::Users).ready().unwrap();
        let own = rustix::process::geteuid().as_raw();
        for kind in [Kind::Users, Kind::Temporary] {
            let error = place(&folder, kind.clone()).check(own + 1).unwrap_err().to_string();
            let words = format!("belongs to user {own} and not to you (user {})", own + 1);
            assert!(error.contains(&words), "{error}");
            place(&folder, kind).check(own).unwrap();
        }
    }
}
