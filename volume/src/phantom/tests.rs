//! The phantom as its users meet it: two files, and what they hold.

use std::path::Path;

use glam::DVec3;

use super::*;
use crate::format::{self, RawHints};

fn small() -> PhantomOptions {
    PhantomOptions { dims: [72, 64, 68], pores: 6, seed: 9, noise: 1.75, force: false }
}

fn voxels(path: &Path, dims: [u32; 3]) -> Vec<u16> {
    let mut source = format::open(path, &RawHints::default()).unwrap();
    assert_eq!((source.header().geometry.dims().to_array(), source.header().voxel_type), (dims, VoxelType::U16));
    assert_eq!(source.header().geometry.spacing().to_array(), [SPACING_MM; 3]);
    assert_eq!((source.header().space_unit.as_deref(), source.header().notes.len()), (Some("mm"), 0));
    let mut planes = Vec::new();
    source.read_planes(dims[2], &mut planes).unwrap();
    planes.as_chunks::<2>().0.iter().map(|v| u16::from_le_bytes(*v)).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn the_number_of_threads_changes_no_byte_and_the_seed_changes_all() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, threads, seed| {
        let path = folder.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write_phantom(&path, &PhantomOptions { seed, ..small() }, &mut |_, _| {})).unwrap();
        std::fs::read(path).unwrap()
    };
    let one = write("a.nrrd", 1, 9);
    assert_eq!(one, write("b.nrrd", 3, 9));
    assert_ne!(one, write("c.nrrd", 3, 10));
}

#[test]
fn the_file_holds_air_material_and_every_pore_of_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.nrrd");
    let mut steps = Vec::new();
    let report = write_phantom(&path, &small(), &mut |done, of| steps.push((done, of))).unwrap();
    assert_eq!(steps.last(), Some(&(68, 68)));
    assert_eq!(names(folder.path()), ["part.nrrd", "part.pores.json"]);
    assert_eq!(std::fs::metadata(&path).unwrap().len(), report.bytes);

    let dims = small().dims;
    let all = voxels(&path, dims);
    let at = |x: u32, y: u32, z: u32| f64::from(all[(x + dims[0] * (y + dims[1] * z)) as usize]);
    assert!((500.0..3_500.0).contains(&at(0, 0, 0)));

    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(&report.truth_path).unwrap()).unwrap();
    let rows = truth["pores"].as_array().unwrap();
    assert_eq!((rows.len(), report.pores.len()), (6, 6));
    for (row, pore) in rows.iter().zip(&report.pores) {
        let vector = |key: &str| DVec3::from([0, 1, 2].map(|axis| row[key][axis].as_f64().unwrap()));
        assert_eq!(vector("center_index"), pore.center_voxel);
        assert_eq!(vector("radii_voxels"), pore.radii_voxel);
        let world = report.geometry.world_from_voxel(pore.center_voxel);
        assert!((vector("center_world") - world).length() < 1e-12);
        let volume = row["volume_voxels"].as_f64().unwrap();
        assert!((row["volume_world"].as_f64().unwrap() - volume * 1e-3).abs() < 1e-12);

        // What is missing of the material around the centre, in voxels, against the truth's volume.
        let lo = (pore.center_voxel - pore.radii_voxel - 1.0).floor().as_uvec3();
        let hi = (pore.center_voxel + pore.radii_voxel + 1.0).ceil().as_uvec3();
        let mut missing = 0.0;
        for (z, y, x) in (lo.z..hi.z).flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| (z, y, x))))
        {
            let center = DVec3::new(x.into(), y.into(), z.into()) + 0.5;
            // Beyond the radius and half a voxel's diagonal there is the wall, and behind it perhaps air.
            if center.distance(pore.center_voxel) > pore.radii_voxel.max_element() + 0.87 {
                continue;
            }
            let material = grey::material_at(Part::new(dims).part_from_voxel(center));
            missing += (material - at(x, y, z)) / (material - grey::AIR);
        }
        // Noise of 700 in 38,000 over n voxels: 4 deviations; and 3 % for the sub-voxel grid of the smallest.
        let n = (hi - lo).as_dvec3().element_product();
        let tolerance = 4.0 * 0.0185 * n.sqrt() + 0.03 * volume;
        assert!((missing - volume).abs() < tolerance, "{missing} {volume} {tolerance}");
    }
}

#[test]
fn an_existing_file_is_kept_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    for occupied in ["part.nrrd", "part.pores.json"] {
        let existing = folder.path().join(occupied);
        std::fs::write(&existing, "mine").unwrap();
        let error = write_phantom(&folder.path().join("part.nrrd"), &small(), &mut |_, _| {}).unwrap_err().to_string();
        assert!(error.contains(occupied) && error.contains("--force"), "{error}");
        assert_eq!(std::fs::read(&existing).unwrap(), b"mine");
        assert_eq!(names(folder.path()), [occupied]);
        std::fs::remove_file(existing).unwrap();
    }
    let path = folder.path().join("part.nrrd");
    std::fs::write(&path, "mine").unwrap();
    write_phantom(&path, &PhantomOptions { force: true, ..small() }, &mut |_, _| {}).unwrap();
    assert_eq!(names(folder.path()), ["part.nrrd", "part.pores.json"]);
}

#[test]
fn unusable_options_are_refused_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, options: PhantomOptions, word: &str| {
        let error = write_phantom(&folder.path().join(name), &options, &mut |_, _| {}).unwrap_err().to_string();
        assert!(error.contains(word), "`{word}` is not in: {error}");
        assert_eq!(names(folder.path()), [""; 0]);
    };
    refused("x.nrrd", PhantomOptions { dims: [0, 64, 64], ..small() }, "[0, 64, 64]");
    refused("x.nrrd", PhantomOptions { dims: [64, 64, u32::MAX], ..small() }, "between 16 and 8192");
    refused("x.nrrd", PhantomOptions { pores: u32::MAX, ..small() }, "4294967295");
    refused("x.raw", small(), ".nrrd");
    refused("absent/x.nrrd", small(), "cannot write");
    let crowded =
        write_phantom(&folder.path().join("x.nrrd"), &PhantomOptions { pores: 5_000, ..small() }, &mut |_, _| {});
    let Err(PhantomError::PoresDoNotFit { placed, wanted: 5_000, .. }) = crowded else { panic!("{crowded:?}") };
    assert!(placed < 5_000);
    assert_eq!(names(folder.path()), [""; 0]);
}
