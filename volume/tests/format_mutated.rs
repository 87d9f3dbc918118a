//! Thousands of mutated NRRD files: never a panic, never more memory than the file deserves, always a volume or a clear
//! error.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::alloc::System;
use std::cell::Cell;
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use brickcast_volume::format::nrrd::NrrdHeader;
use brickcast_volume::format::{self, FormatError, RawHints};
use cap::Cap;
use proptest::prelude::*;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// Above what the harness itself holds: the read buffers, one slab's step (4 MiB) and the longest header (1 MiB),
/// doubled.
const MEMORY_BOUND: usize = 24 << 20;
const CASES: u32 = 12_000;

fn bzip2(data: &[u8]) -> Vec<u8> {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// Valid files between them of every field that matters.
fn seeds() -> Vec<Vec<u8>> {
    let voxels: Vec<u8> = (0..48).collect();
    [
        ("NRRD0004\n# plain\ntype: uint16\ndimension: 3\nsizes: 3 2 4\nspacings: 1 2 3\nendian: little\nencoding: \
          raw\n\n", voxels.clone()),
        (
            "NRRD0005\r\ntype: unsigned char\r\ndimension: 3\r\nspace: left-posterior-superior\r\nsizes: 4 4 3\r\n\
             space directions: (1,0,0) (0,0.5,0) (0,0,-2)\r\nkinds: domain domain domain\r\nencoding: gzip\r\n\
             space origin: (-1.5,2,3e2)\r\nspace units: \"mm\" \"mm\" \"mm\"\r\n\r\n",
            gzip(&voxels),
        ),
        ("NRRD0003\ntype: float\ndimension: 3\nsizes: 2 2 3\naxis mins: 0 1 2\ncenters: cell cell node\nendian: \
          big\nbyte skip: -1\nencoding: raw\nkey:=value\n\n", voxels.clone()),
        ("NRRD0001\ntype: short\ndimension: 3\nsizes: 2 3 4\nline skip: 1\nbyte skip: 2\nendian: big\nencoding: \
          gz\n\n", [b"line\n".as_slice(), &gzip(&[b"ab", voxels.as_slice()].concat())].concat()),
        ("NRRD0004\ntype: int32\ndimension: 3\nsizes: 12 1 1\nspacings: nan 1 1\nendian: little\nencoding: raw\ndata \
          file: voxels.bin\n", Vec::new()),
        ("NRRD0004\ntype: uint16\ndimension: 3\nsizes: 3 2 4\nendian: big\nencoding: bzip2\n\n", bzip2(&voxels)),
        ("NRRD0004\ntype: double\ndimension: 3\nsizes: 2 1 3\nencoding: ascii\n\n", b"1 -2.5e300\nnan 4,5\t6".to_vec()),
        ("NRRD0004\ntype: int64\ndimension: 4\nsizes: 1 2 1 3\nkinds: list domain domain domain\nendian: \
          big\nencoding: hex\nbyte skip: 1\n\n", [b"#".as_slice(), &b"00 \
            7f\n".repeat(24)].concat()),
        ("NRRD0004\ntype: uint8\ndimension: 4\nsizes: 4 4 3 1\nspace directions: (1,0,0) (0,1,0) (0,0,1) \
          none\nencoding: raw\ndata file: LIST 2\nvoxels.0\nvoxels.1\nvoxels.2\n", Vec::new()),
        ("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 2 6\nencoding: raw\nbyte skip: -1\ndata file: voxels.%d 0 2 1 \
          3\n", Vec::new()),
    ]
    .into_iter()
    .map(|(header, data)| [header.as_bytes(), &data].concat())
    .collect()
}

const NUMBERS: [&str; 18] = [
    "0",
    "-1",
    "-2",
    "1",
    "2",
    "65536",
    "1048576",
    "1048577",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "99999999999999999999999999",
    "1e-310",
    "1e400",
    "nan",
    "-inf",
];
const LINES: [&str; 18] = [
    "type: double",
    "type: uint8",
    "dimension: 4",
    "sizes: 1048576 1048576 16",
    "sizes: 4 4 3 1",
    "encoding: hex",
    "encoding: gzip",
    "data file: LIST",
    "data file: a%03d 1 9 1",
    "space directions: none (0,0,1) (0,1,0)",
    "byte skip: 9223372036854775807",
    "line skip: 18446744073709551615",
    "encoding: ascii",
    "encoding: bz2",
    "voxels.0",
    "data file: voxels.%01d -9223372036854775808 9223372036854775807 1 3",
    "data file: voxels.%d 0 1048575 1",
    "sizes: 1 1 1048576",
];

#[derive(Debug, Clone)]
enum Mutation {
    Flip { at: prop::sample::Index, bit: u8 },
    Put { at: prop::sample::Index, byte: u8 },
    Truncate { at: prop::sample::Index },
    SwapNumber { which: prop::sample::Index, number: prop::sample::Index },
    DuplicateLine { from: prop::sample::Index, to: prop::sample::Index },
    DropLine { which: prop::sample::Index },
    AddLine { line: prop::sample::Index, to: prop::sample::Index },
}

fn mutation() -> impl Strategy<Value = Mutation> {
    use prop::sample::Index;
    prop_oneof![
        3 => (any::<Index>(), 0u8..8).prop_map(|(at, bit)| Mutation::Flip { at, bit }),
        2 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Mutation::Put { at, byte }),
        1 => any::<Index>().prop_map(|at| Mutation::Truncate { at }),
        4 => (any::<Index>(), any::<Index>()).prop_map(|(which, number)| Mutation::SwapNumber { which, number }),
        1 => (any::<Index>(), any::<Index>()).prop_map(|(from, to)| Mutation::DuplicateLine { from, to }),
        1 => any::<Index>().prop_map(|which| Mutation::DropLine { which }),
        2 => (any::<Index>(), any::<Index>()).prop_map(|(line, to)| Mutation::AddLine { line, to }),
    ]
}

