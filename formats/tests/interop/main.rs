//! The same phantom as tifffile, imagecodecs, SimpleITK, nibabel, numpy, VTK, pynrrd, h5py and pydicom write it, and
//! files that these carry, voxel by voxel and place by place.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

// Its `#[test]` in place of the compiler's: a test may find out that it can try nothing here.
#[macro_use]
extern crate brickcast_harness;

use std::path::Path;
use std::process::Command;

use brickcast_volume::format::{RawHints, VolumeSource};

/// One program, in files of a size that can be read.
const WRITER: &str = concat!(include_str!("write.py"), include_str!("hdf5.py"));

fn main() -> std::process::ExitCode {
    brickcast_harness::main()
}

fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    (text != "-").then(|| text.split(' ').map(|n| n.parse().ok().unwrap()).collect())
}

/// All planes, a few at a time, then the last ones again after a rewind, then a piece that was sought.
fn read(source: &mut dyn VolumeSource, want: &[u8], is_near: bool) -> Result<(), String> {
    let d = source.header().geometry.dims();
    let plane = (d.x * d.y) as usize * source.header().voxel_type.bytes();
    let voxel = source.header().voxel_type.bytes();
    for step in [2, d.z] {
        source.rewind().map_err(|e| e.to_string())?;
        let (mut all, mut planes) = (Vec::new(), Vec::new());
        loop {
            source.read_planes(step, &mut planes).map_err(|e| e.to_string())?;
            if planes.is_empty() {
                break;
            }
            assert!(planes.len() <= step as usize * plane);
            all.extend_from_slice(&planes);
        }
        if is_near && within_one(&all, want) {
            return Ok(());
        }
        if all != want {
            let first = all.iter().zip(want).position(|(a, b)| a != b);
            return Err(format!("other voxels from byte {first:?} of {} on, {} are wanted", all.len(), want.len()));
        }
    }
    let middle = want.len() / voxel / 2;
    let mut piece = Vec::new();
    if source.seek(middle as u64).map_err(|e| e.to_string())? {
        source.read_piece(3 * voxel, &mut piece).map_err(|e| e.to_string())?;
        if piece != want[middle * voxel..(middle + 3) * voxel] {
            return Err("other voxels where it was sought".into());
        }
    }
    let d = d.to_array();
    let (lo, hi) = (d.map(|n| n / 3), d.map(|n| n - n / 4));
    if source.read_box(lo, hi, &mut piece).map_err(|e| e.to_string())? {
        let row = |y: u32, z: u32| {
            let start = (lo[0] + d[0] * (y + d[1] * z)) as usize * voxel;
            &want[start..start + (hi[0] - lo[0]) as usize * voxel]
        };
        let rows: Vec<&[u8]> = (lo[2]..hi[2]).flat_map(|z| (lo[1]..hi[1]).map(move |y| row(y, z))).collect();
        if piece != rows.concat() {
            return Err("other voxels in a box".into());
        }
    }
    Ok(())
}

/// Of numbers of 16 bits.
fn within_one(got: &[u8], want: &[u8]) -> bool {
    let numbers = |bytes: &[u8]| bytes.as_chunks::<2>().0.iter().map(|n| i16::from_le_bytes(*n)).collect::<Vec<_>>();
    got.len() == want.len() && numbers(got).iter().zip(numbers(want)).all(|(a, b)| a.abs_diff(b) <= 1)
}

fn near(got: &[f64], want: &[f64]) -> bool {
    got.iter().zip(want).all(|(g, w)| (g - w).abs() <= 2e-6 * w.abs().max(1.0))
}

/// A file that must not be read, and words that its error has.
fn refused(folder: &Path, name: &str, words: &[&str]) -> Result<(), String> {
    let read = brickcast_formats::open(&folder.join(name), &RawHints::default())
        .and_then(|mut source| source.read_planes(u32::MAX, &mut Vec::new()));
    let error = match read {
        Ok(()) => return Err(format!("it was read, but {words:?} is wanted")),
        Err(error) => error.to_string(),
    };
    let file = name.split(":/").next().unwrap_or_default();
    match words.iter().chain([&file]).find(|words| !error.contains(**words)) {
        Some(words) => Err(format!("no `{words}` in: {error}")),
        None => Ok(()),
    }
}

