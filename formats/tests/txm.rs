//! Zeiss's .txm from its description: slices small and large, in both kinds of compound files.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

#[path = "common/txm.rs"]
mod txm;

use brickcast_volume::format::{FormatError, RawHints, VolumeSource, VoxelType};
use txm::{number, written};

fn opened(file: &[u8]) -> (tempfile::TempDir, Result<Box<dyn VolumeSource>, FormatError>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.txm");
    std::fs::write(&path, file).unwrap();
    let opened = brickcast_formats::open(&path, &RawHints::default());
    (folder, opened)
}

fn images(count: u32, bytes: usize) -> Vec<Vec<u8>> {
    (0..count).map(|z| (0..bytes).map(|i| (i as u32 * 31 + z * 7) as u8).collect()).collect()
}

#[test]
fn every_slice_is_read() {
    let pixel = 1.5_f32.to_le_bytes().to_vec();
    for version in [cfb::Version::V3, cfb::Version::V4] {
        for (size, data_type, voxel_type) in [
            ([7, 5], 5, VoxelType::U16),
            ([7, 5], 10, VoxelType::F32),
            ([300, 200], 5, VoxelType::U16),
            ([64, 32], 5, VoxelType::U16),
        ] {
            // More than a folder has, and more sectors of the table than the header names.
            let images =
                images(if size[0] == 300 { 230 } else { 203 }, (size[0] * size[1]) as usize * voxel_type.bytes());
            let fields = [("DataType", number(data_type)), ("PixelSize", pixel.clone()), ("Angles", vec![1; 9000])];
            let (_folder, source) = opened(&written(version, size, &images, &fields));
            let mut source = source.unwrap();
            let header = source.header();
            assert_eq!(header.geometry.dims().to_array(), [size[0], size[1], images.len() as u32]);
            assert_eq!((header.voxel_type, header.space_unit.as_deref()), (voxel_type, Some("um")));
            assert_eq!(header.geometry.spacing().to_array(), [1.5; 3]);
            let mut planes = Vec::new();
            source.read_planes(1000, &mut planes).unwrap();
            assert!(planes == images.concat(), "{version:?} {size:?}");
        }
    }
}

#[test]
fn what_is_not_there_is_named() {
    let data_type = |n| ("DataType", number(n));
    let refused = |file: &[u8], want: &str| {
        let (_folder, source) = opened(file);
        let read = source.and_then(|mut source| source.read_planes(1000, &mut Vec::new()));
        let error = read.expect_err(want).to_string();
        assert!(error.contains("scan.txm") && error.contains(want), "no {want} in {error}");
    };
    let version = cfb::Version::V3;
    let good = written(version, [7, 5], &images(3, 70), &[data_type(5)]);
    let (_folder, source) = opened(&good);
    assert!(source.unwrap().header().notes.join("\n").contains("spacing not said"));
    refused(&written(version, [7, 5], &images(3, 70), &[]), "ImageInfo/DataType: it is not there");
    refused(&written(version, [7, 5], &images(3, 70), &[data_type(3)]), "3; read are 5 (uint16) and 10 (float32)");
    refused(&written(version, [7, 6], &images(3, 70), &[data_type(5)]), "70 bytes instead of 84");
    refused(&written(version, [7, 6], &[], &[data_type(5)]), "NoOfImages");
    let mut other = cfb::CompoundFile::create(std::io::Cursor::new(Vec::new())).unwrap();
    other.create_stream("/WordDocument").unwrap();
    refused(&other.into_inner().into_inner(), "no file of a Zeiss microscope");
    for length in [9, 511, 512, 600, 1100, good.len() - 600] {
        refused(&good[..length], "compound file");
    }
}
