//! NumPy's `.npy`, axes z, y, x in C's order.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use brickcast_volume::format::VoxelType;

use super::out::{Header, Voxels, WriteError, failed, finish, note_place};

/// Voxels begin at a multiple of so many bytes.
const ALIGNED: usize = 64;

pub(super) fn write(
    header: &mut Header<'_>,
    voxels: &mut Voxels<'_>,
    (mut out, path): (BufWriter<File>, &Path),
) -> Result<&'static str, WriteError> {
    note_place(header, "NumPy's .npy", (false, false, false));
    let s = header.of.geometry.spacing();
    if s != glam::DVec3::ONE {
        header.notes.push(format!("NumPy's .npy has no place for the spacing {}, {}, {}", s.x, s.y, s.z));
    }
    let [x, y, z] = header.dims();
    let kind = match header.voxel_type {
        VoxelType::U8 => "|u1",
        VoxelType::I8 => "|i1",
        VoxelType::U16 => "<u2",
        VoxelType::I16 => "<i2",
        VoxelType::U32 => "<u4",
        VoxelType::I32 => "<i4",
        VoxelType::F32 => "<f4",
        VoxelType::U64 => "<u8",
        VoxelType::I64 => "<i8",
        VoxelType::F64 => "<f8",
    };
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({z}, {y}, {x}), }}");
    let before = b"\x93NUMPY\x01\x00".len() + 2;
    let end = (before + text.len() + 1).next_multiple_of(ALIGNED);
    text.extend(std::iter::repeat_n(' ', end - before - text.len() - 1));
    text.push('\n');
    let length = u16::try_from(text.len()).unwrap_or(u16::MAX).to_le_bytes();
    let head = [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes()].concat();
    out.write_all(&head).map_err(failed(path))?;
    voxels.copy(&mut out, path)?;
    finish(out, path)?;
    Ok("NumPy")
}
