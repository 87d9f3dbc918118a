//! How much work goes into a pixel, in a word and as a number of rays.

use std::sync::Once;

use brickcast_volume::scene::PixelSamples;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use clap::{Args, ValueEnum};

/// What no flag of its own sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum QualityArg {
    /// Fast, to look around: --step 1 --table-size 256
    Draft,
    /// The defaults
    Normal,
    /// To keep: --step 0.25 --samples 4 --early-termination 1 --transport f32 --deadline 10m
    Final,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Quality")]
pub struct QualityArgs {
    /// How fine: sets what no flag sets
    ///
    /// Step, samples and what else makes a picture fast or fine; flags that are given win.
    #[arg(long, value_enum, default_value = "normal")]
    pub quality: QualityArg,
    /// Rays of a pixel, on a square grid; it is their mean. N of them take N times as long
    #[arg(long, value_name = "N", value_parser = samples(), default_value = "1")]
    pub samples: PixelSamples,
    /// What --quality set: words, and flags.
    #[arg(skip)]
    pub(crate) set: Vec<(String, String)>,
}

fn samples() -> impl clap::builder::TypedValueParser<Value = PixelSamples> {
    let known = ["1", "4", "9", "16"];
    // Only these pass.
    PossibleValuesParser::new(known).map(|word| {
        let count = word.parse().unwrap_or(1);
        PixelSamples::of_count(count).unwrap_or_default()
    })
}

impl QualityArgs {
    /// For a line about pictures: nothing where a pixel is a ray.
    pub(crate) fn samples_in_words(&self) -> String {
        match self.samples {
            PixelSamples::One => String::new(),
            samples => format!(", {} samples a pixel", samples.count()),
        }
    }

    /// What `--quality` set, for people; its flags for those who want to know more.
    pub(crate) fn note(&self) -> Option<String> {
        static TOLD: Once = Once::new();
        let flags: Vec<&str> = self.set.iter().map(|(_, flag)| flag.as_str()).collect();
        if !flags.is_empty() {
            TOLD.call_once(|| {
                tracing::info!("--quality stands for {}; each of them wins where it is given", flags.join(" "));
            });
        }
        let word = self.quality.to_possible_value()?.get_name().to_owned();
        let words: Vec<&str> = self.set.iter().map(|(words, _)| words.as_str()).collect();
        (!words.is_empty()).then(|| format!("quality {word}: {}", words.join(", ")))
    }
}
