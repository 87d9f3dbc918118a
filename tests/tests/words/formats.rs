//! Inputs of other formats through the command line: the store of the same voxels in NRRD, wherever a volume is taken.

use std::fs;
use std::path::Path;

use brickcast_tests::process::{brickcast, brickcast_both, brickcast_ok, cached_stores};
use brickcast_volume::StoreHash;
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::store::Store;
use serde_json::Value;

use crate::ome_zarr::manifest;

const EDGE: u32 = 24;

fn hash(at: &Path, name: &str) -> StoreHash {
    Store::open(&at.join(name)).unwrap().hash()
}

/// All that a store's manifest says but what its input was and was called.
fn nameless(store: &Path) -> Value {
    let mut whole = manifest(store);
    let without = |manifest: &mut Value| {
        let files = manifest["files"].as_object_mut().unwrap();
        assert!(files.remove("zarr.json").is_some() && files.len() > 3, "what holds the voxels");
    };
    without(&mut whole);
    whole["levels"].as_array_mut().into_iter().flatten().for_each(without);
    whole
}

/// A phantom as `p.nrrd` of spacing 1, 1, 2, and its voxels.
fn phantom(at: &Path) -> Vec<u8> {
    let dims = format!("{EDGE},{EDGE},{EDGE}");
    brickcast_ok(at, &["phantom", "p0.nrrd", "--dims", &dims, "--pores", "3"]);
    let mut source = format::open(&at.join("p0.nrrd"), &RawHints::default()).unwrap();
    assert_eq!(source.header().voxel_type.bytes(), 2);
    let mut voxels = Vec::new();
    source.read_planes(EDGE, &mut voxels).unwrap();
    let head =
        "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 24 24 24\nspacings: 1 1 2\nendian: little\nencoding: raw\n\n";
    fs::write(at.join("p.nrrd"), [head.as_bytes(), &voxels].concat()).unwrap();
    voxels
}

fn slice(path: &Path, plane: &[u8]) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), EDGE, EDGE);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let big: Vec<u8> = plane.as_chunks::<2>().0.iter().flat_map(|v| [v[1], v[0]]).collect();
    encoder.write_header().unwrap().write_image_data(&big).unwrap();
}

fn stack(at: &Path, voxels: &[u8]) {
    fs::create_dir(at.join("stack")).unwrap();
    for (z, plane) in voxels.chunks((EDGE * EDGE * 2) as usize).enumerate() {
        slice(&at.join(format!("stack/s{z}.png")), plane);
    }
}

fn numpy(path: &Path, voxels: &[u8]) {
    let header = format!("{:<117}\n", "{'descr': '<u2', 'fortran_order': False, 'shape': (24, 24, 24), }");
    fs::write(path, [&b"\x93NUMPY\x01\0\x76\0"[..], header.as_bytes(), voxels].concat()).unwrap();
}

#[test]
fn a_volume_gives_one_store_whatever_its_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let voxels = phantom(at);
    stack(at, &voxels);
    numpy(&at.join("p.npy"), &voxels);
    let head = "ObjectType = Image\nNDims = 3\nElementSpacing = 1 1 2\nDimSize = 24 24 24\nElementType = MET_USHORT\n\
                ElementDataFile = LOCAL\n";
    fs::write(at.join("p.mha"), [head.as_bytes(), &voxels].concat()).unwrap();
    brickcast_ok(at, &["prepare", "p.nrrd", "want", "--brick", "16"]);
    let want = nameless(&at.join("want"));
    let spacing = ["--spacing", "1,1,2"];
    for (i, (input, more)) in [("stack", &spacing[..]), ("stack/s*.png", &spacing), ("p.npy", &spacing), ("p.mha", &[])]
        .into_iter()
        .enumerate()
    {
        let store = format!("store{i}");
        brickcast_ok(at, &[&["prepare", input, &store, "--brick", "16"], more].concat());
        assert!(nameless(&at.join(&store)) == want, "another store: {input}");
    }
    let (told, _) = brickcast_both(at, &["info", "stack"]);
    for want in ["stack: PNG", "24 x 24 x 24", "24 files, from s0.png to s23.png"] {
        assert!(told.contains(want), "no {want} in {told}");
    }
}

