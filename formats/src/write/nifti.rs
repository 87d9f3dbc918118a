//! NIfTI-1, and NIfTI-2 where an axis is too long for it; one file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use brickcast_volume::format::VoxelType;
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use super::out::{Header, Voxels, WriteError, failed, finish, note_place};

/// Quick, and near to the best for voxels with noise.
const LEVEL: u32 = 4;

pub(super) fn write(
    header: &mut Header<'_>,
    voxels: &mut Voxels<'_>,
    (mut out, path): (BufWriter<File>, &Path),
    is_packed: bool,
) -> Result<&'static str, WriteError> {
    let unit = match header.of.space_unit.as_deref() {
        Some("m") => 1,
        Some("mm") => 2,
        Some("um") => 3,
        _ => 0,
    };
    note_place(header, "NIfTI", (true, true, unit != 0));
    let is_long = header.dims().iter().any(|n| *n > i16::MAX as u32);
    let head = if is_long { two(header, unit) } else { one(header, unit) };
    if is_packed {
        let mut packed = GzEncoder::new(out, Compression::new(LEVEL));
        packed.write_all(&head).map_err(failed(path))?;
        voxels.copy(&mut packed, path)?;
        out = packed.finish().map_err(failed(path))?;
    } else {
        out.write_all(&head).map_err(failed(path))?;
        voxels.copy(&mut out, path)?;
    }
    finish(out, path)?;
    Ok(if is_long { "NIfTI-2" } else { "NIfTI-1" })
}

fn code(voxel_type: VoxelType) -> i16 {
    match voxel_type {
        VoxelType::U8 => 2,
        VoxelType::I16 => 4,
        VoxelType::I32 => 8,
        VoxelType::F32 => 16,
        VoxelType::F64 => 64,
        VoxelType::I8 => 256,
        VoxelType::U16 => 512,
        VoxelType::U32 => 768,
        VoxelType::I64 => 1024,
        VoxelType::U64 => 1280,
    }
}

/// Rows of the sform: to the right, to the front and up, as NIfTI has it.
fn rows(header: &Header<'_>) -> [[f64; 4]; 3] {
    let g = header.of.geometry;
    let ras = |v: DVec3| v * DVec3::new(-1.0, -1.0, 1.0) + 0.0;
    let (axes, s) = (g.directions(), g.spacing());
    let columns = [axes.x_axis * s.x, axes.y_axis * s.y, axes.z_axis * s.z, g.origin()].map(ras);
    [0, 1, 2].map(|row| columns.map(|column| column[row]))
}

fn slope(header: &Header<'_>) -> [f64; 2] {
    let intercept = header.rescale.value(0.0);
    [header.rescale.value(1.0) - intercept, intercept]
}

struct Bytes(Vec<u8>);

impl Bytes {
    fn put<const N: usize>(&mut self, at: usize, bytes: [u8; N]) {
        self.0[at..at + N].copy_from_slice(&bytes);
    }
}

fn one(header: &Header<'_>, unit: u8) -> Vec<u8> {
    let mut b = Bytes(vec![0; 352]);
    b.put(0, 348i32.to_le_bytes());
    let dims = header.dims().map(|n| n as i16);
    for (i, n) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        b.put(40 + 2 * i, n.to_le_bytes());
    }
    b.put(70, code(header.voxel_type).to_le_bytes());
    b.put(72, (8 * header.voxel_type.bytes() as i16).to_le_bytes());
    let s = header.of.geometry.spacing();
    for (i, v) in [1.0, s.x, s.y, s.z, 1.0, 1.0, 1.0, 1.0].into_iter().enumerate() {
        b.put(76 + 4 * i, (v as f32).to_le_bytes());
    }
    b.put(108, 352f32.to_le_bytes());
    for (i, v) in slope(header).into_iter().enumerate() {
        b.put(112 + 4 * i, (v as f32).to_le_bytes());
    }
    b.put(123, [unit]);
    b.put(254, 1i16.to_le_bytes());
    for (i, v) in rows(header).into_iter().flatten().enumerate() {
        b.put(280 + 4 * i, (v as f32).to_le_bytes());
    }
    b.put(344, *b"n+1\0");
    b.0
}

fn two(header: &Header<'_>, unit: u8) -> Vec<u8> {
    let mut b = Bytes(vec![0; 544]);
    b.put(0, 540i32.to_le_bytes());
    b.put(4, *b"n+2\0\r\n\x1a\n");
    b.put(12, code(header.voxel_type).to_le_bytes());
    b.put(14, (8 * header.voxel_type.bytes() as i16).to_le_bytes());
    let dims = header.dims().map(i64::from);
    for (i, n) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        b.put(16 + 8 * i, n.to_le_bytes());
    }
    let s = header.of.geometry.spacing();
    for (i, v) in [1.0, s.x, s.y, s.z, 1.0, 1.0, 1.0, 1.0].into_iter().enumerate() {
        b.put(104 + 8 * i, v.to_le_bytes());
    }
    b.put(168, 544i64.to_le_bytes());
    for (i, v) in slope(header).into_iter().enumerate() {
        b.put(176 + 8 * i, v.to_le_bytes());
    }
    b.put(348, 1i32.to_le_bytes());
    for (i, v) in rows(header).into_iter().flatten().enumerate() {
        b.put(400 + 8 * i, v.to_le_bytes());
    }
    b.put(500, i32::from(unit).to_le_bytes());
    b.0
}
