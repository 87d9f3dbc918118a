//! Levels of detail: which of a volume's levels is drawn.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::lod::{Criterion, Lod, Rule};
use clap::Args;
use glam::DVec3;

use super::values::{deadline, triple, word};
use crate::cli::failure::Failure;

/// Pixels that a voxel may be seen at where nothing was said.
const DEFAULT_PIXEL_ERROR: f64 = 1.0;

/// A word of `--lod`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LodArg {
    Full,
    Auto,
    Level(u8),
}

/// Which of the volume's levels is drawn.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Level of detail")]
pub struct LodArgs {
    /// Draw the volume itself (full), one of its coarser levels (1, 2, ...), or of each part what is fine enough (auto)
    ///
    /// Each level has half as many voxels per axis; prepare makes them. With auto, exit code 4 says that something in
    /// view was drawn coarser than it is.
    #[arg(long, value_name = "full|auto|LEVEL", value_parser = lod, default_value = "full")]
    pub lod: LodArg,
    /// With --lod auto: how large a voxel may be seen, in pixels [default: 1]
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true)]
    pub pixel_error: Option<f64>,
    /// With --lod auto: what is fine enough [default: error]
    #[arg(long, value_name = "CRITERION", value_parser = word::<Criterion>())]
    pub lod_criterion: Option<Criterion>,
    /// With --lod auto: full resolution at this point, falling off with the distance; world units
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    #[arg(conflicts_with_all = ["pixel_error", "lod_criterion"])]
    pub focus: Option<[f64; 3]>,
    /// With --lod auto: as fine as frames can be drawn in this time, and no finer than is asked for
    ///
    /// By what the frames before took; a first one is drawn several times to learn that. Bricks are loaded before the
    /// time counts. The picture is another one wherever the time is: its manifest keeps the levels, and --scene draws
    /// it again.
    #[arg(long, value_name = "TIME", value_parser = deadline)]
    pub frame_budget: Option<Duration>,
    /// Write a complete coarse picture first, and finer ones in its place, up to what --lod asks for
    ///
    /// A line says of each what it is of. The last one is the picture without this flag, bit for bit.
    #[arg(long)]
    pub progressive: bool,
    /// Where coarser levels hide what full resolution shows, as JSON: boxes in voxels of the finest level
    #[arg(long, value_name = "FILE.json")]
    pub hidden: Option<PathBuf>,
    /// Stripe the picture where coarser levels hide what full resolution shows
    #[arg(long)]
    pub mark_hidden: bool,
}

fn lod(text: &str) -> Result<LodArg, String> {
    match text {
        "full" => Ok(LodArg::Full),
        "auto" => Ok(LodArg::Auto),
        number => number.parse().map(LodArg::Level).map_err(|_| {
            let shown: String = text.chars().take(40).collect();
            format!("`{shown}` is not full, auto, or the number of a level (0 is the volume, 1 the next coarser)")
        }),
    }
}