/// Half-open ranges of the header's numbers.
fn numbers(header: &[u8]) -> Vec<(usize, usize)> {
    let part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
    let starts = (0..header.len()).filter(|&i| part(&header[i]) && (i == 0 || !part(&header[i - 1])));
    starts.map(|i| (i, i + header[i..].iter().take_while(|b| part(b)).count())).collect()
}

fn mutate(file: &mut Vec<u8>, mutation: &Mutation) {
    let end = file.windows(2).position(|w| w == b"\n\n").map_or(file.len(), |at| at + 2);
    let lines = |file: &[u8]| file[..end].split_inclusive(|&b| b == b'\n').map(<[u8]>::to_vec).collect::<Vec<_>>();
    let join = |lines: Vec<Vec<u8>>, file: &[u8]| [lines.concat(), file[end..].to_vec()].concat();
    if end == 0 {
        return;
    }
    match mutation {
        Mutation::Flip { at, bit } => file[at.index(end)] ^= 1 << bit,
        Mutation::Put { at, byte } => file[at.index(end)] = *byte,
        Mutation::Truncate { at } => file.truncate(at.index(file.len())),
        Mutation::SwapNumber { which, number } => {
            let found = numbers(&file[..end]);
            if !found.is_empty() {
                let (from, to) = found[which.index(found.len())];
                file.splice(from..to, number.get(&NUMBERS).bytes());
            }
        }
        Mutation::DuplicateLine { from, to } => {
            let mut all = lines(file);
            let line = from.get(&all).clone();
            all.insert(to.index(all.len()), line);
            *file = join(all, file);
        }
        Mutation::DropLine { which } => {
            let mut all = lines(file);
            all.remove(which.index(all.len()));
            *file = join(all, file);
        }
        Mutation::AddLine { line, to } => {
            let mut all = lines(file);
            all.insert(to.index(all.len()), format!("{}\n", line.get(&LINES)).into_bytes());
            *file = join(all, file);
        }
    }
}

/// Opens and reads all planes; bytes read.
fn read(path: &Path) -> Result<u64, FormatError> {
    let mut source = format::open(path, &RawHints::default())?;
    let (geometry, voxel_bytes) = (source.header().geometry, source.header().voxel_type.bytes() as u64);
    let (mut planes, mut bytes) = (Vec::new(), 0);
    for _ in 0..geometry.dims().z.div_ceil(2) {
        source.read_planes(2, &mut planes)?;
        bytes += planes.len() as u64;
    }
    assert_eq!(bytes, geometry.voxel_count() * voxel_bytes);
    Ok(bytes)
}

#[test]
fn mutated_headers_give_a_volume_or_a_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("voxels.bin"), [7; 48]).unwrap();
    for i in 0..3 {
        std::fs::write(folder.path().join(format!("voxels.{i}")), [i; 16]).unwrap();
    }
    let path = folder.path().join("x.nrrd");
    let seeds = seeds();
    for seed in &seeds {
        std::fs::write(&path, seed).unwrap();
        assert_eq!(read(&path).unwrap(), 48, "{}", String::from_utf8_lossy(seed));
    }
    let (read_whole, refused) = (Cell::new(0), Cell::new(0));
    let config = ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() };
    let strategy = (prop::sample::select(seeds), prop::collection::vec(mutation(), 1..4));
    proptest::test_runner::TestRunner::new(config)
        .run(&strategy, |(mut file, mutations)| {
            mutations.iter().for_each(|m| mutate(&mut file, m));
            let started = Instant::now();
            let parsed = NrrdHeader::parse(&file).is_ok();
            // A new file each time: some file systems flush one that is overwritten, ten times slower.
            std::fs::remove_file(&path).unwrap();
            std::fs::write(&path, &file).unwrap();
            match read(&path) {
                Ok(bytes) => {
                    prop_assert!(parsed);
                    prop_assert!(bytes <= 1 << 20, "{bytes} bytes out of {}", file.len());
                    read_whole.set(read_whole.get() + 1);
                }
                Err(FormatError::Memory { bytes, .. }) => prop_assert!(false, "{bytes} bytes were asked for"),
                Err(error) => {
                    let text = error.to_string();
                    prop_assert!(text.contains("x.nrrd") || text.contains("voxels"), "no file in: {text}");
                    prop_assert!(text.len() < 1_500 && !text.chars().any(char::is_control), "{text:?}");
                    refused.set(refused.get() + 1);
                }
            }
            prop_assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
            Ok(())
        })
        .unwrap();
    let (read_whole, refused) = (read_whole.get(), refused.get());
    // Both ways must have been gone often, or the mutations are too weak or too strong to show anything.
    assert!(read_whole > CASES / 50 && refused > CASES / 10, "{read_whole} read, {refused} refused");
    eprintln!("{read_whole} read, {refused} refused");
    let peak = ALLOCATOR.max_allocated();
    assert!(peak < MEMORY_BOUND, "{peak} bytes were allocated at once");
}
