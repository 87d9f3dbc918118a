//! NRRD headers over several files, the encodings beside raw and gzip, 64-bit voxels, and axes of length 1.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use brickcast_volume::format::{self, FormatError, RawHints, VoxelType};
use flate2::Compression;

/// 6 x 5 x 4 voxels of two bytes; plane z holds 1000 z and more.
fn values() -> Vec<u16> {
    (0..4u16).flat_map(|z| (0..30).map(move |i| 1000 * z + 7 * i)).collect()
}

fn le(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

fn bzip2(data: &[u8]) -> Vec<u8> {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// A folder with `x.nrrd` of these lines, and other files.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(lines: &str) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write("x.nrrd", format!("NRRD0004\n{lines}").as_bytes());
        folder
    }

    fn attached(lines: &str, data: &[u8]) -> Self {
        let folder = Self::new("");
        folder.write("x.nrrd", &[format!("NRRD0004\n{lines}\n\n").as_bytes(), data].concat());
        folder
    }

    fn write(&self, name: &str, data: &[u8]) {
        std::fs::write(self.path(name), data).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// All voxels, read in slabs of `slab` planes, twice.
    fn read(&self, slab: u32) -> Result<Vec<u8>, FormatError> {
        read(&self.path("x.nrrd"), slab)
    }

    fn refused(&self, words: &[&str]) {
        let error = self.read(2).expect_err("must be refused").to_string();
        for word in [&["x.nrrd"], words].concat() {
            assert!(error.contains(word), "`{word}` is not in: {error}");
        }
    }
}

fn read(path: &Path, slab: u32) -> Result<Vec<u8>, FormatError> {
    let mut source = format::open(path, &RawHints::default())?;
    let (mut all, mut planes) = (Vec::new(), Vec::new());
    for _ in 0..2 {
        all.clear();
        source.rewind()?;
        loop {
            source.read_planes(slab, &mut planes)?;
            if planes.is_empty() {
                break;
            }
            all.extend_from_slice(&planes);
        }
    }
    Ok(all)
}

const HEAD: &str = "type: uint16\ndimension: 3\nsizes: 6 5 4\nspacings: 1 1 1\nendian: little\n";

/// Writes the planes, `each` to a file, coded by `code`.
fn slices(folder: &Folder, names: &[&str], each: usize, code: impl Fn(&[u8]) -> Vec<u8>) {
    for (name, planes) in names.iter().zip(le(&values()).chunks(60 * each)) {
        folder.write(name, &code(planes));
    }
}

#[test]
fn a_list_of_slices_is_read_in_the_order_of_its_lines() {
    for (encoding, code) in [
        ("raw", (|data| data.to_vec()) as fn(&[u8]) -> Vec<u8>),
        ("gzip", gzip),
        ("bzip2", bzip2),
        ("hex", |data| data.iter().flat_map(|b| format!("{b:02x}\n").into_bytes()).collect()),
    ] {
        let names = ["b 1.raw", "a.raw", "é.raw", "c.raw"];
        for (list, lines) in [("LIST", names.join("\n")), ("LIST 2", names.join("\r\n") + "\r\n\r\n")] {
            let folder = Folder::new(&format!("{HEAD}encoding: {encoding}\nData File:  {list}\n{lines}"));
            slices(&folder, &names, 1, code);
            for slab in [1, 3, 9] {
                assert_eq!(folder.read(slab).unwrap(), le(&values()), "{encoding} {list} {slab}");
            }
            let source = format::open(&folder.path("x.nrrd"), &RawHints::default()).unwrap();
            let files: Vec<PathBuf> = ["x.nrrd"].iter().chain(&names).map(|name| folder.path(name)).collect();
            assert_eq!(source.files(), files);
        }
    }
}

#[test]
fn a_list_may_hold_slabs_of_whole_planes_and_lines_and_bytes_are_skipped_in_each() {
    let folder = Folder::new(&format!("{HEAD}encoding: raw\nline skip: 1\nbyte skip: 2\ndata file: LIST 3\na\nb\n"));
    slices(&folder, &["a", "b"], 2, |data| [b"slab\nxx".as_slice(), data].concat());
    assert_eq!(folder.read(3).unwrap(), le(&values()));
    let folder = Folder::new(&format!("{HEAD}encoding: raw\nbyte skip: -1\ndata file: LIST 3\na\n"));
    slices(&folder, &["a"], 4, |data| [b"a header of any length".as_slice(), data].concat());
    assert_eq!(folder.read(3).unwrap(), le(&values()));
}

#[test]
fn a_numbered_series_counts_up_or_down_in_any_format() {
    for (series, names) in [
        ("s%d.raw 0 3 1", ["s0.raw", "s1.raw", "s2.raw", "s3.raw"]),
        ("s%03d.raw 8 14 2 2", ["s008.raw", "s010.raw", "s012.raw", "s014.raw"]),
        ("s%d.raw 3 0 -1", ["s3.raw", "s2.raw", "s1.raw", "s0.raw"]),
        ("my %02d 5%%.raw 1 -2 -1", ["my 01 5%.raw", "my 00 5%.raw", "my -1 5%.raw", "my -2 5%.raw"]),
    ] {
        let folder = Folder::new(&format!("{HEAD}encoding: raw\ndata file: {series}\n"));
        slices(&folder, &names, 1, <[u8]>::to_vec);
        assert_eq!(folder.read(4).unwrap(), le(&values()), "{series}");
    }
    let folder = Folder::new(&format!("{HEAD}encoding: raw\ndata file: s%d.raw 1 2 1 3\n"));
    slices(&folder, &["s1.raw", "s2.raw"], 2, <[u8]>::to_vec);
    assert_eq!(folder.read(1).unwrap(), le(&values()));
}

#[test]
fn a_header_in_latin_1_finds_its_files_in_either_spelling() {
    let utf8 = Folder::new("");
    utf8.write(
        "x.nrrd",
        &[b"NRRD0004\n", HEAD.as_bytes(), b"encoding: raw\ncontent: \xb5\ndata file: k\xe4se.raw\n"].concat(),
    );
    utf8.write("käse.raw", &le(&values()));
    assert_eq!(utf8.read(4).unwrap(), le(&values()));
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        let latin = utf8.0.path().join(std::ffi::OsStr::from_bytes(b"k\xe4se.raw"));
        if std::fs::rename(utf8.path("käse.raw"), &latin).is_ok() {
            assert_eq!(utf8.read(4).unwrap(), le(&values()));
            let source = format::open(&utf8.path("x.nrrd"), &RawHints::default()).unwrap();
            assert_eq!(source.files()[1], latin);
        }
    }
}

