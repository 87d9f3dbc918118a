//! Links, of files and of folders on the way, before, while and after something is opened.

use std::fs;
use std::os::unix::fs::symlink;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::*;
use crate::store::objects::Objects as _;
use crate::store::objects::folder::StoreFolder;

const INSIDE: &str = "inside";
const OUTSIDE: &str = "not for clients";

struct Site {
    root: tempfile::TempDir,
    outside: tempfile::TempDir,
}

impl Site {
    /// `folder/file` below the root and outside of it, and a jail on the root.
    fn new() -> (Self, Jail) {
        let site = Self { root: tempfile::tempdir().unwrap(), outside: tempfile::tempdir().unwrap() };
        for (at, content) in [(&site.root, INSIDE), (&site.outside, OUTSIDE)] {
            fs::create_dir(at.path().join("folder")).unwrap();
            fs::write(at.path().join("folder/file"), content).unwrap();
        }
        let jail = Jail::new(site.root.path()).unwrap();
        (site, jail)
    }

    fn at(&self, relative: &str) -> PathBuf {
        self.root.path().join(relative)
    }
}

fn read(jail: &Jail, folder: &str, file: &str) -> Result<String, StoreError> {
    let bytes = jail.folder(Path::new(folder)).open(file)?.read_at_most(u64::MAX)?;
    Ok(String::from_utf8(bytes.into()).unwrap())
}

#[test]
fn links_that_stay_inside_are_followed_and_others_are_not() {
    for jail_of in [usual, by_steps] {
        follows_only_what_stays_inside(jail_of);
    }
}

fn follows_only_what_stays_inside(jail_of: fn(&Path) -> Jail) {
    let (site, _) = Site::new();
    let jail = jail_of(site.root.path());
    symlink("folder", site.at("relative")).unwrap();
    symlink(site.at("relative"), site.at("absolute")).unwrap();
    symlink("../absolute/file", site.at("folder/link")).unwrap();
    for (folder, file) in
        [("folder", "file"), ("relative", "file"), ("absolute", "file"), ("", "folder/link"), ("absolute", "link")]
    {
        assert_eq!(read(&jail, folder, file).unwrap(), INSIDE, "{folder}/{file}");
    }
    symlink(site.outside.path().join("folder"), site.at("out")).unwrap();
    symlink(site.outside.path().join("folder/file"), site.at("folder/out")).unwrap();
    symlink("out", site.at("twice")).unwrap();
    symlink("../../../../../../../../../../../etc", site.at("climbs")).unwrap();
    for (folder, file) in [
        ("out", "file"),
        ("out", "nothing"),
        ("folder", "out"),
        ("absolute", "out"),
        ("twice", "file"),
        ("climbs", "passwd"),
        ("folder", "../folder/file"),
        ("..", "file"),
        ("/", "etc/passwd"),
    ] {
        let error = read(&jail, folder, file).unwrap_err();
        assert!(matches!(&error, StoreError::Outside { file: named } if *named == *file), "{folder}/{file}: {error}");
    }
    for refused in ["out", "twice", "out/nothing", ".."] {
        assert!(matches!(jail.subfolders(Path::new(refused)), Err(StoreError::Outside { .. })), "{refused}");
    }
}

#[test]
fn what_is_missing_or_no_file_is_said_so() {
    for jail_of in [usual, by_steps] {
        says_what_is_missing_or_no_file(jail_of);
    }
}

fn says_what_is_missing_or_no_file(jail_of: fn(&Path) -> Jail) {
    let (site, _) = Site::new();
    let jail = jail_of(site.root.path());
    symlink("nothing", site.at("dangling")).unwrap();
    symlink("round", site.at("round")).unwrap();
    for (folder, file, kind) in [
        ("folder", "nothing", io::ErrorKind::NotFound),
        ("nothing", "file", io::ErrorKind::NotFound),
        ("", "dangling", io::ErrorKind::NotFound),
        ("folder", "file/file", io::ErrorKind::NotADirectory),
    ] {
        let error = read(&jail, folder, file).unwrap_err();
        assert!(matches!(&error, StoreError::Io { source, .. } if source.kind() == kind), "{folder}/{file}: {error}");
    }
    assert!(matches!(read(&jail, "", "round"), Err(StoreError::Io { .. })));
    assert!(matches!(read(&jail, "", "folder"), Err(StoreError::NotAFile { .. })));
    assert!(matches!(jail.subfolders(Path::new("folder/file")).map(drop), Err(StoreError::Io { .. })));
    assert!(Jail::new(&site.at("nothing")).is_err() && Jail::new(&site.at("folder/file")).is_err());
}

