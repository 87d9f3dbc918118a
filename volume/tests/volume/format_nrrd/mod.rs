//! NRRD: what is read, and what each broken file is answered with.

mod space;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use brickcast_volume::format::{self, Endian, RawHints, SourceHeader, VoxelType};
use flate2::Compression;
use flate2::write::GzEncoder;

const DIMS: [u32; 3] = [3, 2, 4];

/// 24 values of two bytes that differ in both bytes.
fn values() -> Vec<u16> {
    (0..24u16).map(|i| i * 1_031 + 7).collect()
}

fn bytes(endian: Endian) -> Vec<u8> {
    let to_bytes = |v: u16| if endian == Endian::Big { v.to_be_bytes() } else { v.to_le_bytes() };
    values().into_iter().flat_map(to_bytes).collect()
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// A header with one line changed, added or (empty replacement) removed.
fn header(changes: &[(&str, &str)]) -> String {
    let mut lines = vec![
        ("type", "type: uint16".to_owned()),
        ("dimension", "dimension: 3".into()),
        ("sizes", "sizes: 3 2 4".into()),
        ("spacings", "spacings: 1 2 3".into()),
        ("endian", "endian: little".into()),
        ("encoding", "encoding: raw".into()),
    ];
    for (field, line) in changes {
        lines.retain(|(name, _)| name != field);
        if !line.is_empty() {
            lines.push((field, (*line).to_owned()));
        }
    }
    let lines: Vec<String> = lines.into_iter().map(|(_, line)| line + "\n").collect();
    format!("NRRD0004\n{}\n", lines.concat())
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, parts: &[&[u8]]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, parts.concat()).unwrap();
        path
    }
}

fn read(path: &Path, slab: u32) -> Result<(SourceHeader, Vec<u8>), format::FormatError> {
    let mut source = format::open(path, &RawHints::default())?;
    let depth = source.header().geometry.dims().z;
    let (mut all, mut planes) = (Vec::new(), Vec::new());
    for pass in 0..2 {
        all.clear();
        if pass == 1 {
            source.rewind()?;
        }
        for _ in 0..depth.div_ceil(slab) {
            source.read_planes(slab, &mut planes)?;
            all.extend_from_slice(&planes);
        }
        source.read_planes(slab, &mut planes)?;
        assert!(planes.is_empty(), "planes beyond the end");
    }
    Ok((source.header().clone(), all))
}

/// What opening and reading `parts` as `x.nrrd` is answered with; it must hold every word.
fn refused(parts: &[&[u8]], words: &[&str]) {
    let folder = Folder::new();
    let path = folder.write("x.nrrd", parts);
    let error = read(&path, 2).expect_err("must be refused").to_string();
    for word in words {
        assert!(error.contains(word), "`{word}` is not in: {error}");
    }
    assert!(error.contains("x."), "no file named in: {error}");
}

fn refused_header(changes: &[(&str, &str)], words: &[&str]) {
    refused(&[header(changes).as_bytes(), &bytes(Endian::Little)], words);
}

#[test]
fn attached_raw_and_gzip_of_both_endians_are_read_in_any_slab() {
    for (encoding, endian, slab) in [
        ("raw", Endian::Little, 1),
        ("raw", Endian::Big, 3),
        ("gzip", Endian::Little, 4),
        ("gz", Endian::Big, 3),
        ("GZIP", Endian::Big, 99),
    ] {
        let folder = Folder::new();
        let (e, n) = (format!("encoding: {encoding}"), format!("endian: {endian}"));
        let head = header(&[("encoding", &e), ("endian", &n)]);
        let data = if encoding == "raw" { bytes(endian) } else { gzip(&bytes(endian)) };
        let (header, got) = read(&folder.write("x.nrrd", &[head.as_bytes(), &data]), slab).unwrap();
        assert_eq!(got, bytes(Endian::Little), "{encoding} {endian} {slab}");
        assert_eq!(header.voxel_type, VoxelType::U16);
        assert_eq!(header.geometry.dims().to_array(), DIMS);
        assert_eq!(header.geometry.spacing().to_array(), [1.0, 2.0, 3.0]);
        assert_eq!(header.geometry.origin().to_array(), [0.0; 3]);
        assert_eq!(header.notes, [""; 0]);
    }
}