#[test]
fn a_wrong_list_is_told_by_file_and_number() {
    let list = |lines: &str| Folder::new(&format!("{HEAD}encoding: raw\ndata file: LIST\n{lines}"));
    let folder = list("a\nb\nc\nd");
    slices(&folder, &["a", "b", "c"], 1, <[u8]>::to_vec);
    folder.refused(&["data file 4 of the 4", "/d", "cannot be opened"]);
    folder.write("d", &[0; 59]);
    folder.refused(&["data file 4 of the 4", "/d", "too short", "1 are missing"]);
    folder.write("d", &[0; 61]);
    folder.refused(&["data file 4 of the 4", "/d", "oversized"]);
    std::fs::remove_file(folder.path("d")).unwrap();
    std::fs::create_dir(folder.path("d")).unwrap();
    folder.refused(&["data file 4 of the 4", "/d"]);
    list("a\nb").refused(&["names 2 data files", "must be 4"]);
    list("").refused(&["no files are named"]);
    list("a\x1b[31m").refused(&["control characters"]);
    list(&"a\n".repeat(70_000)).refused(&["70000 files", "at most 65536"]);
    list(&"a long name\n".repeat(90_000)).refused(&["1024 KiB"]);
    let series = |series: &str| Folder::new(&format!("{HEAD}encoding: raw\ndata file: {series}\n"));
    series("s%d 0 3 0").refused(&["steps of 0"]);
    series("s%d 0 3 -1").refused(&["does not get there"]);
    series("s%s 0 3 1").refused(&["one number"]);
    series("s%d 0 9 1").refused(&["10 data files", "must be 4"]);
    series("s%d 1 3 1 3").refused(&["3 data files for 4 planes"]);
    series("s%d 0 3 1 4").refused(&["dimension 4"]);
    series("s%d -9223372036854775808 9223372036854775807 1").refused(&["at most 65536"]);
    series("s%d 0 119 1 0").refused(&["dimension 0"]);
    let rows = series("s%d 0 19 1 1");
    rows.refused(&["20 data files for 4 planes"]);
}