fn check(folder: &Path, line: &str) -> Result<(), String> {
    let cells: Vec<&str> = line.split('\t').collect();
    if cells.len() < 9 {
        return refused(folder, cells[0], &cells[1..]);
    }
    let &[name, raw, voxel_type, dims, vectors, origin, unit, rescale, chosen] = &cells[..] else { panic!("{line}") };
    let chosen: Option<Vec<u64>> = numbers(chosen);
    let hints = RawHints {
        channel: chosen.as_ref().map(|c| c[0]).filter(|c| *c > 0),
        time: chosen.as_ref().map(|c| c[1]).filter(|t| *t > 0),
        ..RawHints::default()
    };
    let mut source = brickcast_formats::open(&folder.join(name), &hints).map_err(|e| e.to_string())?;
    let header = source.header().clone();
    let geometry = header.geometry;
    let is = |what: bool, message: String| what.then_some(()).ok_or(message);
    is(header.voxel_type.name() == voxel_type, format!("type {}", header.voxel_type))?;
    is(geometry.dims().to_array()[..] == numbers::<u32>(dims).unwrap()[..], format!("dims {}", geometry.dims()))?;
    let axes = geometry.directions() * glam::DMat3::from_diagonal(geometry.spacing());
    let (axes, at) = (axes.to_cols_array(), geometry.origin().to_array());
    let want: Option<Vec<f64>> = numbers(vectors);
    is(want.as_ref().is_none_or(|want| near(&axes, want)), format!("axes {axes:?}, wanted {want:?}"))?;
    // Mirrors and permutations are exact.
    if want.as_ref().is_some_and(|want| want.iter().filter(|n| n.abs() > 1e-12).count() == 3) {
        let exact = geometry.directions().to_cols_array().iter().all(|n| [0.0, 1.0, -1.0].contains(n));
        is(exact, format!("directions {}", geometry.directions()))?;
    }
    let want: Option<Vec<f64>> = numbers(origin);
    is(want.as_ref().is_none_or(|want| near(&at, want)), format!("origin {at:?}, wanted {want:?}"))?;
    is(unit == "-" || header.space_unit.as_deref() == Some(unit), format!("unit {:?}", header.space_unit))?;
    let want: Vec<f64> = numbers(rescale).unwrap();
    let (slope, intercept) = header.rescale.after(1.0, 0.0);
    is(near(&[slope, intercept], &want), format!("rescale {slope} {intercept}, wanted {want:?}"))?;
    is(!source.files().is_empty() && source.files().iter().all(|f| f.is_file()), format!("{:?}", source.files()))?;
    read(source.as_mut(), &std::fs::read(folder.join(raw)).unwrap(), raw.starts_with("near"))
}

/// Runs a script behind the phantom's, and checks each line of its table.
fn check_written(script: &str, modules: &str, least: usize) {
    let probe = Command::new("python3").args(["-c", &format!("import {modules}")]).output();
    if !probe.is_ok_and(|probe| probe.status.success()) {
        brickcast_harness::ignore(format!("python3 with {modules} is missing: see install_formats in .ci/run"));
    }
    let kept = std::env::var_os("BRICKCAST_INTEROP_FILES");
    let folder = tempfile::tempdir().unwrap();
    let folder = kept.as_deref().map_or(folder.path(), Path::new);
    if kept.is_none() {
        let script = [include_str!("phantom.py"), script].concat();
        let output = Command::new("python3").args(["-W", "ignore", "-c", &script]).arg(folder).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let table = std::fs::read_to_string(folder.join("table.tsv")).unwrap();
    assert!(table.lines().count() >= least, "the writer left rows out: {} are there", table.lines().count());
    let mut failures = Vec::new();
    for line in table.lines() {
        if let Err(why) = check(folder, line) {
            failures.push(format!("{}: {why}", line.split('\t').next().unwrap_or_default()));
        }
    }
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), table.lines().count(), failures.join("\n"));
}

#[test]
fn what_other_programs_write_is_read_voxel_by_voxel_and_in_its_place() {
    let modules = "h5py, hdf5plugin, imagecodecs, nibabel, nrrd, numpy, SimpleITK, tifffile, vtkmodules";
    check_written(WRITER, modules, 1100);
}

#[test]
fn dicom_of_other_programs_is_read_voxel_by_voxel_and_in_its_place() {
    check_written(include_str!("dicom.py"), "imagecodecs, numpy, openjpeg, pydicom, SimpleITK", 350);
}

#[test]
fn files_that_packages_carry_are_read_as_their_own_readers_read_them() {
    check_written(include_str!("real.py"), "nibabel, numpy, openjpeg, pydicom, SimpleITK, skimage, tifffile", 115);
}
