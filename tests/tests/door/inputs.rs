//! Inputs through the command line: the cache notices every file that a volume is read from, and notes stay with the
//! volume.

use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_ok, cached_stores};
use brickcast_tests::turn;

const N: usize = 12;

/// A ball or a slab of `inside`, in planes.
fn voxels(is_ball: bool, inside: u8) -> Vec<u8> {
    let far = |i: usize| (i as f64 - 5.5).powi(2);
    let at = |x: usize, y: usize, z: usize| if is_ball { far(x) + far(y) + far(z) < 20.0 } else { far(x) < 4.0 };
    let all = (0..N).flat_map(|z| (0..N).flat_map(move |y| (0..N).map(move |x| (x, y, z))));
    all.map(|(x, y, z)| if at(x, y, z) { inside } else { 0 }).collect()
}

fn render(at: &Path, args: &[&str], cache: &str) -> Vec<u8> {
    let fixed = ["-o", "a.png", "--size", "24x24", "--backend", "cpu", "--azimuth", "0", "--cache-dir", cache];
    brickcast_ok(at, &[&["render"], args, &fixed].concat());
    std::fs::read(at.join("a.png")).unwrap()
}

fn write_data(at: &Path, names: &[&str], data: &[u8]) {
    for (name, part) in names.iter().zip(data.chunks(data.len() / names.len())) {
        std::fs::write(at.join(name), part).unwrap();
    }
}

/// Other data of the same length, behind headers as people and tools write them: the picture is the new one, as with an
/// empty cache.
#[test]
fn replaced_data_of_a_detached_header_is_noticed_however_it_is_named() {
    let _turn = turn(module_path!());
    let head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 12 12 12\nspacings: 1 1 1\nencoding: raw\n";
    let two = ["s1.raw", "s2.raw"];
    for (name, line, files) in [
        ("part.nrrd", b"data file: part.raw\n".to_vec(), &["part.raw"][..]),
        ("part.nhdr", b"Data File :  part.raw\r\n".to_vec(), &["part.raw"]),
        ("part.hdr", b"content: 5 \xb5m\ndatafile: part.raw\n".to_vec(), &["part.raw"]),
        ("list.nhdr", b"data file: LIST 3\ns1.raw\ns2.raw\n".to_vec(), &two),
        ("series.nrrd", b"data file: s%d.raw 1 2 1 3\n".to_vec(), &two),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join(name), [head.as_bytes(), &line].concat()).unwrap();
        write_data(at, files, &voxels(true, 200));
        let old = render(at, &[name], "cache");
        assert!(old == render(at, &[name], "cache"), "{name}");
        assert_eq!(cached_stores(&at.join("cache")).len(), 1, "{name}: unchanged, and made again");
        write_data(at, files, &voxels(false, 200));
        let new = render(at, &[name], "cache");
        assert!(new != old && new == render(at, &[name], "empty"), "{name}: the picture of the old data");
        // The header alone.
        std::fs::write(at.join(name), [head.replace("1 1 1", "1 2 1").as_bytes(), &line].concat()).unwrap();
        let wide = render(at, &[name], "cache");
        assert!(wide != new && wide == render(at, &[name], "other"), "{name}: the picture of the old header");
    }
}

#[test]
fn replaced_labels_of_a_detached_header_are_noticed() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("v_12x12x12_uint8.raw"), voxels(true, 200)).unwrap();
    let head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 12 12 12\nencoding: raw\nDATA FILE: l.raw\n";
    std::fs::write(at.join("l.nrrd"), head).unwrap();
    let stores = |labels: Vec<u8>| {
        std::fs::write(at.join("l.raw"), labels).unwrap();
        render(at, &["v_12x12x12_uint8.raw", "--labels", "l.nrrd"], "cache");
        cached_stores(&at.join("cache")).len()
    };
    assert_eq!(stores(vec![5; N * N * N]), 1);
    assert_eq!(stores(vec![0; N * N * N]), 2);
}

/// What a run says of a volume, and how often.
fn told(at: &Path, args: &[&str]) -> usize {
    let output = brickcast(at, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    let text = [output.stdout, output.stderr].concat();
    String::from_utf8_lossy(&text).matches("byte order not said").count()
}

#[test]
fn what_was_guessed_is_told_once_by_every_command_and_kept_beside_pictures() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let voxels: Vec<u8> = voxels(true, 200).into_iter().flat_map(|v| u16::from(v).to_le_bytes()).collect();
    std::fs::write(at.join("v_12x12x12_uint16.raw"), voxels).unwrap();
    let name = "v_12x12x12_uint16.raw";
    let render = ["-o", "a.png", "--size", "16x16", "--backend", "cpu", "--cache-dir", "cache"];
    for _ in 0..2 {
        assert_eq!(told(at, &[&["render", name], &render[..]].concat()), 1);
    }
    assert_eq!(told(at, &["prepare", name, "store"]), 1);
    assert_eq!(told(at, &[&["render", "store"], &render[..]].concat()), 1);
    for path in [name, "store"] {
        assert_eq!(told(at, &["info", path]), 1);
        let info: serde_json::Value = serde_json::from_str(&brickcast_ok(at, &["info", path, "--json"])).unwrap();
        assert!(info["notes"].to_string().contains("byte order not said"), "{info}");
    }
    std::fs::remove_file(at.join("a.png.json")).unwrap();
    assert_eq!(told(at, &[&["render", "store", "-q"], &render[..]].concat()), 0);
    let manifest: serde_json::Value = serde_json::from_slice(&std::fs::read(at.join("a.png.json")).unwrap()).unwrap();
    assert!(manifest["notes"].to_string().contains("byte order not said"), "{manifest}");
}
