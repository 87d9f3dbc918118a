//! Thousands of damaged files of every format: never a panic, never an endless wait, never more memory than their bytes
//! can be made into; voxels, or an error that names the file.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod dicom_seeds;
mod seeds;
#[path = "../common/txm.rs"]
mod txm;
#[path = "../common/dicom.rs"]
mod written;

use std::alloc::System;
use std::cell::Cell;
use std::path::Path;
use std::time::{Duration, Instant};

use brickcast_volume::format::{FormatError, RawHints};
use cap::Cap;
use proptest::prelude::*;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

const MEMORY_BOUND: usize = 256 << 20;
/// Of each format; `BRICKCAST_CASES` for a longer hunt.
const CASES: u32 = 3_000;
/// Of a volume that became huge no more planes are read, nor planes of more bytes.
const MOST_PLANES: u32 = 64;
const MOST_PLANE: u64 = 1 << 40;

#[derive(Debug, Clone)]
enum Mutation {
    Flip { at: prop::sample::Index, bit: u8 },
    Put { at: prop::sample::Index, byte: u8 },
    PutNumber { at: prop::sample::Index, number: prop::sample::Index },
    Truncate { at: prop::sample::Index },
    SwapText { which: prop::sample::Index, number: prop::sample::Index },
    Copy { from: prop::sample::Index, to: prop::sample::Index },
}

const NUMBERS: [u64; 12] = [0, 1, 2, 255, 256, 65535, 65536, 1 << 20, 0x7fff_ffff, 0xffff_ffff, 1 << 40, u64::MAX];
const TEXTS: [&str; 10] =
    ["0", "1", "-1", "1048576", "4294967296", "18446744073709551615", "1e300", "nan", "", "99999999999999999999999"];

/// What is behind is voxels; HDF5 has its headers anywhere.
fn header_of(name: &str) -> usize {
    if name.ends_with(".h5") { usize::MAX } else { 600 }
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        3 => (index(), 0_u8..8).prop_map(|(at, bit)| Mutation::Flip { at, bit }),
        3 => (index(), any::<u8>()).prop_map(|(at, byte)| Mutation::Put { at, byte }),
        4 => (index(), index()).prop_map(|(at, number)| Mutation::PutNumber { at, number }),
        1 => index().prop_map(|at| Mutation::Truncate { at }),
        3 => (index(), index()).prop_map(|(which, number)| Mutation::SwapText { which, number }),
        1 => (index(), index()).prop_map(|(from, to)| Mutation::Copy { from, to }),
    ]
}

fn mutate(file: &mut Vec<u8>, header: usize, mutation: &Mutation) {
    if file.len() < 16 {
        return;
    }
    match mutation {
        Mutation::Flip { at, bit } => *at.get_mut(file) ^= 1 << bit,
        Mutation::Put { at, byte } => *at.get_mut(file) = *byte,
        Mutation::PutNumber { at, number } => {
            let (at, number) = (at.index(file.len().min(header) - 4) & !1, number.get(&NUMBERS));
            file[at..at + 4].copy_from_slice(&number.to_le_bytes()[..4]);
        }
        Mutation::Truncate { at } => file.truncate(at.index(file.len())),
        Mutation::SwapText { which, number } => {
            let part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
            let end = file.len().min(header);
            let starts: Vec<usize> = (1..end).filter(|&i| part(&file[i]) && !part(&file[i - 1])).collect();
            if !starts.is_empty() {
                let from = *which.get(&starts);
                let to = from + file[from..end].iter().take_while(|b| part(b)).count();
                file.splice(from..to, number.get(&TEXTS).bytes());
            }
        }
        Mutation::Copy { from, to } => {
            let (from, to) = (from.index(file.len() - 12), to.index(file.len() - 12));
            file.copy_within(from..from + 12, to);
        }
    }
}

/// Opens and reads the planes; bytes read.
fn read(path: &Path) -> Result<u64, FormatError> {
    let mut source = brickcast_formats::open(path, &RawHints::default())?;
    let (dims, voxel) = (source.header().geometry.dims(), source.header().voxel_type.bytes() as u64);
    let (mut planes, mut bytes) = (Vec::new(), 0);
    let plane = u64::from(dims.x) * u64::from(dims.y) * voxel;
    for _ in 0..dims.z.min(MOST_PLANES) {
        match plane <= MOST_PLANE {
            true => source.read_planes(1, &mut planes)?,
            false => source.read_piece(1 << 20, &mut planes)?,
        }
        bytes += planes.len() as u64;
    }
    assert!(dims.z > MOST_PLANES || plane > MOST_PLANE || bytes == plane * u64::from(dims.z), "{bytes} of {dims}");
    Ok(bytes)
}

