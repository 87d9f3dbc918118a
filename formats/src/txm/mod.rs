//! Zeiss (Xradia) .txm: a compound file with a stream a slice, after the names that dxchange and others read. From the
//! description alone: no file of the instrument was at hand.

mod compound;

use std::path::PathBuf;

use brickcast_volume::format::{FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType};

use crate::input::Input;
use crate::slices::{SliceSource, Slices};
use crate::space::{Place, noted};
use crate::wrong::{EXPORT_AGAIN, Wrong};
use compound::{Compound, Stream};

pub(crate) use compound::has_magic;

const FORMAT: &str = "Zeiss TXM";
/// More planes no volume has.
const MOST_IMAGES: u32 = 1 << 20;
/// Images are put into folders of so many.
const A_FOLDER: u32 = 100;

#[derive(Debug)]
struct Txm {
    path: PathBuf,
    compound: Compound,
    images: Vec<Stream>,
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path;
    let (header, txm) = opened(path.clone()).map_err(|wrong| wrong.of(&path, FORMAT))?;
    let header = noted(header, hints, false);
    Ok(Box::new(SliceSource::new(header, vec![path], txm)))
}

fn opened(path: PathBuf) -> Result<(SourceHeader, Txm), Wrong> {
    let compound = Compound::open(&path)?;
    let field = |name: &str| -> Result<Option<[u8; 4]>, Wrong> {
        let Some(stream) = compound.stream(&format!("ImageInfo/{name}")) else { return Ok(None) };
        Ok(compound.read(&path, stream, 4)?.try_into().ok())
    };
    let number = |name: &str| -> Result<u32, Wrong> {
        let missing = || {
            let why = "it is not there: no file of a Zeiss microscope, or of another version";
            Wrong::new(format!("ImageInfo/{name}"), why, "export it as TIFF slices")
        };
        field(name)?.map(u32::from_le_bytes).ok_or_else(missing)
    };
    let (width, height, count) = (number("ImageWidth")?, number("ImageHeight")?, number("NoOfImages")?);
    let voxel_type = match number("DataType")? {
        5 => VoxelType::U16,
        10 => VoxelType::F32,
        other => {
            let why = format!("{other}; read are 5 (uint16) and 10 (float32)");
            return Err(Wrong::new("ImageInfo/DataType", why, "export it as TIFF slices"));
        }
    };
    if !(1..=MOST_IMAGES).contains(&count) {
        return Err(Wrong::broken("ImageInfo/NoOfImages", count));
    }
    let mut notes = Vec::new();
    let spacing = field("PixelSize")?.map(|bytes| f64::from(f32::from_le_bytes(bytes))).filter(|size| *size > 0.0);
    let said = Placement { spacing: spacing.is_some(), ..Placement::default() };
    let place = Place::straight([spacing.unwrap_or(1.0); 3], [0.0; 3], said);
    let is_projections = path.extension().is_some_and(|e| ["txrm", "xrm"].iter().any(|p| e.eq_ignore_ascii_case(p)));
    if is_projections {
        notes.push("a .txrm holds projections, not slices: reconstruct them, and give the .txm".into());
    }
    let geometry = place.geometry([width, height, count], &mut notes)?;
    let plane = u64::from(width) * u64::from(height) * voxel_type.bytes() as u64;
    let mut images = Vec::new();
    for image in 1..=count {
        let name = format!("ImageData{}/Image{image}", image.div_ceil(A_FOLDER));
        let stream = compound.stream(&name).ok_or_else(|| Wrong::broken(&name, "it is not there"))?;
        if stream.bytes != plane {
            let why = format!("{} bytes instead of {plane}, for {width} x {height} of {voxel_type}", stream.bytes);
            return Err(Wrong::new(name, why, EXPORT_AGAIN));
        }
        images.push(stream);
    }
    let header = SourceHeader {
        placement: said,
        space_unit: said.spacing.then(|| "um".into()),
        notes,
        ..SourceHeader::new(FORMAT, geometry, voxel_type)
    };
    Ok((header, Txm { path, compound, images }))
}

impl Slices for Txm {
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError> {
        let stream = self.images[z as usize];
        self.compound.read(&self.path, stream, stream.bytes).map_err(|wrong| wrong.of(&self.path, FORMAT))
    }
}
