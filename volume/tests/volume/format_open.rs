//! The choice of a format, and raw files.

use std::path::Path;

use brickcast_volume::format::{self, Endian, RawHints, VoxelType};

fn error(path: &Path, hints: &RawHints) -> String {
    format::open(path, hints).expect_err("must be refused").to_string()
}

fn holds(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "`{word}` is not in: {text}");
    }
}

#[test]
fn what_is_no_volume_file_is_told_what_would_be() {
    let folder = tempfile::tempdir().unwrap();
    let none = RawHints::default();
    holds(&error(folder.path(), &none), &["is a directory", ".nrrd", ".nhdr", ".raw"]);
    holds(&error(&folder.path().join("absent.nrrd"), &none), &["absent.nrrd", "cannot open"]);
    for name in ["empty.nrrd", "empty.raw", "empty"] {
        std::fs::write(folder.path().join(name), b"").unwrap();
        holds(&error(&folder.path().join(name), &none), &[name, "0 bytes"]);
    }
    for name in ["x.tif", "x", "x.raw.bak"] {
        std::fs::write(folder.path().join(name), b"II*\0\x1b[31m").unwrap();
        let text = error(&folder.path().join(name), &none);
        holds(&text, &[name, "II*", ".nrrd", ".raw", "--dims"]);
        assert!(!text.contains('\x1b'), "a control character reaches the terminal");
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_and_never_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.nrrd");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    holds(&error(&pipe, &RawHints::default()), &["pipe.nrrd", "a named pipe", "regular file"]);
    let header = folder.path().join("x.nhdr");
    let text = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\nline skip: 1\ndata file: pipe.nrrd\n";
    std::fs::write(&header, text).unwrap();
    holds(&error(&header, &RawHints::default()), &["pipe.nrrd", "a named pipe", "regular file"]);
}

#[test]
fn an_nrrd_is_known_by_its_content_under_any_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x_9x9x9_uint16.raw");
    std::fs::write(&path, b"NRRD0001\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\nv").unwrap();
    let source = format::open(&path, &RawHints { skip: 1, ..RawHints::default() }).unwrap();
    assert_eq!(source.header().format, "NRRD");
    assert!(source.header().notes.iter().any(|note| note.contains("--dims")), "{:?}", source.header().notes);
}

#[test]
fn a_raw_file_is_read_by_its_name_and_the_guess_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part_2x3x4_uint16.raw");
    let data: Vec<u8> = (0..48).collect();
    std::fs::write(&path, &data).unwrap();
    let mut source = format::open(&path, &RawHints::default()).unwrap();
    let header = source.header().clone();
    assert_eq!((header.geometry.dims().to_array(), header.voxel_type), ([2, 3, 4], VoxelType::U16));
    holds(&header.notes.join("\n"), &["dims 2 x 3 x 4 read", "type uint16 read", "little assumed", "spacing not said"]);
    let mut planes = Vec::new();
    source.read_planes(3, &mut planes).unwrap();
    assert_eq!(planes, data[..36]);
    source.read_planes(3, &mut planes).unwrap();
    assert_eq!(planes, data[36..]);
}

#[test]
fn hints_win_over_the_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part_9x9x9_float32_le.dat");
    std::fs::write(&path, [b"head".as_slice(), &[1, 2, 3, 4]].concat()).unwrap();
    let hints = RawHints {
        dims: Some([2, 1, 1]),
        voxel_type: Some(VoxelType::I16),
        endian: Some(Endian::Big),
        skip: 4,
        spacing: Some([0.5, 1.0, 2.0]),
        origin: Some([1.0, 2.0, 3.0]),
        ..RawHints::default()
    };
    let mut source = format::open(&path, &hints).unwrap();
    let mut planes = Vec::new();
    source.read_planes(1, &mut planes).unwrap();
    assert_eq!(planes, [2, 1, 4, 3]);
    assert_eq!(source.header().geometry.spacing().to_array(), [0.5, 1.0, 2.0]);
    assert_eq!(source.header().geometry.origin().to_array(), [1.0, 2.0, 3.0]);
    assert_eq!(source.header().notes, [""; 0]);
}

#[test]
fn a_raw_file_without_dims_or_type_names_the_flags() {
    let folder = tempfile::tempdir().unwrap();
    let all = ["--dims X,Y,Z", "--type uint16", "--endian little", "--skip N", "--spacing X,Y,Z"];
    for (name, words) in [
        ("plain.raw", vec!["dims and type"]),
        ("a_2x3x4.raw", vec!["say its type", "48 bytes are 2 per voxel"]),
        ("a_2x3x5.raw", vec!["say its type", "no multiple of the 30"]),
        ("a_uint16.raw", vec!["say its dims", "24 voxels of uint16"]),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, [0; 48]).unwrap();
        let text = error(&path, &RawHints::default());
        holds(&text, &all);
        holds(&text, &words);
    }
}

#[test]
fn a_raw_file_of_another_length_or_impossible_shape_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.raw");
    std::fs::write(&path, [0; 48]).unwrap();
    let hints = |dims, skip, spacing: f64| RawHints {
        dims: Some(dims),
        voxel_type: Some(VoxelType::U16),
        skip,
        spacing: Some([spacing; 3]),
        ..RawHints::default()
    };
    assert!(format::open(&path, &hints([2, 3, 4], 0, 1.0)).is_ok());
    holds(&error(&path, &hints([2, 3, 5], 0, 1.0)), &["too short", "48 bytes", "60", "12 are missing"]);
    holds(&error(&path, &hints([2, 3, 3], 0, 1.0)), &["oversized", "48 bytes", "36", "12 are too many"]);
    holds(&error(&path, &hints([2, 3, 4], u64::MAX, 1.0)), &["too short", "0 bytes"]);
    holds(&error(&path, &hints([0, 3, 4], 0, 1.0)), &["[0, 3, 4]"]);
    holds(&error(&path, &hints([u32::MAX; 3], 0, 1.0)), &["4294967295"]);
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        holds(&error(&path, &hints([2, 3, 4], 0, spacing)), &["spacing ["]);
    }
}
