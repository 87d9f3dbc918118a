//! Looks by name.

use brickcast_volume::scene::Filter;
use brickcast_volume::style::Mode;
use clap::{Args, ValueEnum};

/// What a volume looks like where no transfer function, light or mode is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, ValueEnum)]
pub enum LookArg {
    /// Materials by the histogram, a colour each, lit: what is drawn without any of these flags
    Part,
    /// The same materials as glass: borders and pores inside show
    Scan,
    /// The largest value of each ray
    Mip,
    /// The mean of each ray
    Xray,
}

#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Look")]
pub struct LookArgs {
    /// How it looks, by the histogram [default: part]
    ///
    /// The default holds where no flag says what shows or how; all numbers are told.
    #[arg(long, value_enum, value_name = "NAME")]
    #[arg(conflicts_with_all = ["transfer_function", "window", "opacity", "colormap", "isosurface", "mode"])]
    pub look: Option<LookArg>,
}

/// Whether what was not asked for may be chosen from the histogram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unasked {
    /// The default look.
    Chosen,
    /// The plain function of docs/definition.md, without light: audits, and tables of papers.
    Plain,
}

impl LookArg {
    /// What a pixel shows of its ray.
    pub(crate) fn mode(self) -> Mode {
        match self {
            Self::Part | Self::Scan => Mode::Composite,
            Self::Mip => Mode::Maximum,
            Self::Xray => Mode::Average,
        }
    }

    /// True where it is lit, unless `filter` knows no gradients.
    pub(crate) fn is_lit(self, filter: Filter) -> bool {
        matches!(self, Self::Part | Self::Scan) && filter != Filter::Nearest
    }
}
