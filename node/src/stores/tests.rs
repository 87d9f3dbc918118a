//! Which stores are found, opened and refused.

use super::*;
use crate::testing::{make_store, ramp};

fn by_name(name: &str) -> StoreQuery {
    StoreQuery::Name { name: name.to_owned(), expected: None }
}

#[test]
fn stores_are_found_below_the_root_by_name_and_by_hash() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("scans/2024")).unwrap();
    let hash = make_store(&folder.path().join("scans/2024/ramp"), ramp);
    let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    assert_eq!(stores.list(), [StoreName { name: "scans/2024/ramp".to_owned(), hash }]);
    assert_eq!(stores.by_hash(hash).unwrap().name, "scans/2024/ramp");
    assert_eq!(stores.query(&by_name("scans/2024/ramp")).unwrap().store.hash(), hash);
    let single = Stores::new(&DataRoot::Single(folder.path().join("scans/2024/ramp"))).unwrap();
    assert_eq!(single.list()[0].name, "ramp");
    assert!(single.query(&by_name("ramp")).is_ok() && single.query(&by_name("other")).is_err());
}

#[test]
fn an_unknown_store_is_told_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    assert!(stores.by_hash(StoreHash(5)).unwrap_err().to_string().contains("no store below"));
    let hash = make_store(&folder.path().join("ramp"), ramp);
    std::thread::sleep(SCAN_INTERVAL);
    for error in [stores.by_hash(StoreHash(5)).unwrap_err(), stores.query(&by_name("rump")).unwrap_err()] {
        assert!(matches!(error, NodeError::UnknownStore { .. } | NodeError::UnknownName { .. }), "{error}");
        assert!(error.to_string().contains(&format!("`ramp` ({hash})")), "{error}");
    }
    let error = stores.query(&StoreQuery::Name { name: "ramp".to_owned(), expected: Some(StoreHash(5)) });
    let error = error.unwrap_err();
    assert!(matches!(error, NodeError::OtherContent { .. }), "{error}");
    assert!(error.to_string().contains(&hash.to_string()) && error.to_string().contains("ramp"), "{error}");
}

#[test]
fn names_that_lead_outside_the_data_root_are_refused() {
    let outside = tempfile::tempdir().unwrap();
    make_store(&outside.path().join("secret"), ramp);
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("inner")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outside.path(), folder.path().join("link")).unwrap();
    let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    let absolute = outside.path().join("secret").display().to_string();
    let dotted = format!("../{}/secret", outside.path().file_name().unwrap().display());
    let mut bad = vec!["", "..", ".", "inner/../..", "inner/../inner/..", "/", "a\0b", &absolute, &dotted];
    if cfg!(unix) {
        bad.extend(["link", "link/secret", "link/nothing"]);
    }
    for name in bad {
        let error = stores.query(&by_name(name)).unwrap_err();
        assert!(matches!(error, NodeError::BadName { .. }), "{name}: {error}");
    }
    assert!(stores.list().is_empty(), "a link must not put outside stores into the index");
}

/// A link in the store itself, and one behind a link that stays inside. Links that no read goes through do not matter.
#[cfg(unix)]
#[test]
fn links_of_a_store_that_lead_outside_are_refused_however_deep() {
    use std::os::unix::fs::symlink;
    let outside = tempfile::tempdir().unwrap();
    make_store(&outside.path().join("secret"), ramp);
    let secret = |path: &str| outside.path().join("secret").join(path);
    // What of the store is moved to the folder `inner`, with a link that stays inside in its place; then what becomes a
    // link to where.
    for (moved, at, to, refused) in [
        ("0", "inner/unrelated", secret("0"), None),
        ("0", "ramp/round", "..".into(), None),
        ("0", "ramp/gone", "nothing".into(), None),
        ("0", "inner/c", secret("0/c"), Some("0/c/0/0/0")),
        ("bricks.bin", "ramp/0/c/0", secret("0/c/0"), Some("0/c/0/0/0")),
        ("0", "inner/zarr.json", secret("0/zarr.json"), Some("0/zarr.json")),
        ("0", "ramp/brickcast.json", secret("brickcast.json"), Some("brickcast.json")),
        ("bricks.bin", "inner", secret("bricks.bin"), Some("bricks.bin")),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let below = |path: &str| folder.path().join(path);
        make_store(&below("ramp"), ramp);
        std::fs::rename(below("ramp").join(moved), below("inner")).unwrap();
        symlink("../inner", below("ramp").join(moved)).unwrap();
        if below(at).symlink_metadata().is_ok() {
            std::fs::rename(below(at), below("replaced")).unwrap();
        }
        symlink(to, below(at)).unwrap();
        let answer = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap().query(&by_name("ramp"));
        match (refused, answer) {
            (None, answer) => assert!(answer.is_ok(), "{at}: {answer:?}"),
            (Some(named), Err(NodeError::Outside { name, file })) => {
                assert_eq!((name.as_str(), file.to_str()), ("ramp", Some(named)), "{at}");
            }
            (Some(_), answer) => panic!("{at}: {answer:?}"),
        }
    }
}

