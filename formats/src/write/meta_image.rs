//! MetaImage: the voxels in the same file, or in a raw one beside it.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use brickcast_volume::format::VoxelType;
use glam::DVec3;

use super::out::{Header, Voxels, WriteError, failed, finish, note_place};

pub(super) fn write(
    header: &mut Header<'_>,
    voxels: &mut Voxels<'_>,
    (mut out, path): (BufWriter<File>, &Path),
    beside: Option<(BufWriter<File>, &Path)>,
) -> Result<&'static str, WriteError> {
    note_place(header, "MetaImage", (true, true, header.of.space_unit.as_deref() == Some("mm")));
    let g = header.of.geometry;
    let [x, y, z] = header.dims();
    let kind = match header.voxel_type {
        VoxelType::U8 => "MET_UCHAR",
        VoxelType::I8 => "MET_CHAR",
        VoxelType::U16 => "MET_USHORT",
        VoxelType::I16 => "MET_SHORT",
        VoxelType::U32 => "MET_UINT",
        VoxelType::I32 => "MET_INT",
        VoxelType::F32 => "MET_FLOAT",
        VoxelType::U64 => "MET_ULONG_LONG",
        VoxelType::I64 => "MET_LONG_LONG",
        VoxelType::F64 => "MET_DOUBLE",
    };
    let three = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
    let axes = g.directions();
    let axes = [axes.x_axis, axes.y_axis, axes.z_axis].map(three).join(" ");
    let file = match &beside {
        None => "LOCAL".to_owned(),
        Some((_, path)) => path.file_name().and_then(|name| name.to_str()).unwrap_or("LOCAL").to_owned(),
    };
    let text = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
         TransformMatrix = {axes}\nOffset = {}\nCenterOfRotation = 0 0 0\nElementSpacing = {}\nDimSize = {x} {y} {z}\n\
         ElementType = {kind}\nElementDataFile = {file}\n",
        three(g.origin()),
        three(g.spacing()),
    );
    out.write_all(text.as_bytes()).map_err(failed(path))?;
    match beside {
        None => voxels.copy(&mut out, path)?,
        Some((mut file, path)) => {
            voxels.copy(&mut file, path)?;
            finish(file, path)?;
        }
    }
    finish(out, path)?;
    Ok("MetaImage")
}
