//! Thousands of mutated images: never a panic, never more memory than there are bytes to fill it, always voxels or a
//! clear error.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::alloc::System;
use std::cell::Cell;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_volume::format::{FormatError, RawHints};
use brickcast_volume::store::MemoryObjects;
use cap::Cap;
use proptest::prelude::*;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// A few chunks, their encoded bytes, and what the harness holds; a mutated chunk of a gigabyte would be far above.
const MEMORY_BOUND: usize = 24 << 20;
const CASES: u32 = 4_000;
/// Of a volume that became huge no more is read than this on each axis.
const MOST_READ: u32 = 24;

type Files = Vec<(String, Vec<u8>)>;

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

fn checked(data: Vec<u8>) -> Vec<u8> {
    [&data[..], &crc32c::crc32c(&data).to_le_bytes()].concat()
}

/// One block in one stream, of a compressor by its number, in elements of two bytes.
fn blosc(flags: u8, stream: &[u8], bytes: usize) -> Vec<u8> {
    let length = 16 + 4 + 4 + stream.len();
    let numbers = [bytes, bytes, length, 20, stream.len()].map(|n| (n as u32).to_le_bytes()).concat();
    [&[2, 1, flags | 0x10, 2], &numbers[..], stream].concat()
}

const TRANSFORMS: &str = r#""datasets": [ { "path": "0", "coordinateTransformations": [
    { "type": "scale", "scale": [1, 2.5, 0.5, 0.5] }, { "type": "translation", "translation": [0, -1, 2, 3] } ] } ]"#;
const AXES: &str = r#""axes": [ { "name": "c", "type": "channel" },
    { "name": "z", "type": "space", "unit": "micrometer" }, { "name": "y", "type": "space", "unit": "millimeter" }, { "name": "x", "type": "space", "unit": "micrometer" } ]"#;

