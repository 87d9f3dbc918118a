//! Writes the header of an attached NRRD file; the raw voxels follow.

use std::io::{self, Write};

use crate::format::voxel_type::VoxelType;
use crate::space::Geometry;

/// The header of an attached NRRD file of raw little-endian voxels, which follow it x fastest. `unit` is of spacing and
/// origin; each comment is one line (line feeds become spaces).
///
/// # Errors
/// What `out` reports.
pub fn write_header(
    out: &mut dyn Write,
    geometry: &Geometry,
    voxel_type: VoxelType,
    unit: Option<&str>,
    comments: &[String],
) -> io::Result<()> {
    let (d, s, o) = (geometry.dims(), geometry.spacing(), geometry.origin());
    let one_line = |text: &str| text.replace(['\n', '\r'], " ");
    writeln!(out, "NRRD0004")?;
    for comment in comments {
        writeln!(out, "# {}", one_line(comment))?;
    }
    let type_name = match voxel_type {
        VoxelType::F32 => "float",
        VoxelType::F64 => "double",
        other => other.name(),
    };
    writeln!(out, "type: {type_name}")?;
    writeln!(out, "dimension: 3\nspace dimension: 3\nsizes: {} {} {}", d.x, d.y, d.z)?;
    if geometry.is_straight() {
        writeln!(out, "space directions: ({},0,0) (0,{},0) (0,0,{})", s.x, s.y, s.z)?;
    } else {
        let r = geometry.directions();
        let axes = [r.x_axis * s.x, r.y_axis * s.y, r.z_axis * s.z].map(|v| format!("({},{},{})", v.x, v.y, v.z));
        writeln!(out, "space directions: {}", axes.join(" "))?;
    }
    writeln!(out, "space origin: ({},{},{})", o.x, o.y, o.z)?;
    if let Some(unit) = unit {
        let unit = one_line(unit).replace('"', "'");
        writeln!(out, "space units: \"{unit}\" \"{unit}\" \"{unit}\"")?;
    }
    writeln!(out, "endian: little\nencoding: raw\n")
}

/// The key that declares a fill value, which stands before the header's last, empty line.
///
/// # Errors
/// What `out` reports.
pub fn write_no_data(out: &mut dyn Write, value: f64) -> io::Result<()> {
    writeln!(out, "no_data:={value}")
}
