//! Stacks: what belongs together is read in order, what does not is named; files above 4 GiB with one directory.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;

use brickcast_formats::{is_pattern, is_stack, open};
use brickcast_volume::format::{FormatError, RawHints, VolumeSource, VoxelType};

fn png(path: &Path, size: [u32; 2], depth: png::BitDepth, color: png::ColorType, value: u8) {
    let bytes = if depth == png::BitDepth::Sixteen { 2 } else { 1 } * color.samples() * (size[0] * size[1]) as usize;
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(&vec![value; bytes]).unwrap();
}

fn slice(path: &Path, value: u8) {
    png(path, [3, 2], png::BitDepth::Eight, png::ColorType::Grayscale, value);
}

/// Slices of the value of their number.
fn stack(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    (0..).zip(names).for_each(|(i, name)| slice(&folder.path().join(name), i));
    folder
}

fn opened(path: &Path) -> Result<Box<dyn VolumeSource>, FormatError> {
    open(path, &RawHints::default())
}

fn refused(path: &Path, want: &[&str]) {
    let error = opened(path).map(|mut source| source.read_planes(u32::MAX >> 8, &mut Vec::new()));
    let error = error.and_then(|read| read).expect_err("must be refused").to_string();
    want.iter().for_each(|want| assert!(error.contains(want), "no {want} in: {error}"));
}

fn values(path: &Path) -> Vec<u8> {
    let mut source = opened(path).unwrap();
    let mut planes = Vec::new();
    source.read_planes(1000, &mut planes).unwrap();
    planes.chunks(6).map(|plane| plane[0]).collect()
}

#[test]
fn slices_are_sorted_by_their_numbers() {
    let folder = stack(&["s9.png", "s10.png", "s11.png", "s8.png"]);
    assert!(is_stack(folder.path()));
    assert_eq!(values(folder.path()), [3, 0, 1, 2]);
    let pattern = folder.path().join("s1*.png");
    assert!(is_pattern(&pattern) && !is_pattern(folder.path()) && !is_pattern(&folder.path().join("s9.png")));
    assert_eq!(values(&pattern), [1, 2]);
    let list = folder.path().join("slices.txt");
    std::fs::write(&list, "s11.png\n# a word\n\ns9.png\n").unwrap();
    assert_eq!(values(&list), [2, 0]);
    let source = opened(&list).unwrap();
    assert_eq!(source.files()[0], list, "the list counts, too");
    let source = opened(folder.path()).unwrap();
    assert_eq!(source.files().len(), 4);
    let notes = source.header().notes.join("\n");
    for want in ["4 files, from s8.png to s11.png", "1 other files", "spacing not said"] {
        assert!(notes.contains(want), "no {want} in {notes}");
    }
    // A name with a star that is there is a file.
    slice(&folder.path().join("s*.png"), 7);
    assert_eq!(values(&folder.path().join("s*.png")), [7]);
}

#[test]
fn what_is_missing_doubled_or_strange_is_named() {
    refused(stack(&["a1.png", "a2.png", "a5.png"]).path(), &["a3.png, a4.png are missing", "in a list"]);
    refused(stack(&["a1.png", "a01.png", "a2.png"]).path(), &["a01.png and a1.png have the same number"]);
    let folder = stack(&["a1.png", "a2.png", "a3.png"]);
    let second = folder.path().join("a2.png");
    png(&second, [3, 3], png::BitDepth::Eight, png::ColorType::Grayscale, 0);
    refused(folder.path(), &["a2.png", "PNG of 3 x 3 pixels of uint8", "a1.png is PNG of 3 x 2 pixels of uint8"]);
    png(&second, [3, 2], png::BitDepth::Sixteen, png::ColorType::Grayscale, 0);
    refused(folder.path(), &["a2.png", "uint16"]);
    std::fs::write(&second, b"no picture").unwrap();
    refused(folder.path(), &["a2.png", "neither TIFF nor PNG"]);
    std::fs::write(&second, b"").unwrap();
    refused(folder.path(), &["a2.png", "empty"]);
    std::fs::write(&second, zstd::bulk::compress(&std::fs::read(folder.path().join("a1.png")).unwrap(), 1).unwrap())
        .unwrap();
    refused(folder.path(), &["a2.png", "zstd is around it", "unpack the slices"]);
    slice(&second, 2);
    slice(&folder.path().join("b.jpg"), 2);
    refused(folder.path(), &["a1.png", "b.jpg", "of different kinds", "in quotes"]);
    refused(&folder.path().join("c*.png"), &["no file fits this pattern"]);
    let list = folder.path().join("list.txt");
    for (text, want) in
        [("a1.png\nx.png\n", "line 2, `x.png`"), ("a1.png\na1.png\n", "named twice"), ("#\n", "no file is named")]
    {
        std::fs::write(&list, text).unwrap();
        refused(&list, &["list.txt", want]);
    }
    let empty = tempfile::tempdir().unwrap();
    assert!(!is_stack(empty.path()));
    refused(empty.path(), &["is a directory", "TIFF", "NRRD", "OME-Zarr"]);
}

#[test]
fn colour_is_refused_unless_it_is_grey() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    png(&path, [3, 2], png::BitDepth::Eight, png::ColorType::Rgb, 9);
    assert_eq!(values(&path), [9]);
    let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[9, 9, 8]).unwrap();
    refused(&path, &["a.png", "red, green and blue differ", "convert the slices to grey"]);
    let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 1, 1);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(vec![1, 2, 3]);
    encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
    refused(&path, &["a.png", "palette"]);
}

