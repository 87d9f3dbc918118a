//! Help in two pages: `-h` shows what most people need and fits on a screen, `--help` all, with an example for each
//! group.

use clap::{Arg, Command, CommandFactory as _};

use super::Cli;

/// Of a command with more flags than one can take in.
struct Pages {
    command: &'static str,
    /// The flags of the first page; all others are on the second alone.
    first: &'static [&'static str],
    /// For each group of flags by its heading, a line that can be pasted.
    examples: &'static [(&'static str, &'static str)],
}

const PAGES: [Pages; 3] = [
    Pages {
        command: "render",
        first: &[
            "output",
            "size",
            "from",
            "up",
            "azimuth",
            "elevation",
            "quality",
            "window",
            "colormap",
            "isosurface",
            "look",
            "cut",
            "background",
            "frames",
            "nodes",
        ],
        examples: &[
            ("Options", "brickcast render --scene part.png.json -o again.png"),
            ("Look", "brickcast render part.nrrd -o part.png --look scan"),
            ("Transfer function", "brickcast render part.nrrd -o part.png --window 12000,40000 --colormap viridis"),
            ("Camera", "brickcast render part.nrrd -o part.png --up z --from iso --zoom 1.3"),
            ("Quality", "brickcast render part.nrrd -o part.png --exact --step 0.25"),
            ("Style", "brickcast render part.nrrd -o part.png --isosurface otsu:steelblue --cut z=50%"),
            ("Acceleration and regions", "brickcast render part -o part.png --accel ert,ess --macrocell 8"),
            ("Level of detail", "brickcast render part -o part.png --lod auto --pixel-error 2"),
            ("Output", "brickcast render part.nrrd -o turn.apng --frames 60 --background white"),
            ("Nodes", "brickcast render part -o part.png --nodes n1:7000,n2:7000 --tls tls"),
            ("Balance", "brickcast render part -o turn.apng --frames 60 --local 4 --balance static"),
            ("Input prepared on the way", "brickcast render part.nrrd -o part.png --brick 32 --cache-dir cache"),
            ("Regions", "brickcast render part.nrrd -o part.png --segmentation-range 0.03"),
            ("Input", "brickcast render scan.raw -o scan.png --dims 512,512,400 --type uint16"),
            ("Configuration", "brickcast render part.nrrd -o part.png --config cluster.toml"),
        ],
    },
    Pages {
        command: "bench",
        first: &[
            "json",
            "repeat",
            "table",
            "counts",
            "backend",
            "size",
            "from",
            "window",
            "isosurface",
            "mode",
            "accel",
            "step",
        ],
        examples: &[
            ("Options", "brickcast bench part --counts 1,2,4 --repeat 9 --json bench.json"),
            ("Output", "brickcast bench part --size hd"),
            ("Look", "brickcast bench part --look part"),
            ("Transfer function", "brickcast bench part --window 12000,40000"),
            ("Camera", "brickcast bench part --up z --from front"),
            ("Quality", "brickcast bench part --step 0.25 --filter exact"),
            ("Style", "brickcast bench part --table lum --shading phong"),
            ("Acceleration and regions", "brickcast bench part --accel ert,ess"),
            ("Input prepared on the way", "brickcast bench part.nrrd --brick 32"),
            ("Regions", "brickcast bench part.nrrd --segmentation-range 0.03"),
            ("Input", "brickcast bench scan.raw --dims 512,512,400 --type uint16"),
            ("Configuration", "brickcast bench part --config cluster.toml"),
        ],
    },
    Pages {
        command: "balance",
        first: &[
            "simulate",
            "frames",
            "camera_path",
            "orbit",
            "balance",
            "nodes",
            "local",
            "size",
            "from",
            "up",
            "window",
            "isosurface",
        ],
        examples: &[
            ("Options", "brickcast balance --simulate nodes=16,chunks=512,throttle=3@0"),
            ("Balance", "brickcast balance part --local 4 --balance dynamic --replicas 1"),
            ("Nodes", "brickcast balance part --nodes dns:node:7000 --frames 100"),
            ("Output", "brickcast balance part --local 4 --size 256"),
            ("Look", "brickcast balance part --local 4 --look mip"),
            ("Transfer function", "brickcast balance part --local 4 --window 12000,40000"),
            ("Camera", "brickcast balance part --local 4 --up z --from iso"),
            ("Quality", "brickcast balance part --local 4 --step 1"),
            ("Style", "brickcast balance part --local 4 --isosurface otsu"),
            ("Acceleration and regions", "brickcast balance part --local 4 --accel ert,ess"),
            ("Input prepared on the way", "brickcast balance part.nrrd --local 4 --brick 32"),
            ("Regions", "brickcast balance part.nrrd --local 4 --segmentation-range 0.03"),
            ("Input", "brickcast balance scan.raw --local 4 --dims 512,512,400 --type uint16"),
            ("Configuration", "brickcast balance part --local 4 --config cluster.toml"),
        ],
    },
];

