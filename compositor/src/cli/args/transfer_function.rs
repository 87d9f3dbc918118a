//! The arguments of `brickcast transfer-function`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::raw::RawArgs;
use super::values::pair;

#[derive(Debug, Args)]
pub struct TransferFunctionArgs {
    #[command(subcommand)]
    pub command: TransferFunctionCommand,
}

#[derive(Debug, Subcommand)]
pub enum TransferFunctionCommand {
    /// Draw opacity over value with its colours, as text and as a picture
    Show(ShowArgs),
    /// Turn a transfer function into a ParaView preset
    Convert(ConvertArgs),
    /// Make a transfer function from a volume's histogram, by multi-level Otsu thresholding
    Suggest(SuggestArgs),
}

#[derive(Debug, Args)]
pub struct ShowArgs {
    /// ParaView preset (JSON or XML), or 3D Slicer volume property (.vp)
    pub file: PathBuf,
    /// Draw this volume's histogram behind it: a store or an input
    #[arg(long, value_name = "PATH", visible_alias = "store")]
    pub volume: Option<PathBuf>,
    /// The picture (.png)
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Which preset of a file that holds several: its name, or #3 for the third [default: the first]
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Rescale the function to this range of data values
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    pub transfer_function_range: Option<[f64; 2]>,
    #[command(flatten)]
    pub raw: RawArgs,
}

#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// ParaView preset (JSON or XML), or 3D Slicer volume property (.vp)
    pub input: PathBuf,
    /// The ParaView preset (.json) to write
    pub output: PathBuf,
    /// Which preset of a file that holds several: its name, or #3 for the third [default: the first]
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Rescale the function to this range of data values
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    pub transfer_function_range: Option<[f64; 2]>,
    /// Replace an existing file
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct SuggestArgs {
    /// A store or an input volume
    pub volume: PathBuf,
    /// The ParaView preset (.json) to write
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// viridis, plasma, inferno, magma, cividis, turbo, grayscale or cool-to-warm
    #[arg(long, value_name = "NAME", default_value = "viridis")]
    pub colormap: String,
    /// How many classes of values to tell apart, 2 to 5 [default: as many as explain 95 % of the variance]
    #[arg(long, value_name = "N")]
    pub classes: Option<usize>,
    /// Replace an existing file
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub raw: RawArgs,
}