impl LodArgs {
    /// # Errors
    /// Usage: what chooses levels where none are chosen; a pixel error that is not above 0; a focus that is no point.
    pub(crate) fn lod(&self) -> Result<Lod, Failure> {
        let asked = [
            ("--pixel-error", self.pixel_error.is_some()),
            ("--lod-criterion", self.lod_criterion.is_some()),
            ("--focus", self.focus.is_some()),
            ("--frame-budget", self.frame_budget.is_some()),
        ];
        match self.lod {
            LodArg::Auto => {}
            other => {
                if let Some((flag, _)) = asked.into_iter().find(|(_, is_asked)| *is_asked) {
                    return Err(Failure::usage(anyhow!(
                        "{flag} chooses among levels: add --lod auto, or leave it out"
                    )));
                }
                return Ok(if let LodArg::Level(level) = other { Lod::Level(level) } else { Lod::Full });
            }
        }
        let criterion = self.lod_criterion.unwrap_or_default();
        if let (Some(pixels), Criterion::Fov | Criterion::Cone) = (self.pixel_error, criterion) {
            return Err(Failure::usage(anyhow!(
                "--pixel-error {pixels} is for --lod-criterion error, not {criterion}: leave one out"
            )));
        }
        let rule = match (self.focus, criterion) {
            (Some(point), _) => Rule::Focus(DVec3::from(point)),
            (None, Criterion::Error) => Rule::Error { pixels: self.pixel_error.unwrap_or(DEFAULT_PIXEL_ERROR) },
            (None, Criterion::Fov) => Rule::FieldOfView,
            (None, Criterion::Cone) => Rule::Cone,
        };
        rule.check().map_err(|error| Failure::usage(anyhow!("--lod auto: {error}")))?;
        Ok(Lod::Auto(rule))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Words {
        #[command(flatten)]
        lod: LodArgs,
    }

    fn read(words: &str) -> Result<Lod, String> {
        let words = Words::try_parse_from(std::iter::once("x").chain(words.split_whitespace()));
        words.map_err(|error| error.to_string())?.lod.lod().map_err(|failure| failure.message())
    }

    #[test]
    fn words_say_which_levels_are_drawn() {
        assert_eq!(read(""), Ok(Lod::Full));
        assert_eq!(read("--lod full"), Ok(Lod::Full));
        assert_eq!(read("--lod 0"), Ok(Lod::Level(0)));
        assert_eq!(read("--lod 3"), Ok(Lod::Level(3)));
        assert_eq!(read("--lod auto"), Ok(Lod::Auto(Rule::Error { pixels: 1.0 })));
        assert_eq!(read("--lod auto --pixel-error 0.25"), Ok(Lod::Auto(Rule::Error { pixels: 0.25 })));
        assert_eq!(read("--lod auto --lod-criterion error"), Ok(Lod::Auto(Rule::Error { pixels: 1.0 })));
        assert_eq!(read("--lod auto --lod-criterion fov"), Ok(Lod::Auto(Rule::FieldOfView)));
        assert_eq!(read("--lod auto --lod-criterion cone"), Ok(Lod::Auto(Rule::Cone)));
        assert_eq!(read("--lod auto --focus -1,2,3.5"), Ok(Lod::Auto(Rule::Focus(DVec3::new(-1.0, 2.0, 3.5)))));
    }

    #[test]
    fn what_chooses_nothing_is_refused_by_name() {
        for (words, parts) in [
            ("--lod half", &["`half`", "full, auto"][..]),
            ("--lod 300", &["`300`"]),
            ("--lod 1.5", &["`1.5`"]),
            ("--pixel-error 2", &["--pixel-error", "--lod auto"]),
            ("--lod 2 --focus 1,2,3", &["--focus", "--lod auto"]),
            ("--lod full --lod-criterion cone", &["--lod-criterion", "--lod auto"]),
            ("--lod 1 --frame-budget 50ms", &["--frame-budget", "--lod auto"]),
            ("--lod auto --frame-budget 0s", &["--frame-budget", "above 0"]),
            ("--lod auto --frame-budget soon", &["--frame-budget", "`soon`"]),
            ("--lod auto --pixel-error 0", &["pixel error 0", "above 0"]),
            ("--lod auto --pixel-error -1", &["pixel error -1"]),
            ("--lod auto --pixel-error nan", &["pixel error NaN"]),
            ("--lod auto --pixel-error 1 --lod-criterion fov", &["--pixel-error 1", "fov"]),
            ("--lod auto --lod-criterion near", &["near", "error", "fov", "cone"]),
            ("--lod auto --focus 1,2", &["1,2", "X,Y,Z"]),
            ("--lod auto --focus inf,0,0", &["focus [inf, 0.0, 0.0]"]),
            ("--lod auto --focus 1,2,3 --pixel-error 1", &["--focus", "--pixel-error"]),
            ("--lod auto --focus 1,2,3 --lod-criterion cone", &["--focus", "--lod-criterion"]),
        ] {
            let error = read(words).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{words}: {error}");
        }
    }
}