#[test]
fn folders_are_listed_and_links_that_may_be_folders() {
    let (site, jail) = Site::new();
    symlink("folder", site.at("link")).unwrap();
    fs::write(site.at("plain"), "").unwrap();
    let names = |at: &str| {
        let mut names: Vec<_> = jail.subfolders(Path::new(at)).unwrap().collect();
        names.sort();
        names
    };
    assert_eq!(names(""), ["folder", "link"]);
    assert!(names("link").is_empty());
    // The jail is the folder that it was made of, whatever is at its path now.
    let moved = site.root.path().with_extension("moved");
    fs::rename(site.root.path(), &moved).unwrap();
    symlink(site.outside.path(), site.root.path()).unwrap();
    assert_eq!(read(&jail, "folder", "file").unwrap(), INSIDE);
    fs::remove_file(site.root.path()).unwrap();
    fs::rename(&moved, site.root.path()).unwrap();
}

/// A FIFO without a writer would let an open for reading wait for ever.
#[test]
fn a_fifo_does_not_hang() {
    let (site, jail) = Site::new();
    assert!(std::process::Command::new("mkfifo").arg(site.at("fifo")).status().unwrap().success());
    let (done, waits) = std::sync::mpsc::channel();
    for folder in [jail.folder(Path::new("")), StoreFolder::free(site.root.path())] {
        let done = done.clone();
        std::thread::spawn(move || done.send(folder.open("fifo").map(drop)).unwrap());
        let opened = waits.recv_timeout(Duration::from_secs(10)).expect("the open must not wait for a writer");
        assert!(matches!(opened, Err(StoreError::NotAFile { .. })), "{opened:?}");
    }
}

/// While one thread swaps `swapped` between the real thing and a link that leads out, as fast as it can, another opens
/// `folder/file` again and again. What it reads is from inside, always.
fn race(swapped: &str, jail_of: fn(&Path) -> Jail) {
    let (site, _) = Site::new();
    let jail = jail_of(site.root.path());
    let (real, link, at) = (site.at("real"), site.at("link"), site.at(swapped));
    symlink(site.outside.path().join(swapped), &link).unwrap();
    let stop = AtomicBool::new(false);
    let (mut inside, mut refused) = (0, 0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                fs::rename(&at, &real).unwrap();
                fs::rename(&link, &at).unwrap();
                fs::rename(&at, &link).unwrap();
                fs::rename(&real, &at).unwrap();
            }
        });
        let started = Instant::now();
        let mut outcome = Ok(());
        for opens in 0.. {
            // Looking, then opening by path lets something out every 10,000 opens or so. Both outcomes must be met, or
            // nothing was shown; a busy machine may take its time.
            let enough = opens >= 100_000 && inside > 100 && refused > 100;
            if enough || outcome.is_err() || started.elapsed() > Duration::from_secs(60) {
                break;
            }
            match read(&jail, "folder", "file") {
                Ok(text) if text == INSIDE => inside += 1,
                Err(StoreError::Outside { .. }) => refused += 1,
                // Between two renames.
                Err(StoreError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {}
                other => outcome = Err(format!("open {opens}: {other:?}")),
            }
        }
        stop.store(true, Ordering::Relaxed);
        assert_eq!(outcome, Ok(()));
    });
    assert!(inside > 100 && refused > 100, "{inside} reads from inside, {refused} refused");
}

fn usual(root: &Path) -> Jail {
    Jail::new(root).unwrap()
}

/// A jail as where the system cannot go the whole way in one call.
fn by_steps(root: &Path) -> Jail {
    let mut inner = Arc::into_inner(usual(root).inner).unwrap();
    inner.held.at_once = false;
    Jail { inner: Arc::new(inner) }
}

#[test]
fn a_folder_swapped_for_a_link_while_it_is_opened_is_never_followed() {
    race("folder", usual);
}

#[test]
fn a_file_swapped_for_a_link_while_it_is_opened_is_never_followed() {
    race("folder/file", usual);
}

#[test]
fn a_folder_swapped_while_the_way_is_gone_step_by_step_is_never_followed() {
    race("folder", by_steps);
}

#[test]
fn a_file_swapped_while_the_way_is_gone_step_by_step_is_never_followed() {
    race("folder/file", by_steps);
}