#[test]
fn what_follows_a_compressed_stream_is_not_the_readers_business() {
    let (data, head) = (le(&values()), |encoding: &str| format!("{HEAD}encoding: {encoding}"));
    for (encoding, code) in [("gzip", gzip as fn(&[u8]) -> Vec<u8>), ("bzip2", bzip2), ("bz2", bzip2)] {
        for after in
            [vec![], vec![0; 512], b"anything else".to_vec(), code(b"another member"), code(&data)[..20].to_vec()]
        {
            let folder = Folder::attached(&head(encoding), &[code(&data), after].concat());
            assert_eq!(folder.read(3).unwrap(), data, "{encoding}");
        }
        let two = Folder::attached(&head(encoding), &[code(&data[..77]), code(&data[77..]), vec![0; 9]].concat());
        assert_eq!(two.read(1).unwrap(), data, "{encoding}");

        Folder::attached(&head(encoding), &[code(&data[..77]), vec![0; 512]].concat()).refused(&[
            "ends after 77 bytes",
            "240 bytes",
            &encoding.replace("bz2", "bzip2"),
        ]);
        Folder::attached(&head(encoding), &code(&[data.clone(), vec![1]].concat())).refused(&["goes on after", "240"]);
        let mut flipped = code(&data);
        let checksum = flipped.len() - if encoding == "gzip" { 6 } else { 3 };
        flipped[checksum] ^= 1;
        Folder::attached(&head(encoding), &flipped).refused(&["broken", "bytes of voxels"]);
        let half = code(&data);
        Folder::attached(&head(encoding), &half[..half.len() / 2]).refused(&["ends after"]);
    }
}

/// The little-endian bytes that a text of numbers is read as.
fn text(voxel_type: &str, sizes: &str, numbers: &str) -> Result<Vec<u8>, FormatError> {
    let lines = format!("type: {voxel_type}\ndimension: 3\nsizes: {sizes}\nspacings: 1 1 1\nencoding: text");
    Folder::attached(&lines, numbers.as_bytes()).read(1)
}

#[test]
fn numbers_as_text_are_read_in_every_type() {
    assert_eq!(text("uint8", "3 1 2", "0 1, 255\n\n2\t3 , 4 \n").unwrap(), [0, 1, 255, 2, 3, 4]);
    assert_eq!(text("signed char", "2 1 1", "-128 127").unwrap(), [128, 127]);
    assert_eq!(text("short", "2 1 1", "-2 1e3").unwrap(), [254, 255, 232, 3]);
    assert_eq!(text("int64", "1 1 1", "-9223372036854775808").unwrap(), i64::MIN.to_le_bytes());
    assert_eq!(text("uint64", "1 1 1", "18446744073709551615").unwrap(), [255; 8]);
    let floats = text("float", "2 1 2", "1.5 -inf nan 1e-3").unwrap();
    let floats: Vec<f32> = floats.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert!(floats[..2] == [1.5, f32::NEG_INFINITY] && floats[2].is_nan() && floats[3] == 1e-3, "{floats:?}");
    assert_eq!(text("double", "1 1 1", "1.7976931348623157e308").unwrap(), f64::MAX.to_le_bytes());
    // A number across the reader's buffer.
    let many: String = (0..60_000).map(|i| format!("{i} ")).collect();
    let want: Vec<u8> = (0..60_000u16).flat_map(u16::to_le_bytes).collect();
    assert_eq!(text("uint16", "100 100 6", &many).unwrap(), want);

    for (voxel_type, numbers, words) in [
        ("uint8", "1 2 256 4", &["number 3", "`256`", "uint8"][..]),
        ("uint8", "1 -2 3 4", &["number 2", "`-2`"]),
        ("int16", "1 2 3.5 4", &["number 3", "`3.5`", "whole"]),
        ("float", "1 2 x\x1b 4", &["number 3", "is no number"]),
        ("uint8", "1 2 3", &["cannot hold"]),
        ("uint8", "1 2  30  ", &["ends after 3 bytes", "4 bytes"]),
        ("uint8", "1 2 3 4 5", &["goes on after", "4 bytes"]),
    ] {
        let error = text(voxel_type, "2 1 2", numbers).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)) && !error.contains('\x1b'), "{numbers}: {error}");
    }
    let error = text("float", "1 1 1", &"1".repeat(1 << 20)).unwrap_err().to_string();
    assert!(error.contains("too long for a number") && error.len() < 500, "{error}");
}