#[test]
fn labels_are_taken_in_any_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let voxels = phantom(at);
    let labels: Vec<u8> = (0..EDGE.pow(3)).flat_map(|i| ((i / 300 % 5) as u16).to_le_bytes()).collect();
    stack(at, &labels);
    numpy(&at.join("labels.npy"), &labels);
    let head = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 24 24 24\nendian: little\nencoding: raw\n\n";
    fs::write(at.join("labels.nrrd"), [head.as_bytes(), &labels].concat()).unwrap();
    numpy(&at.join("p.npy"), &voxels);
    let prepare = |store: &str, labels: &str| {
        brickcast_ok(at, &["prepare", "p.npy", store, "--labels", labels]);
        hash(at, store)
    };
    let want = prepare("want", "labels.nrrd");
    assert_eq!(prepare("a", "labels.npy"), want);
    assert_eq!(prepare("b", "stack"), want);
    brickcast_ok(at, &["prepare", "p.npy", "none"]);
    assert_ne!(hash(at, "none"), want);
}

#[test]
fn a_stack_in_the_cache_is_that_of_its_slices() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let voxels = phantom(at);
    stack(at, &voxels);
    let render = |input: &str, more: &[&str]| {
        let flags = ["render", input, "--backend", "cpu", "--size", "32x32", "--no-manifest", "-o", "a.png"];
        brickcast_ok(at, &[&flags[..], more].concat());
        cached_stores(&at.join("cache")).len()
    };
    assert_eq!(render("stack", &[]), 1);
    assert_eq!(render("stack", &[]), 1, "found again");
    assert_eq!(render("stack/s*.png", &[]), 2, "another input");
    assert_eq!(render("stack/s*.png", &[]), 2, "found again");
    let labels = ["--labels", "stack"];
    assert_eq!(render("stack", &labels), 3);
    assert_eq!(render("stack", &labels), 3, "found again, whatever the process");
    std::thread::sleep(std::time::Duration::from_millis(50));
    slice(&at.join("stack/s5.png"), &voxels[..(EDGE * EDGE * 2) as usize]);
    assert_eq!(render("stack", &[]), 4, "one slice was changed");
    let slices = fs::read_dir(at.join("stack")).unwrap().count();
    assert_eq!(slices, EDGE as usize, "nothing is written beside the slices");
}

#[test]
fn each_array_of_a_file_is_a_volume_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let array = |name: &str, step: i32| {
        let text: Vec<String> = (0..512).map(|i| (i * step % 101).to_string()).collect();
        format!(r#"<DataArray type="Int16" Name="{name}" format="ascii">{}</DataArray>"#, text.join(" "))
    };
    let vti = |path: &str, arrays: &[String]| {
        let head =
            r#"<VTKFile type="ImageData"><ImageData WholeExtent="0 7 0 7 0 7"><Piece Extent="0 7 0 7 0 7"><PointData>"#;
        let tail = "</PointData></Piece></ImageData></VTKFile>";
        fs::write(at.join(path), [head, &arrays.concat(), tail].concat()).unwrap();
    };
    vti("two.vti", &[array("a", 7), array("b", 9)]);
    vti("b.vti", &[array("b", 9)]);
    for (input, store) in [("two.vti", "first"), ("two.vti:/a", "a"), ("two.vti:/b", "b"), ("b.vti", "alone")] {
        brickcast_ok(at, &["prepare", input, store]);
    }
    let voxels = |name: &str| nameless(&at.join(name))["files"].clone();
    assert_eq!((voxels("first"), voxels("b")), (voxels("a"), voxels("alone")));
    assert_ne!(voxels("a"), voxels("b"));
    let said = brickcast(at, &["info", "two.vti:/c"]).stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(said.contains("none called `c`") && said.contains("a, b"), "{said}");
    let render = |input: &str| {
        brickcast_ok(at, &["render", input, "--backend", "cpu", "--size", "8x8", "--no-manifest", "-o", "a.png"]);
        cached_stores(&at.join("cache")).len()
    };
    assert_eq!(render("two.vti:/a"), 1);
    assert_eq!(render("two.vti:/b"), 2, "of the same file, and another volume");
    assert_eq!(render("two.vti:/a"), 2, "found again");
}
