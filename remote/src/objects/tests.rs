//! Objects of a server in memory.

#![allow(clippy::single_range_in_vec_init)] // a list of one range is meant

use object_store::memory::InMemory;
use object_store::{ObjectStoreExt as _, PutPayload};
use tokio::sync::Semaphore;

use super::*;

/// `lab/store/KEY` for each, and the server.
fn objects(files: &[(&str, &[u8])]) -> (RemoteObjects, Arc<InMemory>) {
    let store = Arc::new(InMemory::new());
    for (key, content) in files {
        put(&store, key, content);
    }
    let server = Server { store: store.clone(), turns: Arc::new(Semaphore::new(AT_ONCE)), hint: "" };
    (RemoteObjects::new(server, PathBuf::from("s3://b/lab/store"), Path::from("lab/store")), store)
}

fn put(store: &Arc<InMemory>, key: &str, content: &[u8]) {
    let (store, path) = (store.clone(), Path::from(format!("lab/store/{key}")));
    let payload = PutPayload::from(content.to_vec());
    let put = async move { store.put(&path, payload).await.map_err(|e| RemoteError::Setting(e.to_string())) };
    wait_for(put).unwrap();
}

fn kind(error: &StoreError) -> Option<std::io::ErrorKind> {
    match error {
        StoreError::Io { source, .. } => Some(source.kind()),
        _ => None,
    }
}

#[test]
fn ranges_come_as_asked_from_the_head_and_from_beyond_it() {
    let content: Vec<u8> = (0..300_000u32).map(|i| (i % 251) as u8).collect();
    let (objects, _) = objects(&[("a/b", &content), ("empty", b"")]);
    let object = objects.open("a/b").unwrap();
    assert_eq!(object.size().unwrap(), 300_000);
    let ranges = [299_990..300_000, 0..4, 7..7, 131_000..131_100, 200_000..200_001];
    let pieces = object.read(&ranges).unwrap();
    for (piece, range) in pieces.iter().zip(ranges) {
        assert_eq!(&piece[..], &content[range.start as usize..range.end as usize], "{range:?}");
    }
    let beyond = object.read(&[0..4, 299_999..300_001]).unwrap_err();
    assert_eq!(kind(&beyond), Some(std::io::ErrorKind::UnexpectedEof));
    assert!(beyond.to_string().contains("s3://b/lab/store/a/b"), "{beyond}");
    assert_eq!(objects.open("empty").unwrap().size().unwrap(), 0);
    let missing = objects.open("a").unwrap_err();
    assert_eq!(kind(&missing), Some(std::io::ErrorKind::NotFound));
    assert!(matches!(objects.open("../other").unwrap_err(), StoreError::Io { .. }));
}

#[test]
fn what_was_promised_is_believed_until_it_is_read() {
    let (objects, _) = objects(&[("short", b"0123456789")]);
    let wrong = objects.open_promised("short", 12).unwrap();
    assert_eq!(wrong.size().unwrap(), 12);
    for range in [2..4, 9..12, 11..12] {
        let error = wrong.read(std::slice::from_ref(&range)).unwrap_err();
        assert!(matches!(error, StoreError::FileLength { got: 10, want: 12, .. }), "{range:?}: {error}");
    }
    assert_eq!(objects.open_promised("short", 10).unwrap().read(&[2..4]).unwrap(), [&b"23"[..]]);
    let missing = objects.open_promised("none", 10).unwrap().read(&[2..4]).unwrap_err();
    assert_eq!(kind(&missing), Some(std::io::ErrorKind::NotFound));
}

#[test]
fn an_object_that_takes_anothers_key_is_not_taken_for_it() {
    let (objects, store) = objects(&[("a", &[1; 300_000])]);
    let object = objects.open("a").unwrap();
    put(&store, "a", &[2; 300_000]);
    let error = object.read(&[200_000..200_010]).unwrap_err();
    assert!(error.to_string().contains("replaced since it was opened"), "{error}");
    assert_eq!(objects.open("a").unwrap().read(&[200_000..200_003]).unwrap(), [&[2u8; 3][..]]);
}

#[test]
fn what_is_foreseen_is_fetched_once_and_what_is_not_there_is_told_when_it_is_opened() {
    let (objects, store) = objects(&[("small", b"12"), ("large", &[3; 200_000])]);
    objects.foresee(&[("small".into(), 9), ("large".into(), 200_000), ("none".into(), 9), ("large".into(), 1)]);
    put(&store, "small", b"34");
    put(&store, "large", &[4; 200_000]);
    for _ in 0..2 {
        assert_eq!(objects.open("small").unwrap().read(&[0..2]).unwrap(), [&b"12"[..]], "small ones are kept");
    }
    let large = |want: u8| {
        let read = objects.open("large").unwrap().read(&[0..1, 199_999..200_000]).unwrap();
        assert_eq!(read, [&[want][..], &[want]]);
    };
    large(3);
    large(4);
    assert_eq!(kind(&objects.open("none").unwrap_err()), Some(std::io::ErrorKind::NotFound));
}