#[test]
fn hexadecimal_digits_are_read_in_the_files_byte_order() {
    let head = |endian: &str| format!("type: uint16\ndimension: 3\nsizes: 2 1 2\nendian: {endian}\nencoding: hex");
    let digits = b"00 01aB\ncd 0 2 03\nFF\tff\n\n";
    assert_eq!(Folder::attached(&head("little"), digits).read(1).unwrap(), [0, 1, 0xab, 0xcd, 2, 3, 255, 255]);
    assert_eq!(Folder::attached(&head("big"), digits).read(1).unwrap(), [1, 0, 0xcd, 0xab, 3, 2, 255, 255]);
    Folder::attached(&head("big"), b"0001020304050x0708").refused(&["`x`", "behind 13 digits"]);
    Folder::attached(&head("big"), b"00010203040506 7 ").refused(&["ends after 7 bytes"]);
    Folder::attached(&head("big"), b"000102030405060").refused(&["cannot hold"]);
    Folder::attached(&head("big"), b"0001020304050607 8").refused(&["goes on after"]);
}

#[test]
fn voxels_of_64_bits_are_read_in_both_byte_orders() {
    let values = [f64::MIN, -0.5, 5e-324, 29.75];
    for (endian, bytes) in
        [("little", values.map(f64::to_le_bytes).concat()), ("big", values.map(f64::to_be_bytes).concat())]
    {
        let head = format!("type: double\ndimension: 3\nsizes: 2 1 2\nendian: {endian}\nencoding: raw");
        assert_eq!(Folder::attached(&head, &bytes).read(1).unwrap(), values.map(f64::to_le_bytes).concat());
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, voxel_type) in [
        ("a_2x1x2_float64.raw", VoxelType::F64),
        ("a_2x1x2_double.raw", VoxelType::F64),
        ("a_2x1x2_int64.raw", VoxelType::I64),
        ("a_2x1x2_uint64_le.raw", VoxelType::U64),
    ] {
        std::fs::write(folder.path().join(name), [7; 32]).unwrap();
        let source = format::open(&folder.path().join(name), &RawHints::default()).unwrap();
        assert_eq!(source.header().voxel_type, voxel_type, "{name}");
        assert_eq!(source.files(), [folder.path().join(name)]);
    }
}

/// Dims, spacing, origin and notes of a header of 120 bytes.
fn opened(lines: &str) -> ([u32; 3], [f64; 3], [f64; 3], Vec<String>) {
    let folder = Folder::attached(&format!("type: uint8\nencoding: raw\n{lines}"), &[0; 120]);
    let source = format::open(&folder.path("x.nrrd"), &RawHints::default()).unwrap();
    let header = source.header();
    let g = header.geometry;
    (g.dims().to_array(), g.spacing().to_array(), g.origin().to_array(), header.notes.clone())
}

#[test]
fn an_axis_of_length_1_that_is_no_direction_of_space_is_left_out_with_its_entries() {
    let sizes = ["6", "5", "4"];
    let directions = ["(1,0,0)", "(0, 2,0)", "(0,0,3)"];
    let kinds = ["domain", "domain", "domain"];
    for at in 0..4 {
        for none in ["none", "(nan,nan,nan)", "(0,0,0)"] {
            let with = |list: [&str; 3], one: &str| {
                let mut list = list.to_vec();
                list.insert(at, one);
                list.join(" ")
            };
            let lines = format!(
                "dimension: 4\nspace: left-posterior-superior\nsizes: {}\nkinds: {}\nspace directions: {}\n\
                 space origin: (7,8,9)\nlabels: {}\ncenters: {}\nunits: {}",
                with(sizes, "1"),
                with(kinds, "list"),
                with(directions, none),
                with(["\"x x\"", "\"y\"", "\"z\""], "\"frame\""),
                with(["cell", "cell", "cell"], "???"),
                with(["\"mm\"", "\"mm\"", "\"mm\""], "\"\""),
            );
            let (dims, spacing, origin, notes) = opened(&lines);
            assert_eq!((dims, spacing, origin), ([6, 5, 4], [1.0, 2.0, 3.0], [7.0, 8.0, 9.0]), "{lines}");
            assert_eq!(notes, [format!("axis {} of 4 (list) has length 1 and was left out", at + 1)], "{lines}");
        }
    }
    // Two such axes, one of them between the others.
    let lines = "dimension: 5\nsizes: 1 6 5 1 4\nkinds: vector domain domain time domain\nspace directions: none \
                 (1,0,0)(0,2,0) none (0,0,3)";
    assert_eq!(opened(lines).0, [6, 5, 4]);
    // A slice has length 1 along a direction of space, which stays.
    let lines = "dimension: 4\nsizes: 1 6 20 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)";
    assert_eq!((opened(lines).0, opened(lines).1), ([6, 20, 1], [1.0, 2.0, 3.0]));
}