/// Files of one format, `name` being what they are called.
fn damaged(name: &str, seeds: Vec<Vec<u8>>) {
    let folder = tempfile::tempdir().unwrap();
    for part in ["a.bin", "b.bin", "1.bin", "2.bin"] {
        std::fs::write(folder.path().join(part), seeds::voxels(24)).unwrap();
    }
    std::fs::write(folder.path().join("whole.bin"), seeds::voxels(48)).unwrap();
    let path = folder.path().join(name);
    for (i, seed) in seeds.iter().enumerate() {
        std::fs::write(&path, seed).unwrap();
        // For the fuzzers (docs/formats.md).
        if let Some(kept) = std::env::var_os("BRICKCAST_SEEDS") {
            std::fs::write(Path::new(&kept).join(format!("{i}-{name}")), seed).unwrap();
        }
        assert!(read(&path).unwrap_or_else(|e| panic!("seed {i} of {name}: {e}")) > 0);
    }
    let (read_whole, refused) = (Cell::new(0), Cell::new(0));
    let cases = std::env::var("BRICKCAST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(CASES);
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    // Packed afterwards, a file has no length that would give a lying header away.
    let strategy = (prop::sample::select(seeds), prop::collection::vec(mutation(), 1..4), 0_u8..4);
    proptest::test_runner::TestRunner::new(config)
        .run(&strategy, |(mut file, mutations, packed)| {
            mutations.iter().for_each(|m| mutate(&mut file, header_of(name), m));
            if packed == 0 {
                file = seeds::gzip(&file);
            }
            let started = Instant::now();
            std::fs::remove_file(&path).unwrap();
            std::fs::write(&path, &file).unwrap();
            match read(&path) {
                Ok(_) => read_whole.set(read_whole.get() + 1),
                Err(error) => {
                    let text = error.to_string();
                    prop_assert!(text.contains(name) || text.contains(".bin"), "no file in: {text}");
                    prop_assert!(!text.contains("brickcast-unpacked"), "the copy's name: {text}");
                    prop_assert!(text.len() < 3_000 && !text.chars().any(char::is_control), "{text:?}");
                    refused.set(refused.get() + 1);
                }
            }
            prop_assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
            let peak = ALLOCATOR.max_allocated();
            prop_assert!(peak < MEMORY_BOUND, "{peak} bytes were allocated at once");
            Ok(())
        })
        .unwrap();
    let (read_whole, refused) = (read_whole.get(), refused.get());
    // Both ways must have been gone often, or the mutations are too weak or too strong to show anything.
    assert!(read_whole > cases / 50 && refused > cases / 10, "{name}: {read_whole} read, {refused} refused");
    eprintln!("{name}: {read_whole} read, {refused} refused, {} bytes at most", ALLOCATOR.max_allocated());
}

#[test]
fn damaged_tiffs() {
    damaged("x.tif", seeds::tiffs());
}

#[test]
fn damaged_pictures() {
    damaged("x.png", seeds::pictures());
}

#[test]
fn damaged_meta_images() {
    damaged("x.mha", seeds::meta_images());
}

#[test]
fn damaged_niftis() {
    damaged("x.nii", seeds::niftis());
}

#[test]
fn damaged_arrays() {
    damaged("x.npy", seeds::arrays());
}

#[test]
fn damaged_legacy_files_of_vtk() {
    damaged("x.vtk", seeds::legacy());
}

#[test]
fn damaged_image_data_of_vtk() {
    damaged("x.vti", seeds::image_data());
}

#[test]
fn damaged_dicom() {
    damaged("x.dcm", dicom_seeds::dicoms());
}

#[test]
fn damaged_txm() {
    let seed = |version, size: [u32; 2], data_type, bytes| {
        let fields = [("DataType", txm::number(data_type)), ("PixelSize", 1.5_f32.to_le_bytes().to_vec())];
        txm::written(version, size, &[vec![1; bytes], vec![2; bytes]], &fields)
    };
    let seeds = [seed(cfb::Version::V3, [7, 5], 5, 70), seed(cfb::Version::V4, [60, 40], 10, 9600)];
    damaged("x.txm", seeds.to_vec());
}

#[test]
fn damaged_hdf5() {
    damaged("x.h5", seeds::hdf5());
}

#[test]
fn damaged_amira_meshes() {
    damaged("x.am", seeds::amira());
}

#[test]
fn damaged_headers_of_volume_graphics() {
    damaged("x.vgi", seeds::vgi());
}

/// Packed, no length gives them away: planes of terabytes out of a few bytes.
#[test]
fn headers_that_lie_cost_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let swapped = |seed: &[u8], from: &str, to: &str| {
        let at = seed.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let file = [&seed[..at], to.as_bytes(), &seed[at + from.len()..]].concat();
        seeds::gzip(&file)
    };
    let mut nifti = seeds::niftis()[0].clone();
    nifti[42..46].copy_from_slice(&[0xff, 0x7f, 0xff, 0x7f]);
    let shape = "(2, 1000000, 1000000)";
    let lying = [
        ("x.npy", swapped(&seeds::arrays()[0], &format!("{:<21}", "(2, 3, 4), }"), shape)),
        ("x.mha", swapped(&seeds::meta_images()[0], "DimSize = 4 3 2", "DimSize = 1000000 1000000 2")),
        ("x.nii", seeds::gzip(&nifti)),
        ("x.vtk", swapped(&seeds::legacy()[0], "DIMENSIONS 4 3 2", "DIMENSIONS 1000000 1000000 2")),
    ];
    for (name, file) in lying {
        let path = folder.path().join(name);
        std::fs::write(&path, file).unwrap();
        let error = read(&path).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains("ends after"), "{error}");
        let peak = ALLOCATOR.max_allocated();
        assert!(peak < MEMORY_BOUND, "{name}: {peak} bytes were allocated at once");
    }
}
