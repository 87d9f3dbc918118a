//! A phantom that is streamed into a store: the store of its file.

use std::path::Path;

use brickcast_volume::format::{self, RawHints, VolumeSource};
use brickcast_volume::phantom::{Phantom, PhantomOptions, write_phantom};
use brickcast_volume::store::{PrepareOptions, Store, prepare};
use serde_json::Value;

use super::regions::windows;
use super::support::files_of;

fn options(dims: [u32; 3]) -> PhantomOptions {
    PhantomOptions { dims, pores: 7, seed: 3, noise: 1.0, ..PhantomOptions::default() }
}

/// Every file with its content; of manifests without what names the input, and without hashes of files that name it.
fn content(store: &Path) -> Vec<(String, Vec<u8>)> {
    let read = |file: std::path::PathBuf| {
        let name = file.strip_prefix(store).unwrap().to_str().unwrap().to_owned();
        let bytes = std::fs::read(file).unwrap();
        if !["brickcast.json", "level.json"].iter().any(|manifest| name.ends_with(manifest)) {
            return (name, bytes);
        }
        let mut manifest: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(manifest["source"]["name"], "v");
        let format = manifest["source"]["format"].take();
        assert!(format == "phantom" || format == "NRRD", "{format}");
        let of_levels = manifest.get_mut("levels").and_then(Value::as_array_mut);
        of_levels.into_iter().flatten().for_each(|level| drop(level["hash"].take()));
        (name, manifest.to_string().into_bytes())
    };
    files_of(store).into_iter().map(read).collect()
}

/// Of planes and of tiles, with and without regions.
#[test]
fn the_store_is_that_of_the_file() {
    for (dims, options_of_store) in [
        ([72, 66, 70], windows(16, 0.03)),
        ([300, 270, 35], PrepareOptions { tile_voxels: 1, ..PrepareOptions::default() }),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (file, [of_file, streamed]) =
            (folder.path().join("v.nrrd"), ["of file", "streamed"].map(|n| folder.path().join(n)));
        write_phantom(&file, &options(dims), &mut |_, _| {}).unwrap();
        let making = PrepareOptions { source_name: Some("v".to_owned()), ..options_of_store };
        let mut source = format::open(&file, &RawHints::default()).unwrap();
        prepare(source.as_mut(), &of_file, &making, &mut |_| {}).unwrap();
        let phantom = Phantom::new(&options(dims)).unwrap();
        prepare(&mut phantom.source(), &streamed, &making, &mut |_| {}).unwrap();
        let (got, want) = (content(&streamed), content(&of_file));
        assert_eq!(got.len(), want.len(), "{dims:?}");
        for (got, want) in got.iter().zip(&want) {
            assert!(got == want, "{dims:?}: {} differs from {}", got.0, want.0);
        }
        Store::open(&streamed).unwrap().verify(&mut |_| {}).unwrap();
    }
}

/// Whatever is asked for, from wherever, is cut out of the file.
#[test]
fn voxels_are_the_same_however_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let (file, dims) = (folder.path().join("v.nrrd"), [70, 33, 29]);
    write_phantom(&file, &options(dims), &mut |_, _| {}).unwrap();
    let mut source = format::open(&file, &RawHints::default()).unwrap();
    let mut all = Vec::new();
    source.read_planes(dims[2], &mut all).unwrap();
    let phantom = Phantom::new(&options(dims)).unwrap();
    let mut made = phantom.source();
    let want = source.header();
    let got = made.header();
    assert_eq!((got.geometry, got.placement, got.voxel_type), (want.geometry, want.placement, want.voxel_type));
    assert_eq!((&got.space_unit, &got.no_data, &got.notes), (&want.space_unit, &want.no_data, &want.notes));

    let mut voxels = Vec::new();
    made.read_planes(dims[2] + 3, &mut voxels).unwrap();
    assert!(voxels == all);
    for first in [0, 5, 69, 70, 71, 2310, 4000] {
        for most in [1, 2, 7, 130, 1000, usize::MAX / 4] {
            assert!(made.seek(first as u64).unwrap());
            made.read_piece(most, &mut voxels).unwrap();
            let end = (first * 2 + (most / 2).max(1) * 2).min(all.len());
            assert!(voxels == all[first * 2..end], "{most} bytes from voxel {first}");
        }
    }
    let [nx, ny, _] = dims.map(|n| n as usize);
    for (lo, hi) in [([0, 0, 0], dims), ([3, 5, 7], [4, 6, 8]), ([17, 2, 11], [70, 33, 13]), ([69, 0, 28], dims)] {
        assert!(made.read_box(lo, hi, &mut voxels).unwrap());
        let rows = (lo[2]..hi[2]).flat_map(|z| (lo[1]..hi[1]).map(move |y| (y as usize, z as usize)));
        let want = rows.flat_map(|(y, z)| {
            let row = (z * ny + y) * nx;
            &all[(row + lo[0] as usize) * 2..(row + hi[0] as usize) * 2]
        });
        assert!(voxels.iter().eq(want), "{lo:?} {hi:?}");
    }
    made.rewind().unwrap();
    made.read_planes(1, &mut voxels).unwrap();
    assert!(voxels == all[..voxels.len()] && voxels.len() == nx * ny * 2);
}