#[test]
fn what_the_user_says_overrules_the_file() {
    let folder = stack(&["s1.png", "s2.png"]);
    let hints = RawHints { spacing: Some([1.0, 2.0, 3.0]), no_data: Some(4.0), time: Some(1), ..RawHints::default() };
    let source = open(folder.path(), &hints).unwrap();
    let header = source.header();
    assert_eq!(header.geometry.spacing().to_array(), [1.0, 2.0, 3.0]);
    assert!(header.placement.spacing && header.no_data == [4.0]);
    let notes = header.notes.join("\n");
    assert!(!notes.contains("not said") && notes.contains("--spacing says") && notes.contains("--time"), "{notes}");
    let bad = RawHints { spacing: Some([1.0, 0.0, 3.0]), ..RawHints::default() };
    let error = open(folder.path(), &bad).unwrap_err().to_string();
    assert!(error.contains("--spacing") && error.contains(folder.path().to_str().unwrap()), "{error}");
}

/// ImageJ writes one directory alone, and planes one behind the other, where offsets of 32 bits do not suffice.
#[test]
fn a_file_of_image_j_above_4_gib() {
    const EDGE: u32 = 4096;
    const PLANES: u64 = 150;
    let plane = u64::from(EDGE) * u64::from(EDGE) * 2;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.tif");
    let text = format!("ImageJ=1.54f\nimages={PLANES}\nslices={PLANES}\nunit=mm\nspacing=0.5\n\0");
    let (directory, start) = (8_u32 + text.len() as u32, 4096_u32);
    let tags: [(u16, u32); 8] =
        [(256, EDGE), (257, EDGE), (258, 16), (259, 1), (270, 8), (273, start), (278, EDGE), (279, 1000)];
    let mut head = [&b"MM\0\x2a"[..], &directory.to_be_bytes(), text.as_bytes()].concat();
    head.extend((tags.len() as u16).to_be_bytes());
    for (tag, value) in tags {
        let (kind, count) = if tag == 270 { (2_u16, text.len() as u32) } else { (4, 1) };
        head.extend([&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value.to_be_bytes()].concat());
    }
    head.extend([0; 4]);
    let mut file = std::fs::File::create(&path).unwrap();
    file.write_all(&head).unwrap();
    // Mostly a hole.
    file.set_len(u64::from(start) + PLANES * plane).unwrap();
    file.seek(SeekFrom::Start(u64::from(start) + PLANES * plane - 2)).unwrap();
    file.write_all(&[0x12, 0x34]).unwrap();
    let mut source = opened(&path).unwrap();
    let header = source.header();
    assert_eq!((header.geometry.dims().to_array(), header.voxel_type), ([EDGE, EDGE, PLANES as u32], VoxelType::U16));
    assert_eq!((header.geometry.spacing().z, header.space_unit.as_deref()), (0.5, Some("mm")));
    let last = PLANES * plane / 2 - 1;
    assert!(source.seek(last).unwrap());
    let mut piece = Vec::new();
    source.read_piece(100, &mut piece).unwrap();
    assert_eq!(piece, [0x34, 0x12]);
    // A plane less.
    file.set_len(u64::from(start) + (PLANES - 1) * plane).unwrap();
    refused(&path, &["large.tif", "images", "150 planes"]);
}

#[test]
fn holes_are_filled_where_that_is_asked_for_and_named() {
    let folder = stack(&["a1.png", "a2.png", "a02.png", "a3.png", "a6.png", "a7.png"]);
    let at = |name: &str| folder.path().join(name);
    png(&at("a3.png"), [3, 3], png::BitDepth::Eight, png::ColorType::Grayscale, 9);
    // Its header is whole.
    let whole = std::fs::read(at("a6.png")).unwrap();
    std::fs::write(at("a6.png"), &whole[..whole.len() - 20]).unwrap();
    let hints = RawHints { skip_broken: true, no_data: Some(200.0), ..RawHints::default() };
    let mut source = open(folder.path(), &hints).unwrap();
    let mut planes = Vec::new();
    source.read_planes(1000, &mut planes).unwrap();
    // a1, a02 (a2 has its number), a3 of another size, a4 and a5 missing, a6 cut, a7.
    let got: Vec<u8> = planes.chunks(6).map(|plane| plane[0]).collect();
    assert_eq!(got, [0, 2, 200, 200, 200, 200, 5]);
    let notes = source.header().notes.join("\n");
    for want in [
        "left out: a2.png, which has the number of a02.png",
        "--skip-broken: 4 of 7 slices were filled with 200",
        "filled: a3.png, which is PNG of 3 x 3 pixels",
        "filled: a4.png, which is missing",
        "filled: a5.png, which is missing",
        "filled: a6.png, slice 0, ",
    ] {
        assert!(notes.contains(want), "no `{want}` in {notes}");
    }
    let plain = RawHints { skip_broken: true, ..RawHints::default() };
    let notes = open(folder.path(), &plain).unwrap().header().notes.join("\n");
    assert!(notes.contains("filled with 0, which counts as data"), "{notes}");
    // Nothing to fill it by.
    for name in ["a1.png", "a2.png", "a02.png", "a3.png", "a6.png", "a7.png"] {
        std::fs::write(at(name), b"no picture").unwrap();
    }
    let error = open(folder.path(), &plain).unwrap_err().to_string();
    assert!(error.contains("a1.png") && error.contains("neither TIFF nor PNG"), "{error}");
    refused(stack(&["b1.png", "b3.png", "b4.png"]).path(), &["b2.png is missing"]);
}
