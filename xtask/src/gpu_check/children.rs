//! Programs that are run, each with an end.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;

/// How often a running program is looked at.
const PAUSE: Duration = Duration::from_millis(20);

/// A program that is to run.
#[derive(Debug)]
pub(super) struct Child {
    command: Command,
    /// What is told while it runs.
    what: String,
}

/// One that ended by itself.
#[derive(Debug)]
pub(super) struct Ended {
    pub(super) stdout: String,
    pub(super) is_success: bool,
    pub(super) seconds: f64,
}

impl Child {
    pub(super) fn new(program: &Path, words: &[&str], what: &str) -> Self {
        let mut command = Command::new(program);
        command.args(words);
        Self { command, what: what.to_owned() }
    }

    /// The tests of a test program that `filter` names; those that want a GPU's driver fail without one.
    pub(super) fn test(program: &Path, filter: &str) -> Self {
        let mut child = Self::new(program, &[filter], &format!("tests {filter}"));
        child.command.env("BRICKCAST_REQUIRE_ALL", "1");
        child
    }

    /// Runs it until `end`; nothing where it had not ended by then (it is killed), or would begin after it.
    pub(super) fn run(mut self, end: Instant) -> anyhow::Result<Option<Ended>> {
        let begin = Instant::now();
        if begin >= end {
            return Ok(None);
        }
        writeln!(std::io::stderr(), "{} ...", self.what)?;
        let program = self.command.get_program().to_string_lossy().into_owned();
        let mut child =
            self.command.stdout(Stdio::piped()).spawn().with_context(|| format!("{program}: cannot be started"))?;
        let stdout = child.stdout.take();
        // Beside it, or a program that says much would wait for its reader.
        let reader = std::thread::spawn(move || {
            let mut text = String::new();
            stdout.map(|mut stdout| stdout.read_to_string(&mut text)).transpose().map(|_| text)
        });
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break Some(status);
            }
            if Instant::now() >= end {
                child.kill()?;
                child.wait()?;
                break None;
            }
            std::thread::sleep(PAUSE);
        };
        let stdout = reader.join().map_err(|_| anyhow::anyhow!("{program}: its output could not be read"))??;
        let seconds = (begin.elapsed().as_secs_f64() * 10.0).round() / 10.0;
        Ok(status.map(|status| Ended { stdout, is_success: status.success(), seconds }))
    }
}

/// The newest test program of this name in a folder of them; nothing where there is none.
pub(super) fn newest(folder: &Path, name: &str) -> anyhow::Result<Option<PathBuf>> {
    let is_one = |path: &Path| {
        let stem = path.file_name()?.to_str()?.strip_prefix(name)?.strip_prefix('-')?;
        let hash = stem.strip_suffix(std::env::consts::EXE_SUFFIX)?;
        (hash.len() == 16 && hash.bytes().all(|b| b.is_ascii_hexdigit())).then_some(())
    };
    let files = std::fs::read_dir(folder).with_context(|| format!("{}: cannot be read", folder.display()))?;
    let mut found = Vec::new();
    for file in files {
        let path = file?.path();
        if is_one(&path).is_some() {
            found.push((path.metadata()?.modified()?, path));
        }
    }
    Ok(found.into_iter().max().map(|(_, path)| path))
}

pub(super) fn print(text: &str) -> anyhow::Result<()> {
    Ok(writeln!(std::io::stdout(), "{text}")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_ends_by_itself_or_is_ended() {
        let shell = |words: &str| Child::new(Path::new("sh"), &["-c", words], "a shell");
        let soon = || Instant::now() + Duration::from_secs(20);
        let ended = shell("echo said; exit 3").run(soon()).unwrap().unwrap();
        assert_eq!((ended.stdout.as_str(), ended.is_success), ("said\n", false));
        let begin = Instant::now();
        assert!(shell("exec sleep 60").run(begin + Duration::from_millis(200)).unwrap().is_none());
        assert!(begin.elapsed() < Duration::from_secs(30));
        assert!(shell("true").run(Instant::now()).unwrap().is_none(), "it began after the end");
    }
}
