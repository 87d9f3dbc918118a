//! Animations that end before all their frames are there.

use std::path::PathBuf;

use super::animation::ApngCutter;
use super::error::OutputError;
use super::film::FilmCutter;
use super::gif::GifCutter;

/// Ends an animation in the making with the frames that it has.
#[derive(Debug, Clone)]
pub(super) enum Cutter {
    Apng(ApngCutter),
    Gif(GifCutter),
    Film(FilmCutter),
}

impl Cutter {
    /// Its path and number of frames; nothing where it has none, or is finished. Where a file has its name already,
    /// that stays, and the animation is `x.partial.apng`. With `park`, whoever makes it waits from now on for the end
    /// of the process.
    pub(super) fn cut(&self, park: bool) -> Result<Option<(PathBuf, u32)>, OutputError> {
        match self {
            Self::Apng(cutter) => cutter.cut(park),
            Self::Gif(cutter) => cutter.cut(park),
            Self::Film(cutter) => cutter.cut(park),
        }
    }
}
