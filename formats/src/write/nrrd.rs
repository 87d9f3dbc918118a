//! Attached NRRD.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use brickcast_volume::format::nrrd::{write_header, write_no_data};

use super::out::{Header, Voxels, WriteError, failed, finish, note_place};

pub(super) fn write(
    header: &mut Header<'_>,
    voxels: &mut Voxels<'_>,
    (mut out, path): (BufWriter<File>, &Path),
) -> Result<&'static str, WriteError> {
    note_place(header, "NRRD", (true, true, true));
    let unit = header.of.space_unit.as_deref();
    let mut text = Vec::new();
    write_header(&mut text, &header.of.geometry, header.voxel_type, unit, &[]).map_err(failed(path))?;
    // Key and value pairs stand before the empty line that ends the header.
    text.pop();
    for number in &header.of.no_data {
        write_no_data(&mut text, header.of.rescale.value(*number)).map_err(failed(path))?;
    }
    text.push(b'\n');
    out.write_all(&text).map_err(failed(path))?;
    voxels.copy(&mut out, path)?;
    finish(out, path)?;
    Ok("NRRD")
}
