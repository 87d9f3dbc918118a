//! How much work goes into a pixel, in a word and as a number of rays.

use std::time::Duration;

use brickcast_volume::scene::{PixelSamples, Transport};
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use clap::{Args, ValueEnum};

use super::scene::SceneArgs;
use crate::cli::invocation::{Origin, Origins};

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
    /// Step, samples and what else makes a picture fast or fine; flags that are given win
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

    /// What `--quality` set, for people.
    pub(crate) fn note(&self) -> Option<String> {
        let word = self.quality.to_possible_value()?.get_name().to_owned();
        let words: Vec<&str> = self.set.iter().map(|(words, _)| words.as_str()).collect();
        (!words.is_empty()).then(|| format!("quality {word}: {}", words.join(", ")))
    }
}

impl SceneArgs {
    /// Sets what `--quality` stands for, where neither a flag nor an environment variable nor a file did; `deadline` is
    /// a frame's.
    pub(crate) fn settle_quality(&mut self, deadline: Option<&mut Duration>, origins: &Origins) {
        let quality = self.quality.quality;
        let mut set = Vec::new();
        let mut open = |flag: &str, value: &str, words: &str| {
            let is_open = origins.get(&flag.replace('-', "_")) == Origin::Default;
            if is_open {
                set.push((words.to_owned(), format!("--{flag} {value}")));
            }
            is_open
        };
        match quality {
            QualityArg::Normal => {}
            QualityArg::Draft => {
                if open("step", "1", "step 1") {
                    self.step = 1.0;
                }
                if open("table-size", "256", "tables of 256 entries") {
                    self.style.table_size = 256;
                }
            }
            QualityArg::Final => {
                if open("step", "0.25", "step 0.25") {
                    self.step = 0.25;
                }
                if open("samples", "4", "4 samples a pixel") {
                    self.quality.samples = PixelSamples::Four;
                }
                if open("early-termination", "1", "rays that do not end early") {
                    self.early_termination = 1.0;
                }
                if open("transport", "f32", "pixels that travel as f32") {
                    self.transport = Some(Transport::F32);
                }
                if let Some(deadline) = deadline
                    && open("deadline", "10m", "10 minutes a frame")
                {
                    *deadline = Duration::from_secs(600);
                }
            }
        }
        if !set.is_empty() {
            let flags: Vec<&str> = set.iter().map(|(_, flag)| flag.as_str()).collect();
            tracing::info!("--quality stands for {}; each of them wins where it is given", flags.join(" "));
        }
        self.quality.set = set;
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use super::*;
    use crate::cli::args::Command;
    use crate::cli::invocation::Invocation;

    fn scene(words: &str) -> SceneArgs {
        let words = ["brickcast"].into_iter().chain(words.split_whitespace()).map(OsString::from);
        match Invocation::parse(words).unwrap().cli.command {
            Command::Render(args) => args.scene,
            Command::Bench(args) => args.scene,
            Command::Balance(args) => args.scene,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn quality_sets_what_no_flag_sets() {
        let of = |words: &str| {
            let scene = scene(words);
            (scene.step, scene.quality.samples.count(), scene.style.table_size, scene.early_termination)
        };
        assert_eq!(of("render p -o a.png"), (0.5, 1, 1024, 0.999));
        assert_eq!(of("render p -o a.png --quality normal"), (0.5, 1, 1024, 0.999));
        assert_eq!(of("render p -o a.png --quality draft"), (1.0, 1, 256, 0.999));
        assert_eq!(of("render p -o a.png --quality final"), (0.25, 4, 1024, 1.0));
        assert_eq!(of("bench p --quality final --step 0.5"), (0.5, 4, 1024, 1.0));
        assert_eq!(of("balance p --nodes a:1 --samples 9 --quality final"), (0.25, 9, 1024, 1.0));
        assert_eq!(
            of("render p -o a.png --samples 1 --early-termination 0.999 --quality final"),
            (0.25, 1, 1024, 0.999)
        );
    }

    #[test]
    fn final_pictures_have_the_time_that_they_need() {
        let deadline = |words: &str| {
            let words = format!("brickcast render p -o a.png {words}");
            match Invocation::parse(words.split_whitespace().map(OsString::from)).unwrap().cli.command {
                Command::Render(args) => args.nodes.deadline.as_secs(),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(["", "--quality final", "--quality final --deadline 5s"].map(deadline), [30, 600, 5]);
    }

    #[test]
    fn what_it_set_is_told_and_nothing_else() {
        assert_eq!(scene("render p -o a.png").quality.note(), None);
        assert_eq!(scene("render p -o a.png --quality draft --step 1 --table-size 1024").quality.note(), None);
        let note = scene("render p -o a.png --quality final --samples 16").quality.note().unwrap();
        assert!(note.starts_with("quality final: step 0.25, rays") && !note.contains("samples"), "{note}");
        assert_eq!(scene("render p -o a.png --quality final").transport, Some(Transport::F32));
        assert_eq!(scene("render p -o a.png --quality final --transport f16").transport, Some(Transport::F16));
    }
}
