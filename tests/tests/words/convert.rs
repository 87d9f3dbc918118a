//! Stores and inputs as files again: what was taken in comes out, whole, cropped, at a level, as labels.

use std::fs;
use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_both, brickcast_ok};
use brickcast_volume::format::{RawHints, SourceHeader};
use serde_json::Value;

/// Over an inner chunk's edge on two axes.
const DIMS: [usize; 3] = [45, 20, 37];

fn read(path: &Path) -> (SourceHeader, Vec<u8>) {
    let mut source = brickcast_formats::open(path, &RawHints::default()).unwrap();
    let mut voxels = Vec::new();
    source.read_planes(u32::MAX, &mut voxels).unwrap();
    (source.header().clone(), voxels)
}

fn count() -> usize {
    DIMS.iter().product()
}

/// As NRRD, with a spacing and a place of its own.
fn nrrd(path: &Path, voxel_type: &str, more: &str, voxels: &[u8]) {
    let [x, y, z] = DIMS;
    let head = format!(
        "NRRD0004\ntype: {voxel_type}\ndimension: 3\nsizes: {x} {y} {z}\nspace: left-posterior-superior\n\
         space directions: (0,0.5,0) (-0.25,0,0) (0,0,2)\nspace origin: (1,-2,3)\nspace units: \"mm\" \"mm\" \"mm\"\n\
         endian: little\n{more}encoding: raw\n\n"
    );
    fs::write(path, [head.as_bytes(), voxels].concat()).unwrap();
}

fn bytes<const N: usize>(value: impl Fn(usize) -> [u8; N]) -> Vec<u8> {
    (0..count()).flat_map(value).collect()
}

/// 0 to 65,535 for every type, with zeros first: some inner chunks are not stored at all.
fn number(i: usize) -> u16 {
    if i < 20_000 { 0 } else { ((i * 40_503) >> 3) as u16 }
}

#[test]
fn every_type_comes_out_of_a_store_as_it_went_in() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let whole: [(&str, Vec<u8>); 10] = [
        ("uint8", bytes(|i| [number(i) as u8])),
        ("int8", bytes(|i| [number(i) as u8])),
        ("uint16", bytes(|i| number(i).to_le_bytes())),
        ("int16", bytes(|i| number(i).to_le_bytes())),
        // Whole numbers that 16 bits hold are only shifted.
        ("uint32", bytes(|i| (3_000_000_000 + u32::from(number(i))).to_le_bytes())),
        ("int32", bytes(|i| (i32::from(number(i)) - 70_000).to_le_bytes())),
        ("float", bytes(|i| (f32::from(number(i)) - 1024.0).to_le_bytes())),
        ("uint64", bytes(|i| ((1u64 << 40) + u64::from(number(i))).to_le_bytes())),
        ("int64", bytes(|i| (i64::from(number(i)) - (1 << 40)).to_le_bytes())),
        ("double", bytes(|i| (f64::from(number(i)) + 4e9).to_le_bytes())),
    ];
    for (voxel_type, voxels) in whole {
        nrrd(&at.join("in.nrrd"), voxel_type, "", &voxels);
        brickcast_ok(at, &["prepare", "in.nrrd", "store", "--brick", "16", "--force"]);
        brickcast_ok(at, &["convert", "store", "out.nrrd", "--force"]);
        let ((want, _), (got, out)) = (read(&at.join("in.nrrd")), read(&at.join("out.nrrd")));
        assert!(out == voxels, "other voxels of {voxel_type}");
        assert_eq!((got.voxel_type, got.geometry, got.space_unit), (want.voxel_type, want.geometry, want.space_unit));
    }
    // What 16 bits do not hold comes within what is said, and NaN as NaN.
    let value = |i: usize| if i.is_multiple_of(7) { f32::NAN } else { (i as f32 * 0.37).sin() * 1e-3 };
    nrrd(&at.join("in.nrrd"), "float", "", &bytes(|i| value(i).to_le_bytes()));
    brickcast_ok(at, &["prepare", "in.nrrd", "store", "--force"]);
    let (said, notes) = brickcast_both(at, &["convert", "store", "out.npy"]);
    let words = said + &notes;
    assert!(words.contains("values within 1.5") && words.contains("16 bits"), "{words}");
    let (_, out) = read(&at.join("out.npy"));
    for (i, b) in out.as_chunks::<4>().0.iter().enumerate() {
        let (got, want) = (f32::from_le_bytes(*b), value(i));
        assert!((got.is_nan() && want.is_nan()) || (got - want).abs() < 1.6e-8, "{i}: {got} for {want}");
    }
    // Declared fill values stay, and stay declared.
    let voxels = bytes(|i| (i as i16 % 300).to_le_bytes());
    nrrd(&at.join("in.nrrd"), "int16", "missing_value:=17\n", &voxels);
    brickcast_ok(at, &["prepare", "in.nrrd", "store", "--force"]);
    brickcast_ok(at, &["convert", "store", "out.nrrd", "--force"]);
    let (header, out) = read(&at.join("out.nrrd"));
    assert!(out == voxels && header.no_data == [17.0], "{:?}", header.no_data);
}