#[test]
fn a_detached_file_is_found_beside_its_header() {
    for (encoding, data) in [("raw", bytes(Endian::Little)), ("gzip", gzip(&bytes(Endian::Little)))] {
        let folder = Folder::new();
        folder.write("voxels of x", &[&data]);
        let e = format!("encoding: {encoding}");
        let head = header(&[("encoding", &e), ("data file", "Data File: voxels of x")]);
        // Without a blank line: the end of the file ends a detached header.
        let path = folder.write("x.nhdr", &[head.trim_end().as_bytes()]);
        assert_eq!(read(&path, 2).unwrap().1, bytes(Endian::Little));
        std::fs::remove_file(folder.0.path().join("voxels of x")).unwrap();
        let error = read(&path, 2).unwrap_err().to_string();
        assert!(error.contains("x.nhdr") && error.contains("voxels of x"), "{error}");
    }
}

#[test]
fn several_gzip_members_are_one_stream() {
    let data = bytes(Endian::Little);
    let folder = Folder::new();
    let head = header(&[("encoding", "encoding: gzip")]);
    let path = folder.write("x.nrrd", &[head.as_bytes(), &gzip(&data[..11]), &gzip(&data[11..])]);
    assert_eq!(read(&path, 1).unwrap().1, data);
}

#[test]
fn crlf_comments_and_keys_are_no_fields() {
    let head = header(&[("k", "# type: double\nmy key:=sizes: 9 9 9\na:b:=c")]).replace('\n', "\r\n");
    let folder = Folder::new();
    let path = folder.write("x.nrrd", &[head.as_bytes(), &bytes(Endian::Little)]);
    let (header, data) = read(&path, 4).unwrap();
    assert_eq!((data, header.notes.len()), (bytes(Endian::Little), 0));
}

#[test]
fn every_spelling_of_a_type_is_known() {
    for (spellings, bytes, voxel_type) in [
        ("signed char,int8,int8_t", 1, VoxelType::I8),
        ("uchar,unsigned char,uint8,uint8_t", 1, VoxelType::U8),
        ("short,short int,signed short,signed short int,int16,int16_t", 2, VoxelType::I16),
        ("ushort,unsigned short,unsigned short int,uint16,uint16_t", 2, VoxelType::U16),
        ("int,signed int,int32,int32_t", 4, VoxelType::I32),
        ("uint,unsigned int,uint32,uint32_t,Unsigned  INT", 4, VoxelType::U32),
        ("float,float32", 4, VoxelType::F32),
        ("double,float64", 8, VoxelType::F64),
        ("longlong,long long,long long int,signed long long,signed long long int,int64,int64_t", 8, VoxelType::I64),
        ("ulonglong,unsigned long long,unsigned long long int,uint64,uint64_t", 8, VoxelType::U64),
    ] {
        for spelling in spellings.split(',') {
            let folder = Folder::new();
            let line = format!("type: {spelling}");
            let head = header(&[("type", &line)]);
            let path = folder.write("x.nrrd", &[head.as_bytes(), &vec![1; 24 * bytes]]);
            assert_eq!(read(&path, 1).unwrap().0.voxel_type, voxel_type, "{spelling}");
        }
    }
}

#[test]
fn unknown_types_and_encodings_name_what_is_supported() {
    for name in ["long double", "float16", "block", "char", "uint7", "int128"] {
        let line = format!("type: {name}");
        refused_header(&[("type", &line)], &[name, "not supported", "uint16", "float32", "line "]);
    }
    for name in ["zrl", "zstd", "what"] {
        let line = format!("encoding: {name}");
        refused_header(&[("encoding", &line)], &[name, "not supported", "raw, gzip, bzip2, ascii and hex"]);
    }
    refused_header(&[("dimension", "dimension: 4"), ("sizes", "sizes: 2 3 2 2")], &["dimension 4", "not supported"]);
    refused_header(&[("dimension", "dimension: 99"), ("sizes", "sizes: 1 3 2 4")], &["sizes", "99 whole numbers"]);
    refused_header(&[("dimension", "dimension: 2"), ("sizes", "sizes: 3 2")], &["dimension 2", "3 axes"]);
    refused_header(&[("kinds", "kinds: RGB-color domain domain")], &["RGB-color", "one value"]);
}