/// Valid images, between them of every field and codec that matters: 2 channels of 8 x 6 x 4 voxels in chunks of
/// 4 x 6 x 2.
fn seeds() -> Vec<Files> {
    let voxels = |bytes: usize| (0..48 * bytes).map(|i| (i * 7) as u8).collect::<Vec<u8>>();
    let v2 = |array: &str, chunk: Vec<u8>, separator: &str| {
        let attributes = format!(r#"{{ "multiscales": [ {{ "version": "0.4", {AXES}, {TRANSFORMS} }} ] }}"#);
        let mut files = vec![(".zattrs".to_owned(), attributes.into_bytes()), ("0/.zarray".to_owned(), array.into())];
        for key in ["0000", "0001", "0100", "1101"] {
            let at: Vec<String> = key.chars().map(String::from).collect();
            files.push((format!("0/{}", at.join(separator)), chunk.clone()));
        }
        files
    };
    let v2_array = |kind: &str, more: &str| {
        format!(
            r#"{{ "zarr_format": 2, "shape": [2, 4, 6, 8], "chunks": [1, 2, 6, 4], "dtype": "{kind}", "fill_value": 3,
            "order": "C", "filters": null, {more} }}"#
        )
    };
    let v3 = |kind: &str, chunks: &str, codecs: &str, chunk: Vec<u8>| {
        let group = format!(
            r#"{{ "zarr_format": 3, "node_type": "group", "attributes": {{ "ome": {{ "version": "0.5",
            "multiscales": [ {{ {AXES}, {TRANSFORMS} }} ], "omero": {{ "channels": [ {{ "label": "a" }} ] }} }} }} }}"#
        );
        let array = format!(
            r#"{{ "zarr_format": 3, "node_type": "array", "shape": [2, 4, 6, 8], "data_type": "{kind}",
            "chunk_grid": {{ "name": "regular", "configuration": {{ "chunk_shape": {chunks} }} }},
            "chunk_key_encoding": {{ "name": "default", "configuration": {{ "separator": "/" }} }},
            "fill_value": "NaN", "codecs": {codecs}, "attributes": {{}}, "dimension_names": ["c", "z", "y", "x"] }}"#
        );
        let array = if kind.starts_with("float") { array } else { array.replace("\"NaN\"", "0.0") };
        let mut files = vec![("zarr.json".to_owned(), group.into_bytes()), ("0/zarr.json".to_owned(), array.into())];
        for key in ["0/0/0/0", "0/0/0/1", "0/1/0/0"] {
            files.push((format!("0/c/{key}"), chunk.clone()));
        }
        files
    };
    let little = r#"{ "name": "bytes", "configuration": { "endian": "little" } }"#;
    let lz4 = |bytes: usize| lz4_flex::block::compress(&voxels(bytes));
    // Of two inner chunks the first is there, behind it the index.
    let inner = checked(zstd::bulk::compress(&voxels(2), 1).unwrap());
    let index = [0, inner.len() as u64, u64::MAX, u64::MAX].map(u64::to_le_bytes).concat();
    let shard = [inner, checked(index)].concat();
    let sharded = format!(
        r#"[ {{ "name": "sharding_indexed", "configuration": {{ "chunk_shape": [1, 2, 6, 4], "codecs": [
        {{ "name": "transpose", "configuration": {{ "order": [3, 0, 2, 1] }} }}, {little},
        {{ "name": "zstd", "configuration": {{ "level": 1 }} }}, {{ "name": "crc32c" }} ],
        "index_codecs": [ {little}, {{ "name": "crc32c" }} ], "index_location": "end" }} }} ]"#
    );
    let blosc_codecs = format!(r#"[ {little}, {{ "name": "blosc", "configuration": {{ "cname": "lz4" }} }} ]"#);
    let gzip_codecs = format!(r#"[ {little}, {{ "name": "gzip", "configuration": {{ "level": 1 }} }} ]"#);
    let zlib = {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&voxels(2)).unwrap();
        encoder.finish().unwrap()
    };
    let zstd = zstd::bulk::compress(&voxels(2), 1).unwrap();
    // Runs of literals of 24 bytes.
    let blosclz: Vec<u8> = voxels(2).chunks(24).flat_map(|run| [&[23][..], run].concat()).collect();
    let numcodecs_lz4 = [&96u32.to_le_bytes()[..], &lz4(2)].concat();
    let separator = r#""dimension_separator": "/", "compressor""#;
    vec![
        v2(&v2_array("<u2", r#""compressor": null"#), voxels(2), "."),
        v2(&v2_array(">f4", &format!(r#"{separator}: {{ "id": "gzip", "level": 1 }}"#)), gzip(&voxels(4)), "/"),
        v2(&v2_array("|i1", &format!(r#"{separator}: {{ "id": "blosc" }}"#)), blosc(0x22, &voxels(1), 48), "/"),
        v2(&v2_array("<i2", &format!(r#"{separator}: {{ "id": "blosc" }}"#)), blosc(0x01, &blosclz, 96), "/"),
        v2(&v2_array("<u2", &format!(r#"{separator}: {{ "id": "blosc" }}"#)), blosc(0x84, &zstd, 96), "/"),
        v2(&v2_array("<u2", &format!(r#"{separator}: {{ "id": "blosc" }}"#)), blosc(0x61, &zlib, 96), "/"),
        v2(&v2_array("<u2", r#""compressor": { "id": "lz4" }"#), numcodecs_lz4, "."),
        v3("uint16", "[2, 2, 6, 8]", &sharded.replace("[1, 2, 6, 4]", "[2, 2, 6, 4]"), Vec::new()),
        v3("uint16", "[1, 2, 6, 8]", &sharded, shard),
        v3("int16", "[1, 2, 6, 4]", &blosc_codecs, blosc(0x21, &lz4(2), 96)),
        v3("float32", "[1, 2, 6, 4]", &gzip_codecs, gzip(&voxels(4))),
    ]
    .into_iter()
    .map(|files: Files| files.into_iter().filter(|(_, content)| !content.is_empty()).collect())
    .collect()
}

const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "65536",
    "1048576",
    "1048577",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "1e-310",
    "1e308",
    "null",
];

#[derive(Debug, Clone)]
enum Mutation {
    Flip { file: prop::sample::Index, at: prop::sample::Index, bit: u8 },
    Put { file: prop::sample::Index, at: prop::sample::Index, byte: u8 },
    Truncate { file: prop::sample::Index, at: prop::sample::Index },
    SwapNumber { file: prop::sample::Index, which: prop::sample::Index, number: prop::sample::Index },
    SwapFiles { one: prop::sample::Index, other: prop::sample::Index },
    Drop { file: prop::sample::Index },
}

fn mutation() -> impl Strategy<Value = Mutation> {
    use prop::sample::Index;
    let index = any::<Index>;
    prop_oneof![
        4 => (index(), index(), 0u8..8).prop_map(|(file, at, bit)| Mutation::Flip { file, at, bit }),
        3 => (index(), index(), any::<u8>()).prop_map(|(file, at, byte)| Mutation::Put { file, at, byte }),
        1 => (index(), index()).prop_map(|(file, at)| Mutation::Truncate { file, at }),
        5 => (index(), index(), index()).prop_map(|(file, which, number)| Mutation::SwapNumber { file, which, number }),
        1 => (index(), index()).prop_map(|(one, other)| Mutation::SwapFiles { one, other }),
        1 => index().prop_map(|file| Mutation::Drop { file }),
    ]
}

/// Half-open ranges of a text's numbers.
fn numbers(text: &[u8]) -> Vec<(usize, usize)> {
    let part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
    let starts = (0..text.len()).filter(|&i| part(&text[i]) && (i == 0 || !part(&text[i - 1])));
    starts.map(|i| (i, i + text[i..].iter().take_while(|b| part(b)).count())).collect()
}

fn mutate(files: &mut Files, mutation: &Mutation) {
    match mutation {
        Mutation::Flip { file, at, bit } => {
            let content = &mut file.get_mut(files).1;
            if !content.is_empty() {
                *at.get_mut(content) ^= 1 << bit;
            }
        }
        Mutation::Put { file, at, byte } => {
            let content = &mut file.get_mut(files).1;
            if !content.is_empty() {
                *at.get_mut(content) = *byte;
            }
        }
        Mutation::Truncate { file, at } => {
            let content = &mut file.get_mut(files).1;
            content.truncate(at.index(content.len() + 1));
        }
        Mutation::SwapNumber { file, which, number } => {
            let metadata: Vec<usize> =
                (0..files.len()).filter(|i| files[*i].0.contains("zarr") || files[*i].0.contains("zattrs")).collect();
            if metadata.is_empty() {
                return;
            }
            let content = &mut files[*file.get(&metadata)].1;
            let found = numbers(content);
            if !found.is_empty() {
                let (from, to) = *which.get(&found);
                content.splice(from..to, number.get(&NUMBERS).bytes());
            }
        }
        Mutation::SwapFiles { one, other } => {
            let (one, other) = (one.index(files.len()), other.index(files.len()));
            let content = files[one].1.clone();
            files[one].1 = std::mem::replace(&mut files[other].1, content);
        }
        Mutation::Drop { file } => {
            if files.len() > 1 {
                files.remove(file.index(files.len()));
            }
        }
    }
}

/// Opens and reads all voxels, or some of very many; how many bytes.
fn read(files: &Files) -> Result<u64, FormatError> {
    let mut objects = MemoryObjects::new(Path::new("x.zarr"));
    files.iter().for_each(|(key, content)| objects.put(key, content.clone()));
    let mut source = brickcast_zarr::open(Arc::new(objects), &RawHints::default())?;
    let (dims, voxel) = (source.header().geometry.dims(), source.header().voxel_type.bytes());
    let most = dims.min(glam::UVec3::splat(MOST_READ));
    let mut voxels = Vec::new();
    assert!(source.read_box([0; 3], most.to_array(), &mut voxels)?);
    assert_eq!(voxels.len(), most.element_product() as usize * voxel);
    let mut bytes = voxels.len() as u64;
    if dims == most {
        let mut planes = Vec::new();
        source.read_planes(dims.z, &mut planes)?;
        assert!(planes == voxels, "rows and boxes differ");
        bytes += planes.len() as u64;
    }
    // The farthest corner.
    assert!(source.read_box((dims - 1).to_array(), dims.to_array(), &mut voxels)?);
    assert_eq!(voxels.len(), voxel);
    Ok(bytes)
}

#[test]
fn mutated_images_give_voxels_or_a_clear_error() {
    let seeds = seeds();
    for (i, seed) in seeds.iter().enumerate() {
        match (i, read(seed)) {
            // The one without chunks.
            (7, Err(error)) => assert!(error.to_string().contains("not one chunk is there"), "{error}"),
            (_, result) => assert!(result.unwrap() >= 2 * 192, "{seed:?}"),
        }
    }
    let (read_whole, refused) = (Cell::new(0), Cell::new(0));
    let config = ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() };
    let strategy = (prop::sample::select(seeds), prop::collection::vec(mutation(), 1..4));
    proptest::test_runner::TestRunner::new(config)
        .run(&strategy, |(mut files, mutations)| {
            mutations.iter().for_each(|m| mutate(&mut files, m));
            let started = Instant::now();
            match read(&files) {
                Ok(_) => read_whole.set(read_whole.get() + 1),
                Err(FormatError::Memory { bytes, .. }) => prop_assert!(false, "{bytes} bytes were asked for"),
                Err(error) => {
                    let text = error.to_string();
                    prop_assert!(text.contains("x.zarr"), "no place in: {text}");
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
