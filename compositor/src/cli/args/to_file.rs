//! What is written out as a file.

use std::path::PathBuf;

use brickcast_volume::format::Crop;
use clap::Args;

use super::raw::RawArgs;

#[derive(Debug, Args)]
pub struct ToFileArgs {
    /// A store, or an input of any format
    #[arg(value_name = "STORE")]
    pub input: PathBuf,
    /// The file to write; its name says the format: .nrrd, .tif, .mhd, .mha, .nii, .nii.gz, .npy
    pub out: PathBuf,
    /// Which level of a store, 0 the finest [default: 0]
    #[arg(long, value_name = "N")]
    pub level: Option<u8>,
    /// Of a store, its regions as labels 1, 2, ... instead of the voxels
    #[arg(long)]
    pub labels: bool,
    /// Only these voxels (of the level), from 0 and half-open: X0:X1,Y0:Y1,Z0:Z1, ends left out, as in :,:,100:200
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    pub crop: Option<Crop>,
    /// Replace an existing file
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub raw: RawArgs,
}