#[test]
fn without_directions_kinds_and_spacings_say_which_axis_is_none_of_space() {
    let (dims, spacing, origin, _) = opened(
        "dimension: 4\nsizes: 1 6 20 1\nkinds: domain domain domain list\nspacings: 2 3 4 nan\naxis mins: 5 6 7 nan",
    );
    assert_eq!((dims, spacing, origin), ([1, 6, 20], [2.0, 3.0, 4.0], [5.0, 6.0, 7.0]));
    assert_eq!(opened("dimension: 4\nsizes: 1 6 20 1\nspacings: nan 2 3 4").0, [6, 20, 1]);
    assert_eq!(opened("dimension: 4\nsizes: 6 5 1 4").0, [6, 5, 4]);
    assert_eq!(opened("dimension: 4\nsizes: 6 20 1 1").0, [6, 20, 1]);
    assert_eq!(opened("dimension: 6\nsizes: 1 1 120 1 1 1").0, [120, 1, 1]);
    // A slice is a volume: of three axes none is left out.
    assert_eq!(opened("dimension: 3\nsizes: 6 20 1").0, [6, 20, 1]);
    assert_eq!(opened("dimension: 3\nsizes: 1 1 120").0, [1, 1, 120]);
}

#[test]
fn longer_axes_stay_refused_and_entries_must_fit() {
    let refused = |lines: &str, words: &[&str]| {
        Folder::attached(&format!("type: uint8\nencoding: raw\n{lines}"), &[0; 120]).refused(words);
    };
    refused("dimension: 4\nsizes: 2 3 5 4", &["dimension 4", "3 axes"]);
    refused("dimension: 5\nsizes: 2 3 5 4 1", &["dimension 5"]);
    let none = "space directions: none (1,0,0) (0,1,0) (0,0,1)";
    refused(&format!("dimension: 4\nsizes: 2 3 5 4\n{none}"), &["dimension 4"]);
    refused("dimension: 4\nsizes: 1 6 5 4\nspace directions: (1,0,0) (0,1,0) (0,0,1)", &["4 vectors"]);
    refused("dimension: 4\nsizes: 1 6 5 4\nspace directions: none none (1,0,0) (0,1,0)", &["dimension 4"]);
    // Of length 1, and yet a direction: nothing says that it is none of space.
    let four = "space directions: (1,0,0) (1,0,0) (0,1,0) (0,0,1)";
    refused(&format!("dimension: 4\nsizes: 1 6 5 4\n{four}"), &["dimension 4"]);
    refused("dimension: 4\nsizes: 1 6 5 4\nspacings: 1 1 1", &["spacings", "4 entries"]);
    refused("dimension: 4\nsizes: 1 6 5", &["sizes", "4 whole numbers"]);
    refused("dimension: 17\nsizes: 1 6 5 4 1 1 1 1 1 1 1 1 1 1 1 1 1", &["dimension 17"]);
    refused("dimension: 18446744073709551615\nsizes: 1 6 5 4", &["18446744073709551615 whole numbers"]);
    refused("dimension: 4\nsizes: 1 6 5 4\nkinds: list RGB-color domain domain", &["RGB-color"]);
    let folder = Folder::new(
        "type: uint16\ndimension: 4\nsizes: 6 5 4 1\nspacings: 1 1 1 nan\nendian: little\nencoding: raw\ndata file: \
         LIST\nall\n",
    );
    folder.write("all", &le(&values()));
    assert_eq!(folder.read(9).unwrap(), le(&values()));
}