/// The command line with its help in pages.
#[must_use]
pub fn command() -> Command {
    let line = Cli::command();
    // A command's own copy of a flag that all have: there it may be on the second page.
    let all: Vec<Arg> = line.get_arguments().filter(|arg| arg.is_global_set()).cloned().collect();
    PAGES.iter().fold(line, |line, pages| line.mut_subcommand(pages.command, |inner| pages.of(inner.args(&all))))
}

impl Pages {
    fn of(&self, command: Command) -> Command {
        let is_first = |arg: &Arg| arg.is_positional() || self.first.contains(&arg.get_id().as_str());
        let command = command.mut_args(|arg| {
            let hidden = !is_first(&arg);
            arg.hide_short_help(hidden)
        });
        // --help, which clap adds, is one more.
        let flags = 1 + command.get_arguments().filter(|arg| !arg.is_positional()).count();
        let examples = self.examples.iter().map(|(heading, line)| format!("\n  # {heading}\n  {line}"));
        command
            .after_help(format!("{} --help shows all {flags} flags, with examples.", self.command))
            .after_long_help(format!("Examples, one for each group:{}", examples.collect::<String>()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// As it is when somebody asks for help.
    fn built(name: &str) -> Command {
        let mut line = command();
        line.build();
        line.find_subcommand(name).unwrap().clone()
    }

    /// Lines that begin with a flag.
    fn flags(page: &str) -> usize {
        page.lines().filter(|line| line.starts_with("  -") || line.starts_with("      --")).count()
    }

    #[test]
    fn the_first_page_has_at_most_fifteen_flags_and_fits_on_a_screen() {
        for pages in &PAGES {
            assert!(pages.first.len() <= 15 && (pages.command != "render" || pages.first.len() == 15));
            for width in [80, 120] {
                let page = built(pages.command).term_width(width).render_help().to_string();
                assert!(page.lines().count() <= 50, "{} lines at {width}:\n{page}", page.lines().count());
                assert!(page.lines().all(|line| line.chars().count() <= width), "{width}:\n{page}");
                // And -h itself.
                assert_eq!(flags(&page), pages.first.len() + 1, "{page}");
            }
        }
    }

    #[test]
    fn the_second_page_has_all_flags_and_the_first_one_says_how_many() {
        for pages in &PAGES {
            let command = built(pages.command);
            let page = command.clone().render_long_help().to_string();
            for arg in command.get_arguments() {
                assert!(arg.get_long().is_none_or(|long| page.contains(&format!("--{long}"))), "{arg}:\n{page}");
            }
            let last = command.clone().render_help().to_string();
            let last = last.lines().last().unwrap();
            assert_eq!(last, format!("{} --help shows all {} flags, with examples.", pages.command, flags(&page)));
        }
    }

    /// An example that is refused, or shows nothing of its group, would be worse than none.
    #[test]
    fn every_group_has_an_example_which_is_valid_and_uses_one_of_its_flags() {
        for pages in &PAGES {
            let of_command = built(pages.command);
            let headings: BTreeSet<&str> =
                of_command.get_arguments().map(|arg| arg.get_help_heading().unwrap_or("Options")).collect();
            assert_eq!(headings, pages.examples.iter().map(|(heading, _)| *heading).collect());
            for (heading, line) in pages.examples {
                assert!(line.len() <= 100, "{line}");
                let words: Vec<&str> = line.split_whitespace().collect();
                assert_eq!(words[..2], ["brickcast", pages.command], "{line}");
                let parsed = command().try_get_matches_from(&words);
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
                let uses = |arg: &Arg| {
                    let long = arg.get_long().map(|long| format!("--{long}")).unwrap_or_default();
                    arg.get_help_heading().unwrap_or("Options") == *heading && words.contains(&long.as_str())
                };
                assert!(of_command.get_arguments().any(uses), "{heading}: {line}");
            }
        }
    }

    /// The copies of the flags that all commands have are still those.
    #[test]
    fn flags_of_all_commands_hold_before_and_behind_a_command() {
        use clap::FromArgMatches as _;
        for line in ["brickcast render a -o b -vv", "brickcast -vv render a -o b"] {
            let matches = command().try_get_matches_from(line.split_whitespace()).unwrap();
            assert_eq!(Cli::from_arg_matches(&matches).unwrap().verbose, 2, "{line}");
        }
        assert!(command().try_get_matches_from("brickcast render a -o b -q -v".split(' ')).is_err());
        for pages in &PAGES {
            let page = built(pages.command).render_help().to_string();
            assert!(!page.contains("--config") && !page.contains("--quiet"), "{page}");
        }
    }
}
