use brickcast_volume::lod::Rule;
use brickcast_volume::scene::{Look, Quality, ViewSpec};
use brickcast_volume::style::{Integration, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{Camera, Geometry, Orbit, PictureSize};

use super::*;

fn manifest() -> PictureManifest {
    let geometry = Geometry::new([8; 3], [1.0; 3], [0.0; 3]).unwrap();
    let orbit = Orbit { azimuth: 33.3, elevation: 0.1, ..Orbit::default() };
    let integration = Integration::Preintegrated(TableSize::N1024);
    let style = Style { integration, shading: Some(Phong::default()), ..Style::default() };
    let function = TransferFunction::window(0.1, 0.7, 0.3, Colormap::Turbo).unwrap();
    let look = Look { style, ..Look::new(function, 1.0 / 3.0) };
    let view = ViewSpec { camera: Camera::orbit(&geometry, orbit).unwrap(), size: PictureSize::new(12, 9).unwrap() };
    let node = |i: u32| NodeNote {
        address: format!("127.0.0.1:{i}"),
        node_id: "7".to_owned(),
        version: "0.1.0".to_owned(),
        backend: "cpu".to_owned(),
        adapter: "one".to_owned(),
    };
    PictureManifest {
        scene: Scene::new(look, view, Quality::default()).unwrap(),
        transport: Transport::F16,
        lod: Lod::Auto(Rule::Error { pixels: 0.3 }),
        store: StoreHash(42),
        step: Some(3),
        path: Some("part".to_owned()),
        background: Some([0.1, 0.2, 0.7]),
        complete: true,
        marks_hidden: true,
        about: AboutPicture {
            brickcast: "0.1.0".to_owned(),
            protocol: 7,
            nodes: vec![node(1), node(2)],
            lost: vec![LostNote { address: "a".to_owned(), why: "b".to_owned() }],
            missing_tiles: vec![[1, 2]],
            hidden: Some(HiddenNote::nothing()),
            empty: true,
            empty_because: Some("why".to_owned()),
            ..AboutPicture::default()
        },
    }
}

fn read(value: &Value) -> Result<Vec<PictureManifest>, String> {
    of_text(Path::new("a.png.json"), &format!("{value:#}")).map_err(|error| error.to_string())
}

#[test]
fn what_is_written_is_read_back_alone_and_in_an_animation() {
    let manifest = manifest();
    let value = serde_json::to_value(&manifest).unwrap();
    assert_eq!(read(&value), Ok(vec![manifest.clone()]));
    assert_eq!(read(&json!({ "frames": [&manifest, &manifest] })), Ok(vec![manifest.clone(), manifest.clone()]));
    assert_eq!(serde_json::from_value::<PictureManifest>(value).unwrap(), manifest);
}

/// Those of versions that knew neither path nor background.
#[test]
fn earlier_manifests_are_read() {
    let mut value = serde_json::to_value(manifest()).unwrap();
    for key in ["lod", "path", "background", "empty", "empty_because", "nodes", "epoch", "store_short", "notes"] {
        value.as_object_mut().unwrap().remove(key);
    }
    let read = read(&value).unwrap().remove(0);
    assert_eq!((read.path, read.background, read.lod), (None, None, Lod::Full));
    assert_eq!(read.scene, manifest().scene);
}

#[test]
fn what_is_no_manifest_is_refused_with_field_and_value() {
    let good = serde_json::to_value(manifest()).unwrap();
    let spoiled = |key: &str, with: Value| {
        let mut value = good.clone();
        value[key] = with;
        read(&value).unwrap_err()
    };
    for (key, with, words) in [
        ("store", json!("xyz"), &["store = \"xyz\""][..]),
        ("transport", json!("f64"), &["transport = \"f64\"", "f16, f32, u8"]),
        ("exact", json!(true), &["transport = \"f16\"", "f32"]),
        ("background", json!([0, 0, 2]), &["background = [0,0,2]", "between 0 and 1"]),
        ("complete", json!("yes"), &["complete = \"yes\""]),
        ("nodes", json!([1]), &["nodes = [1]"]),
        ("step", json!(null), &["step is missing"]),
        ("level", json!(2), &["level is not known"]),
        ("lod", json!("half"), &["lod = \"half\"", "\"full\""]),
        ("frames", json!([1]), &["is not known"]),
    ] {
        let error = spoiled(key, with);
        let named = words.iter().all(|word| error.contains(word)) && error.starts_with("a.png.json: ");
        assert!(named, "{error}");
    }
    for (value, words) in [
        (json!([]), "an object is needed"),
        (json!({}), "missing"),
        (json!({ "frames": [] }), "between 1 and"),
        (json!({ "frames": [&good, 3] }), "frames[1] = 3"),
        (json!({ "frames": 3 }), "a list is needed"),
    ] {
        let error = read(&value).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
    let text = good.to_string();
    let error = of_text(Path::new("a.json"), &text[..text.len() / 2]).unwrap_err().to_string();
    assert!(error.contains("a.json") && error.contains("not JSON") && error.contains("line 1"), "{error}");
}

/// Bytes changed, cut out and doubled: a manifest or an error, never a panic.
#[test]
fn mutated_manifests_are_read_or_refused() {
    let text = format!("{:#}", json!({ "frames": [manifest(), manifest()] })).into_bytes();
    let mut random = 7_u64;
    let mut below = |n: usize| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize % n
    };
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let mut bytes = text.clone();
        for _ in 0..=below(3) {
            let (at, to) = (below(bytes.len()), below(bytes.len()));
            match below(5) {
                0 => bytes[at] = b"0123456789-.eE\"{}[],:xnt"[below(24)],
                1 => bytes.truncate(at.max(1)),
                2 => drop(bytes.drain(at.min(to)..at.max(to).min(at.min(to) + 40))),
                3 => bytes[at] = bytes[to],
                _ => {
                    let part = bytes[at..(at + 30).min(bytes.len())].to_vec();
                    drop(bytes.splice(to..to, part));
                }
            }
        }
        match of_text(Path::new("a"), &String::from_utf8_lossy(&bytes)) {
            Ok(manifests) => {
                read += 1;
                assert!(manifests.iter().all(|m| m.scene.with(|_| ()).is_ok()));
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().len() < 2000, "{error}");
            }
        }
    }
    assert!(read > 20 && refused > 2000, "{read} {refused}");
}

#[test]
fn files_that_are_no_files_or_too_long_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.json");
    std::fs::File::create(&path).unwrap().set_len(MAX_MANIFEST_BYTES + 1).unwrap();
    for path in [&path, folder.path(), &folder.path().join("none.json")] {
        let error = read_manifest(path).unwrap_err().to_string();
        assert!(error.contains(path.to_str().unwrap()), "{error}");
    }
}