#[test]
fn missing_and_malformed_fields_are_named_with_their_line() {
    for field in ["type", "dimension", "sizes", "endian", "encoding"] {
        let example = format!("`{field}: ");
        refused_header(&[(field, "")], &["no field", field, &example]);
    }
    refused_header(&[("again", "sizes: 3 2 4")], &["repeats", "sizes", "line 8"]);
    refused_header(&[("x", "no field at all")], &["line 8", "no field at all"]);
    refused_header(&[("endian", "endian: middle")], &["middle", "little or big"]);
    refused_header(&[("byte skip", "byte skip: -2")], &["byte skip", "-2"]);
    refused_header(&[("byte skip", "byte skip: 1e3")], &["byte skip", "whole number"]);
    refused_header(&[("line skip", "line skip: -1")], &["line skip", "-1"]);
    refused_header(&[("byte skip", "byte skip: -1"), ("encoding", "encoding: gzip")], &["-1 needs encoding raw"]);
    for bad in ["3 2", "3 2 4 5", "3 2 x", "3 2 -4", "3 2 99999999999"] {
        let line = format!("sizes: {bad}");
        refused_header(&[("sizes", &line)], &["sizes", bad, "three whole numbers"]);
    }
    refused_header(&[("sizes", "sizes: 3 0 4")], &["[3, 0, 4]", "between 1"]);
    refused_header(&[("sizes", "sizes: 1048576 1048576 1048576")], &["1048576", "more than"]);
    for bad in ["0 1 1", "-1 1 1", "inf 1 1", "1e-300 1 1", "1 1 1e300"] {
        let line = format!("spacings: {bad}");
        refused_header(&[("spacings", &line)], &["spacing ["]);
    }
    refused_header(&[("spacings", "spacings: 1 1")], &["three numbers"]);
    refused_header(&[("o", "space origin: (1,2)")], &["vector of 2"]);
    refused_header(&[("o", "space origin: (1,2,3")], &["(1,0,0)"]);
    refused_header(&[("d", "space directions: none (1,0,0) (0,1,0)")], &["none"]);
    refused_header(&[("d", "space directions: (1,0,0) (0,1,0)")], &["three vectors"]);
    refused_header(&[("d", "space directions: (0,0,0) (0,1,0) (0,0,1)")], &["axis 0 has the vector"]);
}

#[test]
fn a_file_that_is_no_nrrd_or_has_no_end_is_told_so() {
    refused(&[b"P5 3 2 255 ......"], &["P5 3 2", "NRRD0001"]);
    refused(&[b"NRRD0006\n"], &["NRRD0006", "NRRD0005"]);
    refused(&[b"NRRD"], &["`NRRD`"]);
    refused(&[header(&[]).trim_end().as_bytes()], &["blank line"]);
    refused(&[b"NRRD0004\n", "# long\n".repeat(200_000).as_bytes()], &["1024 KiB"]);
    refused(&[b"NRRD0004\n# ", &vec![b'x'; 2 << 20]], &["1024 KiB"]);
}

#[test]
fn raw_data_of_another_length_is_refused_with_both_numbers() {
    let (head, data) = (header(&[]), bytes(Endian::Little));
    refused(&[head.as_bytes(), &data[..47]], &["too short", "47 bytes", "48", "1 are missing", "[3, 2, 4]", "uint16"]);
    refused(&[head.as_bytes()], &["too short", "0 bytes", "48"]);
    refused(&[head.as_bytes(), &data, b"x"], &["oversized", "49 bytes", "48", "1 are too many"]);
}

#[test]
fn a_huge_size_in_a_header_is_refused_before_memory_is_taken() {
    refused_header(&[("sizes", "sizes: 16384 1048576 1000")], &["too short", "34359738368000"]);
    let head = header(&[("sizes", "sizes: 16384 1048576 1000"), ("encoding", "encoding: gzip")]);
    refused(&[head.as_bytes(), &gzip(&[0; 48])], &["cannot hold", "34359738368000"]);
}