#[test]
fn a_box_a_level_and_labels_come_out() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let [nx, ny, nz] = DIMS;
    // Slabs of twelve planes.
    let slab = |z: usize| (z / 12 * 1000) as u16;
    let voxels = bytes(|i| slab(i / (nx * ny)).to_le_bytes());
    nrrd(&at.join("in.nrrd"), "uint16", "", &voxels);
    brickcast_ok(at, &["prepare", "in.nrrd", "store", "--brick", "16", "--segmentation-range", "0.001"]);
    // A box of the store, of the input, and a store of the box: the same voxels at the same place.
    let cut = ["--crop", "3:40,5:,10:20"];
    brickcast_ok(at, &[&["convert", "store", "a.nrrd"][..], &cut].concat());
    brickcast_ok(at, &[&["convert", "in.nrrd", "b.nrrd"][..], &cut].concat());
    brickcast_ok(at, &[&["prepare", "in.nrrd", "cropped"][..], &cut].concat());
    brickcast_ok(at, &["convert", "cropped", "c.nrrd"]);
    let a = read(&at.join("a.nrrd"));
    let want: Vec<u8> = (10..20).flat_map(|z| slab(z).to_le_bytes().repeat(37 * 15)).collect();
    assert!(a.1 == want && a.0.geometry.dims().to_array() == [37, 15, 10]);
    for name in ["b.nrrd", "c.nrrd"] {
        let other = read(&at.join(name));
        assert!(other.1 == a.1 && other.0.geometry == a.0.geometry, "{name}");
    }
    let whole = read(&at.join("in.nrrd")).0.geometry;
    let corner = whole.world_from_voxel(glam::DVec3::new(3.5, 5.5, 10.5));
    assert!((a.0.geometry.origin() - corner).length() < 1e-12);
    // Of level 1 each voxel is the mean of those below.
    brickcast_ok(at, &["convert", "store", "l1.nrrd", "--level", "1"]);
    let (header, level) = read(&at.join("l1.nrrd"));
    assert_eq!(header.geometry.dims().to_array(), [nx.div_ceil(2), ny.div_ceil(2), nz.div_ceil(2)].map(|n| n as u32));
    let plane = nx.div_ceil(2) * ny.div_ceil(2);
    let planes: Vec<u16> = level.chunks(2 * plane).map(|p| u16::from_le_bytes([p[0], p[1]])).collect();
    let want: Vec<u16> = (0..nz.div_ceil(2)).map(|z| slab(2 * z)).collect();
    assert_eq!(planes, want);
    // Labels: each slab is a region, but for the last, of one plane: nothing leaps there.
    brickcast_ok(at, &["convert", "store", "labels.npy", "--labels"]);
    let (header, labels) = read(&at.join("labels.npy"));
    assert_eq!(header.voxel_type.name(), "uint8");
    let firsts: Vec<u8> = labels.chunks(nx * ny).map(|plane| plane[0]).collect();
    assert!(labels.chunks(nx * ny).all(|plane| plane.iter().all(|label| *label == plane[0])));
    let want: Vec<u8> = (0..nz).map(|z| if z < 36 { z as u8 / 12 + 1 } else { 0 }).collect();
    assert_eq!(firsts, want);
    for (args, code, want) in [
        (&["convert", "in.nrrd", "x.npy", "--labels"][..], 2, "is no store, and only stores have levels and labels"),
        (&["convert", "store", "x.npy", "--level", "7"], 2, "there is no level 7: the store has the levels 0 to 2"),
        (&["convert", "cropped", "x.npy", "--labels"], 1, "regions"),
        (&["convert", "store", "x.png"], 2, "name it .nrrd"),
        (&["convert", "store", "a.nrrd"], 1, "a.nrrd is there already; --force replaces it"),
        (&["convert", "store", "x.npy", "--crop", "0:46,:,:"], 1, "the box 0:46,0:,0:"),
        (&["convert", "store", "x.npy", "--crop", "0:4"], 2, "X0:X1,Y0:Y1,Z0:Z1"),
        (&["convert", "none", "x.npy"], 1, "none"),
    ] {
        let output = brickcast(at, args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && said.contains(want), "{args:?}: {said}");
        assert!(!at.join("x.npy").exists());
    }
}

