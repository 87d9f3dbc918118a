//! How a raw file is read, and which volume of an image.

use anyhow::anyhow;
use brickcast_volume::format::RawHints;
use clap::Args;

use super::axes::{AxesWord, axes};
use super::time::TimeChoice;
use super::values::triple;
use crate::cli::failure::Failure;

/// How to read a raw file; other formats say it themselves. Where a volume lies, which overrules any file. Which volume
/// of an image that holds several.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Input")]
pub struct RawArgs {
    /// Voxels per axis of a raw file, x fastest
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<u32>)]
    pub dims: Option<[u32; 3]>,
    /// Voxel type of a raw file: uint8, int8, uint16, int16, uint32, int32, float32, uint64, int64, float64
    #[arg(long = "type", value_name = "TYPE")]
    pub voxel_type: Option<String>,
    /// Byte order of a raw file: little or big
    #[arg(long, value_name = "ORDER")]
    pub endian: Option<String>,
    /// Bytes to skip at the start of a raw file
    #[arg(long, value_name = "BYTES", default_value_t = 0)]
    pub skip: u64,
    /// World units per voxel; overrules the file
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    pub spacing: Option<[f64; 3]>,
    /// Where the centre of the first voxel lies in the world; overrules the file
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    pub origin: Option<[f64; 3]>,
    /// Where the voxels' axes point in the world, such as x,-y,z or RAS, or nine numbers; overrules the file
    #[arg(long, value_name = "AXES", value_parser = axes, allow_hyphen_values = true)]
    pub axes: Option<AxesWord>,
    /// Fill slices of a stack that are missing or broken, and say which; else they are refused
    #[arg(long)]
    pub skip_broken: bool,
    /// A voxel of this value holds no data and shows nothing, in files of any format; NaN never does
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    pub no_data: Option<f64>,
    /// Channel of an OME-Zarr image that has several, counted from 0 [default: 0]
    #[arg(long, value_name = "N")]
    pub channel: Option<u64>,
    /// Step of a series or time of an OME-Zarr image, counted from 0; A..B with both ends, or all [default: 0]
    #[arg(long, value_name = "T")]
    pub time: Option<TimeChoice>,
}

impl RawArgs {
    /// The flags as hints for the raw reader.
    ///
    /// # Errors
    /// Usage: an unknown type or byte order.
    pub fn hints(&self) -> Result<RawHints, Failure> {
        let voxel_type = self.voxel_type.as_deref().map(str::parse).transpose().map_err(Failure::usage)?;
        let endian = self.endian.as_deref().map(str::parse).transpose().map_err(Failure::usage)?;
        let (skip, spacing, no_data) = (self.skip, self.spacing, self.no_data);
        let channel = self.channel;
        let time = match self.time {
            None => None,
            Some(TimeChoice::One(time)) => Some(time),
            Some(several) => {
                let why = "a volume is of one point in time; brickcast prepare INPUT SERIES makes a series of several, \
                           which render shows as a sequence";
                return Err(Failure::usage(anyhow!("--time {several}: {why}")));
            }
        };
        Ok(RawHints {
            dims: self.dims,
            voxel_type,
            endian,
            skip,
            spacing,
            origin: self.origin,
            no_data,
            channel,
            time,
            axes: self.axes.map(|axes| axes.0),
            crop: None,
            skip_broken: self.skip_broken,
        })
    }
}
