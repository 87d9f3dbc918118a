//! What is written is read again: every type in every format that holds it, place and unit within its header.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

use std::path::Path;

use brickcast_formats::{WriteError, open, write};
use brickcast_volume::format::{Endian, RawHints, VolumeSource, VoxelType, hinted};
use glam::{DMat3, DVec3};

const DIMS: [u32; 3] = [5, 4, 3];
const TYPES: [VoxelType; 10] = [
    VoxelType::U8,
    VoxelType::I8,
    VoxelType::U16,
    VoxelType::I16,
    VoxelType::U32,
    VoxelType::I32,
    VoxelType::F32,
    VoxelType::U64,
    VoxelType::I64,
    VoxelType::F64,
];

fn bytes_of(voxel_type: VoxelType) -> Vec<u8> {
    // Every byte differs, and no float is NaN.
    let count = DIMS.iter().product::<u32>() as usize * voxel_type.bytes();
    (0..count).map(|i| (i * 37 % 251) as u8 & 0x7b).collect()
}

fn hints(voxel_type: VoxelType) -> RawHints {
    RawHints {
        dims: Some(DIMS),
        voxel_type: Some(voxel_type),
        endian: Some(Endian::Little),
        spacing: Some([0.5, 1.25, 3.0]),
        origin: Some([10.0, -20.0, 30.5]),
        axes: Some(DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z)),
        ..RawHints::default()
    }
}

fn all(source: &mut dyn VolumeSource) -> Vec<u8> {
    let mut voxels = Vec::new();
    source.read_planes(u32::MAX, &mut voxels).unwrap();
    voxels
}

#[test]
fn what_is_written_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    for voxel_type in TYPES {
        let raw = folder.path().join("in.bin");
        std::fs::write(&raw, bytes_of(voxel_type)).unwrap();
        for (end, [has_origin, has_axes, has_spacing]) in [
            ("nrrd", [true; 3]),
            ("mha", [true; 3]),
            ("mhd", [true; 3]),
            ("nii", [true; 3]),
            ("nii.gz", [true; 3]),
            ("tif", [false, false, true]),
            ("npy", [false; 3]),
        ] {
            let out = folder.path().join(format!("{voxel_type}.{end}"));
            let mut source = open(&raw, &hints(voxel_type)).unwrap();
            let mut told = (0, 0);
            let written = write(source.as_mut(), None, (&out, false), &mut |done, total| told = (done, total)).unwrap();
            assert_eq!((told.0, written.voxel_type), (told.1, voxel_type), "{end}");
            let mut read = open(&out, &RawHints::default()).unwrap();
            let (got, want) = (read.header().clone(), source.header().clone());
            assert_eq!((got.voxel_type, got.geometry.dims()), (voxel_type, want.geometry.dims()), "{end}");
            assert!(all(read.as_mut()) == bytes_of(voxel_type), "{voxel_type} in {end}");
            let near = |a: DVec3, b: DVec3| (a - b).length() < 1e-6;
            let (g, w) = (got.geometry, want.geometry);
            let notes = written.notes.join("\n");
            if has_spacing {
                assert!(near(g.spacing(), w.spacing()), "{end}: {:?}", g.spacing());
            }
            assert_eq!(notes.contains("the spacing 0.5, 1.25, 3"), !has_spacing, "{end}: {notes}");
            assert_eq!(notes.contains("the origin 10, -20, 30.5"), !has_origin, "{end}: {notes}");
            assert_eq!(notes.contains("which way the axes go"), !has_axes, "{end}: {notes}");
            if has_axes {
                assert!(near(g.origin(), w.origin()) && g.directions() == w.directions(), "{end}");
            }
        }
    }
}

#[test]
fn slope_and_intercept_are_kept_or_applied() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("in.bin"), [0i16, 1000, 4095, -1].map(i16::to_le_bytes).concat()).unwrap();
    let raw = RawHints {
        dims: Some([2, 2, 1]),
        voxel_type: Some(VoxelType::I16),
        endian: Some(Endian::Little),
        ..RawHints::default()
    };
    let mut source = open(&path("in.bin"), &raw).unwrap();
    write(source.as_mut(), None, (&path("plain.nii"), false), &mut |_, _| {}).unwrap();
    // scl_slope and scl_inter.
    let mut nifti = std::fs::read(path("plain.nii")).unwrap();
    nifti[112..116].copy_from_slice(&1f32.to_le_bytes());
    nifti[116..120].copy_from_slice(&(-1024f32).to_le_bytes());
    std::fs::write(path("ct.nii"), nifti).unwrap();
    let ct = |values, name: &str| {
        let mut source = open(&path("ct.nii"), &RawHints::default()).unwrap();
        write(source.as_mut(), values, (&path(name), false), &mut |_, _| {}).unwrap();
        let mut read = open(&path(name), &RawHints::default()).unwrap();
        let rescale = read.header().rescale;
        (read.header().voxel_type, rescale, all(read.as_mut()))
    };
    let whole = [-1024i16, -24, 3071, -1025].map(i16::to_le_bytes).concat();
    let (voxel_type, rescale, voxels) = ct(Some((-1025.0, 3071.0)), "values.nrrd");
    assert!(voxel_type == VoxelType::I16 && rescale.is_identity() && voxels == whole);
    let (voxel_type, _, voxels) = ct(None, "floats.npy");
    assert!(
        voxel_type == VoxelType::F32 && voxels == [-1024f32, -24.0, 3071.0, -1025.0].map(f32::to_le_bytes).concat()
    );
    let (voxel_type, rescale, _) = ct(None, "again.nii");
    assert_eq!((voxel_type, rescale.value(1000.0)), (VoxelType::I16, -24.0));
}

#[test]
fn nothing_is_replaced_unasked_and_what_fails_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("in.bin"), bytes_of(VoxelType::U16)).unwrap();
    let source = || open(&path("in.bin"), &hints(VoxelType::U16)).unwrap();
    let to = |name: &str, force| write(source().as_mut(), None, (&path(name), force), &mut |_, _| {});
    let names = |folder: &Path| folder.read_dir().unwrap().count();
    for name in ["v.xyz", "v", ".nrrd", "v.gz"] {
        let error = to(name, false).unwrap_err();
        assert!(matches!(error, WriteError::Name { .. }) && error.to_string().contains(".nii.gz"), "{error}");
    }
    std::fs::write(path("v.raw"), b"mine").unwrap();
    let error = to("v.mhd", false).unwrap_err().to_string();
    assert!(error.contains("v.raw is there already") && error.contains("--force"), "{error}");
    assert_eq!(names(folder.path()), 2);
    to("v.mhd", true).unwrap();
    assert_eq!(std::fs::read(path("v.raw")).unwrap(), bytes_of(VoxelType::U16));
    // A source that breaks in the middle.
    let crop = RawHints { crop: Some(":,:,1:".parse().unwrap()), ..RawHints::default() };
    let mut cropped = hinted(source(), &path("in.bin"), &crop).unwrap();
    std::fs::write(path("in.bin"), b"short").unwrap();
    assert!(write(cropped.as_mut(), None, (&path("w.npy"), false), &mut |_, _| {}).is_err());
    assert!(!path("w.npy").exists());
    assert_eq!(names(folder.path()), 3, "no leftovers");
}
