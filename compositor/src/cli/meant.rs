//! A command line that begins with a volume and not with a command: what was meant.

use std::ffi::OsString;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// What to say where `words` were refused since the first of them is a volume, or looks like one, and no command.
pub(super) fn render_was_meant(error: &clap::Error, words: &[OsString]) -> Option<String> {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    let path = Path::new(word);
    let is_path = path.exists() || word.contains(['/', '\\']) || path.extension().is_some();
    if error.kind() != ErrorKind::InvalidSubcommand || !is_path {
        return None;
    }
    let rest = words.iter().skip_while(|given| *given != word.as_str()).skip(1).filter_map(|given| given.to_str());
    let rest: Vec<&str> = rest.collect();
    let mut line = format!("brickcast render {}", quoted(word));
    for given in &rest {
        line.push(' ');
        line.push_str(&quoted(given));
    }
    if !rest.iter().any(|given| given.starts_with("-o") || given.starts_with("--output")) {
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("picture");
        line.push_str(&format!(" -o {}", quoted(&format!("{name}.png"))));
    }
    Some(format!("`{word}` is no command: did you mean `{line}`? (brickcast --help lists the commands)"))
}

/// As a shell reads it as one word.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./,:=%+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args;

    fn said(line: &[&str]) -> Option<String> {
        let words: Vec<OsString> = std::iter::once(&"brickcast").chain(line).map(OsString::from).collect();
        render_was_meant(&args::command().try_get_matches_from(&words).unwrap_err(), &words)
    }

    #[test]
    fn a_volume_in_place_of_a_command_is_to_be_rendered() {
        for (line, want) in [
            (&["part.nrrd"][..], "`brickcast render part.nrrd -o part.png`"),
            (&["-v", "a/b c.nrrd", "--size", "hd"], "`brickcast render 'a/b c.nrrd' --size hd -o 'b c.png'`"),
            (&["stores/part"], "`brickcast render stores/part -o part.png`"),
            (&["part.nrrd", "-o", "x.exr"], "`brickcast render part.nrrd -o x.exr`"),
            (&["src"], "`brickcast render src -o src.png`"),
        ] {
            let text = said(line).unwrap();
            assert!(text.contains(want), "{line:?}: {text}");
        }
    }

    #[test]
    fn other_mistakes_are_clap_s_to_tell() {
        for line in [&["rendr"][..], &["render"], &["--nothing"], &["info", "a.nrrd", "b.nrrd"]] {
            assert_eq!(said(line), None, "{line:?}");
        }
    }
}