#[test]
fn truncated_oversized_and_broken_gzip_is_told_with_its_position() {
    let head = header(&[("encoding", "encoding: gzip")]);
    let packed = gzip(&bytes(Endian::Little));
    refused(&[head.as_bytes(), &packed[..packed.len() / 2]], &["ends after", "48 bytes", "truncated"]);
    refused(&[head.as_bytes(), &gzip(&bytes(Endian::Little)[..40])], &["ends after 40 bytes", "48 bytes"]);
    refused(&[head.as_bytes(), &gzip(&[bytes(Endian::Little), vec![1]].concat())], &["goes on after", "48"]);
    refused(&[head.as_bytes(), &bytes(Endian::Little)], &["broken gzip", "after 0 bytes"]);
    let mut flipped = packed.clone();
    let checksum = flipped.len() - 6;
    flipped[checksum] ^= 1;
    refused(&[head.as_bytes(), &flipped], &["broken gzip", "after 48 bytes"]);
}

#[test]
fn lines_and_bytes_are_skipped() {
    let (data, folder) = (bytes(Endian::Little), Folder::new());
    type Changes<'a> = &'a [(&'a str, &'a str)];
    let cases: [(Changes<'_>, Vec<u8>); 5] = [
        (&[("l", "line skip: 2")], [b"a\nbb\n".as_slice(), &data].concat()),
        (&[("b", "byte skip: 3")], [b"abc".as_slice(), &data].concat()),
        (&[("l", "lineskip: 1"), ("b", "byteskip: 2")], [b"a\nbb".as_slice(), &data].concat()),
        (&[("b", "byte skip: -1")], [b"anything".as_slice(), &data].concat()),
        (
            &[("l", "line skip: 1"), ("b", "byte skip: 2"), ("encoding", "encoding: gzip")],
            [b"a\n".as_slice(), &gzip(&[b"zz".as_slice(), &data].concat())].concat(),
        ),
    ];
    for (changes, content) in cases {
        let path = folder.write("x.nrrd", &[header(changes).as_bytes(), &content]);
        assert_eq!(read(&path, 3).unwrap().1, data, "{changes:?}");
    }
    refused_header(&[("l", "line skip: 1000")], &["line skip", "1000"]);
    refused_header(&[("b", "byte skip: 9223372036854775807")], &["byte skip", "9223372036854775807"]);
    refused(&[header(&[("b", "byte skip: -1")]).as_bytes(), &data[..40]], &["too short", "40 bytes"]);
    let head = header(&[("b", "byte skip: 100"), ("encoding", "encoding: gzip")]);
    refused(&[head.as_bytes(), &gzip(&data)], &["ends after 0 bytes"]);
}

#[test]
fn a_file_that_changes_between_two_passes_is_noticed() {
    let folder = Folder::new();
    let path = folder.write("x.nrrd", &[header(&[]).as_bytes(), &bytes(Endian::Little)]);
    let mut source = format::open(&path, &RawHints::default()).unwrap();
    folder.write("x.nrrd", &[header(&[]).as_bytes()]);
    assert!(source.rewind().unwrap_err().to_string().contains("while it was read"));
}

#[test]
fn a_written_header_is_read_back() {
    let geometry = brickcast_volume::Geometry::new(DIMS, [0.1, 0.25, 1e-3], [-7.5, 0.0, 1e10]).unwrap();
    let mut head = Vec::new();
    format::nrrd::write_header(&mut head, &geometry, VoxelType::U16, Some("mm"), &["two\nlines".into()]).unwrap();
    let folder = Folder::new();
    let (header, data) = read(&folder.write("x.nrrd", &[&head, &bytes(Endian::Little)]), 4).unwrap();
    assert_eq!((header.geometry, header.voxel_type, data), (geometry, VoxelType::U16, bytes(Endian::Little)));
    assert_eq!((header.space_unit.as_deref(), header.notes.len()), (Some("mm"), 0));

    let turned = geometry.with_directions(glam::DMat3::from_rotation_z(0.3)).unwrap();
    let mut head = Vec::new();
    format::nrrd::write_header(&mut head, &turned, VoxelType::U16, None, &[]).unwrap();
    let (header, _) = read(&folder.write("y.nrrd", &[&head, &bytes(Endian::Little)]), 4).unwrap();
    assert!(header.geometry.directions().abs_diff_eq(turned.directions(), 1e-15));
    assert_eq!(header.geometry.origin(), turned.origin());
}