/// A single store was named by whoever runs the node: its links lead wherever they lead.
#[cfg(unix)]
#[test]
fn links_of_a_single_store_are_followed() {
    let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    make_store(&folder.path().join("ramp"), ramp);
    std::fs::rename(folder.path().join("ramp/0"), outside.path().join("0")).unwrap();
    std::os::unix::fs::symlink(outside.path().join("0"), folder.path().join("ramp/0")).unwrap();
    let stores = Stores::new(&DataRoot::Single(folder.path().join("ramp"))).unwrap();
    assert!(stores.query(&by_name("ramp")).is_ok());
}

#[cfg(unix)]
#[test]
fn links_that_go_round_in_circles_end() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(folder.path(), folder.path().join("round")).unwrap();
    make_store(&folder.path().join("ramp"), ramp);
    let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    let names: Vec<String> = stores.list().into_iter().map(|s| s.name).collect();
    assert!(names.contains(&"ramp".to_owned()) && names.len() <= MAX_DEPTH as usize, "{names:?}");
}

#[test]
fn a_store_that_was_replaced_is_not_served_under_its_old_hash() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ramp");
    let old = make_store(&path, ramp);
    let stores = Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    assert_eq!(stores.list().len(), 1);
    std::fs::remove_dir_all(&path).unwrap();
    let new = make_store(&path, |x, _, _| x as u8);
    assert!(matches!(stores.by_hash(old), Err(NodeError::OtherContent { got, .. }) if got == new));
    std::thread::sleep(SCAN_INTERVAL);
    assert!(stores.by_hash(new).is_ok());
    assert!(matches!(stores.by_hash(old), Err(NodeError::UnknownStore { .. })));
}

#[test]
fn a_missing_data_root_is_named() {
    let error = Stores::new(&DataRoot::Folder("no/such/folder".into())).unwrap_err().to_string();
    assert!(error.contains("no/such/folder") && error.contains("--data"), "{error}");
}

/// A level is a store within a store: known by its own hash, named by nobody.
#[test]
fn levels_are_found_by_their_hash_below_any_root_and_are_not_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scans/ramp");
    std::fs::create_dir_all(folder.path().join("scans")).unwrap();
    let root = make_store(&path, ramp);
    let store = Store::open(&path).unwrap();
    assert!(store.level_count() >= 3, "{}", store.level_count());
    for data in [DataRoot::Folder(folder.path().to_path_buf()), DataRoot::Single(path.clone())] {
        // Nothing was opened, listed or asked for before.
        let stores = Stores::new(&data).unwrap();
        for level in (1..store.level_count()).rev() {
            let hash = store.level(level).unwrap().hash();
            let open = stores.by_hash(hash).unwrap();
            assert_eq!((open.store.hash(), open.store.manifest().geometry), (hash, level_geometry(&store, level)));
            assert!(open.name.contains("ramp") && open.name.contains(&format!("level {level}")), "{}", open.name);
            assert!(Arc::ptr_eq(&open, &stores.by_hash(hash).unwrap()), "it stays open");
        }
        assert_eq!(stores.list().iter().map(|name| name.hash).collect::<Vec<_>>(), [root]);
        assert!(matches!(stores.by_hash(StoreHash(7)), Err(NodeError::UnknownStore { .. })));
    }
}

fn level_geometry(store: &Store, level: u8) -> brickcast_volume::Geometry {
    store.manifest().geometry.at_level(level).unwrap()
}

/// What replaced a store has other levels; those of the old one are not served, even from a copy that is half gone.
#[test]
fn levels_of_a_store_that_was_replaced_are_gone_and_those_of_a_copy_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ramp");
    make_store(&path, ramp);
    make_store(&folder.path().join("copy"), ramp);
    let hash = Store::open(&path).unwrap().level(1).unwrap().hash();
    let open = || Stores::new(&DataRoot::Folder(folder.path().to_path_buf())).unwrap();
    let (stores, late) = (open(), open());
    assert!(stores.by_hash(hash).is_ok() && late.list().len() == 2);
    std::fs::remove_dir_all(&path).unwrap();
    make_store(&path, |x, _, _| x as u8);
    stores.forget(hash);
    std::thread::sleep(SCAN_INTERVAL);
    assert_eq!(stores.by_hash(hash).unwrap().store.hash(), hash, "the copy has it");
    std::fs::remove_dir_all(folder.path().join("copy")).unwrap();
    std::thread::sleep(SCAN_INTERVAL);
    let error = late.by_hash(hash).unwrap_err();
    assert!(matches!(error, NodeError::UnknownStore { .. }), "{error}");
}
