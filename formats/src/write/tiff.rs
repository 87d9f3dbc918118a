//! TIFF of many pages, its spacing as ImageJ has it; BigTIFF from 4 GiB on.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use brickcast_volume::format::VoxelType;
use bytemuck::{Pod, Zeroable as _};
use tiff::TiffError;
use tiff::encoder::colortype::{
    ColorType, Gray8, Gray16, Gray32, Gray32Float, Gray64, Gray64Float, GrayI8, GrayI16, GrayI32, GrayI64,
};
use tiff::encoder::{Rational, TiffEncoder, TiffKind, TiffKindBig, TiffKindStandard, TiffValue};
use tiff::tags::{ResolutionUnit, Tag};

use super::out::{Header, Voxels, WriteError, finish, note_place};
use super::rational::rational;

/// Offsets of classic TIFF end at 4 GiB; directories need some of it.
const CLASSIC: u64 = (4 << 30) - (64 << 20);
/// Bytes of a strip, but a row at least.
const STRIP: usize = 1 << 20;

pub(super) fn write(
    header: &mut Header<'_>,
    voxels: &mut Voxels<'_>,
    (out, path): (BufWriter<File>, &Path),
) -> Result<&'static str, WriteError> {
    // ImageJ has an origin on straight axes.
    note_place(header, "TIFF", (header.of.geometry.is_straight(), false, true));
    let is_big = header.voxel_bytes() >= CLASSIC;
    let out = match is_big {
        true => in_kind::<TiffKindBig>(header, voxels, (out, path)),
        false => in_kind::<TiffKindStandard>(header, voxels, (out, path)),
    }?;
    finish(out, path)?;
    Ok(if is_big { "BigTIFF" } else { "TIFF" })
}

fn in_kind<K: TiffKind>(
    header: &Header<'_>,
    voxels: &mut Voxels<'_>,
    out: (BufWriter<File>, &Path),
) -> Result<BufWriter<File>, WriteError> {
    match header.voxel_type {
        VoxelType::U8 => pages::<Gray8, K>(header, voxels, out),
        VoxelType::I8 => pages::<GrayI8, K>(header, voxels, out),
        VoxelType::U16 => pages::<Gray16, K>(header, voxels, out),
        VoxelType::I16 => pages::<GrayI16, K>(header, voxels, out),
        VoxelType::U32 => pages::<Gray32, K>(header, voxels, out),
        VoxelType::I32 => pages::<GrayI32, K>(header, voxels, out),
        VoxelType::F32 => pages::<Gray32Float, K>(header, voxels, out),
        VoxelType::U64 => pages::<Gray64, K>(header, voxels, out),
        VoxelType::I64 => pages::<GrayI64, K>(header, voxels, out),
        VoxelType::F64 => pages::<Gray64Float, K>(header, voxels, out),
    }
}

/// As ImageJ writes it: numbers of pages, the distance of slices, the unit of all lengths.
fn description(header: &Header<'_>) -> String {
    let unit = match header.of.space_unit.as_deref() {
        Some("um") => "micron",
        Some(unit) => unit,
        None => "pixel",
    };
    let (z, s) = (header.dims()[2], header.of.geometry.spacing());
    let unit: String = unit.chars().filter(|c| c.is_ascii() && !c.is_control()).collect();
    let mut text = format!("ImageJ=1.54f\nimages={z}\nslices={z}\nunit={unit}\nspacing={}\nloop=false\n", s.z);
    let origin = header.of.geometry.origin();
    if header.of.geometry.is_straight() && origin != glam::DVec3::ZERO {
        let [x, y, z] = (-origin / s).to_array();
        text += &format!("xorigin={x}\nyorigin={y}\nzorigin={z}\n");
    }
    text
}

fn pages<C, K>(
    header: &Header<'_>,
    voxels: &mut Voxels<'_>,
    (mut out, path): (BufWriter<File>, &Path),
) -> Result<BufWriter<File>, WriteError>
where
    C: ColorType,
    C::Inner: Pod,
    [C::Inner]: TiffValue,
    K: TiffKind,
{
    let failed = |error: TiffError| {
        let reason = match error {
            TiffError::IoError(reason) => reason,
            error => io::Error::other(error),
        };
        WriteError::Io { path: path.into(), reason }
    };
    let [x, y, z] = header.dims();
    let row = x as usize * header.voxel_type.bytes();
    let rows = (STRIP / row).clamp(1, y as usize);
    let s = header.of.geometry.spacing();
    let resolution = |spacing: f64| {
        let (n, d) = rational(1.0 / spacing);
        Rational { n, d }
    };
    let mut encoder: TiffEncoder<&mut BufWriter<File>, K> = TiffEncoder::new_generic(&mut out).map_err(failed)?;
    let mut strip = vec![C::Inner::zeroed(); rows * x as usize];
    for page in 0..z {
        let mut image = encoder.new_image::<C>(x, y).map_err(failed)?;
        image.rows_per_strip(rows as u32).map_err(failed)?;
        image.resolution_unit(ResolutionUnit::None);
        image.x_resolution(resolution(s.x));
        image.y_resolution(resolution(s.y));
        if page == 0 {
            image.encoder().write_tag(Tag::ImageDescription, description(header).as_str()).map_err(failed)?;
        }
        for first in (0..y as usize).step_by(rows) {
            let strip = &mut strip[..rows.min(y as usize - first) * x as usize];
            fill(voxels, bytemuck::cast_slice_mut(strip))?;
            if cfg!(target_endian = "big") {
                let bytes: &mut [u8] = bytemuck::cast_slice_mut(strip);
                bytes.chunks_exact_mut(header.voxel_type.bytes()).for_each(<[u8]>::reverse);
            }
            image.write_strip(strip).map_err(failed)?;
        }
        image.finish().map_err(failed)?;
    }
    Ok(out)
}

/// Fills `strip` with the next voxels.
fn fill(voxels: &mut Voxels<'_>, strip: &mut [u8]) -> Result<(), WriteError> {
    let (mut done, mut piece) = (0, Vec::new());
    while done < strip.len() {
        voxels.next(strip.len() - done, &mut piece)?;
        if piece.is_empty() {
            break;
        }
        strip[done..done + piece.len()].copy_from_slice(&piece);
        done += piece.len();
    }
    Ok(())
}