/// A file with a hole would be taken for the whole.
#[test]
fn a_broken_store_gives_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    nrrd(&at.join("in.nrrd"), "uint16", "", &bytes(|i| (i as u16).wrapping_mul(7919).to_le_bytes()));
    brickcast_ok(at, &["prepare", "in.nrrd", "store", "--levels", "0"]);
    let shard = at.join("store/0/c/0/0/0");
    let mut data = fs::read(&shard).unwrap();
    data[100] ^= 1;
    fs::write(&shard, data).unwrap();
    let output = brickcast(at, &["convert", "store", "out.nrrd"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("store/0/c/0/0/0"), "{said}");
    let left: Vec<_> = at.read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn info_says_who_said_what_and_flags_overrule_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    nrrd(&at.join("in.nrrd"), "uint16", "", &bytes(|i| (i as u16).to_le_bytes()));
    let info = |args: &[&str]| -> Value {
        let told = brickcast_ok(at, &[&["info", "--json"][..], args].concat());
        serde_json::from_str(&told).unwrap()
    };
    let of = |info: &Value| -> Vec<String> {
        let facts = ["dims", "type", "spacing", "origin", "directions", "unit", "values"];
        facts.iter().map(|fact| info["source_of"][fact].as_str().unwrap().to_owned()).collect()
    };
    let own = info(&["in.nrrd"]);
    assert_eq!(of(&own), ["header", "header", "header", "header", "header", "header", "default"]);
    assert_eq!((&own["unit"], &own["spacing"]), (&serde_json::json!("mm"), &serde_json::json!([0.5, 0.25, 2.0])));
    let flags = ["--spacing", "1,2,3", "--origin", "-4,5,6", "--axes", "x,-y,z"];
    let ours = info(&[&["in.nrrd"][..], &flags].concat());
    assert_eq!(of(&ours), ["header", "header", "flag", "flag", "flag", "header", "default"]);
    assert_eq!(ours["directions"], serde_json::json!([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]));
    let notes = ours["notes"].to_string();
    assert!(notes.contains("0.5, 0.25, 2, were left aside"), "{notes}");
    // The same of a store that is made so, of OME-Zarr, and of a stack.
    brickcast_ok(at, &[&["prepare", "in.nrrd", "store"][..], &flags].concat());
    let store = info(&["store"]);
    for fact in ["spacing", "origin", "directions"] {
        assert_eq!(store[fact], ours[fact], "{fact}");
    }
    assert_eq!(of(&store), ["store"; 7]);
    // As OME-Zarr, of which renders are views.
    brickcast_ok(at, &["prepare", "in.nrrd", "plain"]);
    fs::remove_file(at.join("plain/brickcast.json")).unwrap();
    let zarr = info(&[&["plain"][..], &flags].concat());
    assert_eq!((&zarr["spacing"], &zarr["origin"]), (&ours["spacing"], &ours["origin"]), "{zarr:#}");
    let render = |input: &str, out: &str| {
        let view = ["--backend", "cpu", "--size", "64", "--cache-dir", "cache", "--exact"];
        brickcast_ok(at, &[&["render", input, "-o", out][..], &view, &flags].concat());
        fs::read(at.join(out)).unwrap()
    };
    let want = render("in.nrrd", "a.png");
    assert!(render("plain", "b.png") == want, "another picture of the same voxels in OME-Zarr");
    let raw = read(&at.join("in.nrrd")).1;
    fs::write(at.join("scan_45x20x37_uint16.raw"), raw).unwrap();
    let raw = info(&["scan_45x20x37_uint16.raw"]);
    assert_eq!(of(&raw), ["file name", "file name", "default", "default", "default", "default", "default"]);
    let text = brickcast_ok(at, &["info", "scan_45x20x37_uint16.raw"]);
    assert!(text.contains("  from       file name: dims, type; default: spacing"), "{text}");
    let output = brickcast(at, &["info", "in.nrrd", "--axes", "x,y,y"]);
    assert_eq!(output.status.code(), Some(2));
}
