//! The table of pores beside a phantom, JSON.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::{PhantomOptions, Pore, SPACING_MM};
use crate::space::Geometry;

#[derive(Serialize)]
struct Table {
    format: &'static str,
    version: u32,
    /// File name of the volume.
    volume: String,
    dims: [u32; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    unit: &'static str,
    index_space: &'static str,
    seed: u64,
    noise_percent: f64,
    pores: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    id: u32,
    center_world: [f64; 3],
    center_index: [f64; 3],
    radii_world: [f64; 3],
    radii_voxels: [f64; 3],
    volume_world: f64,
    volume_voxels: f64,
}

pub(super) fn write(
    out: &mut dyn Write,
    volume: &Path,
    geometry: &Geometry,
    options: &PhantomOptions,
    pores: &[Pore],
) -> io::Result<()> {
    let row = |(id, pore): (usize, &Pore)| Row {
        id: id as u32,
        center_world: geometry.world_from_voxel(pore.center_voxel).to_array(),
        center_index: pore.center_voxel.to_array(),
        radii_world: (pore.radii_voxel * DVec3::splat(SPACING_MM)).to_array(),
        radii_voxels: pore.radii_voxel.to_array(),
        volume_world: pore.volume_voxels() * SPACING_MM.powi(3),
        volume_voxels: pore.volume_voxels(),
    };
    let table = Table {
        format: "brickcast pores",
        version: 1,
        volume: volume.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        dims: options.dims,
        spacing: geometry.spacing().to_array(),
        origin: geometry.origin().to_array(),
        unit: "mm",
        index_space: "voxel i covers [i, i + 1), its centre is i + 0.5; world = (index - 0.5) * spacing + origin",
        seed: options.seed,
        noise_percent: options.noise,
        pores: pores.iter().enumerate().map(row).collect(),
    };
    serde_json::to_writer_pretty(&mut *out, &table).map_err(io::Error::other)?;
    out.write_all(b"\n")
}
