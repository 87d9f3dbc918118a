//! What a word for the quality stands for.

use std::time::Duration;

use brickcast_volume::scene::{PixelSamples, Transport};

use super::args::{QualityArg, SceneArgs};

impl SceneArgs {
    /// Sets what `--quality` stands for where `is_open`: neither a flag nor an environment variable nor a file said
    /// anything of a key. `deadline` is a frame's.
    pub(crate) fn settle_quality(&mut self, deadline: Option<&mut Duration>, is_open: &dyn Fn(&str) -> bool) {
        let quality = self.quality.quality;
        let mut set = Vec::new();
        let mut open = |flag: &str, value: &str, words: &str| {
            let is_open = is_open(&flag.replace('-', "_"));
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
