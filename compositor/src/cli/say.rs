//! What goes to stdout, and what is said beside it on stderr: results on the one, talk on the other.

use brickcast_volume::shown::shown_lines;
use brickcast_volume::store::RegionsEntry;

use super::failure::Failure;
use super::progress;

/// Results for people go to stdout, what others wrote in them made harmless for a terminal.
///
/// # Errors
/// As [`print`].
pub(crate) fn tell(text: &str) -> Result<(), Failure> {
    print(&shown_lines(text))
}

/// Results for programs go to stdout as they are. A reader that has had enough (`| head`) is no failure.
///
/// # Errors
/// stdout cannot be written.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    progress::aside(|| written(std::io::stdout().lock(), "stdout", text))
}

/// An answer of one line for people, such as a verdict: stdout, unless quiet, since the exit code says it too.
///
/// # Errors
/// As [`print`].
pub(crate) fn answer(quiet: bool, text: &str) -> Result<(), Failure> {
    if quiet { Ok(()) } else { tell(&format!("{text}\n")) }
}

/// What was chosen, noticed or written, for people: stderr, unless quiet.
///
/// # Errors
/// stderr cannot be written; a reader that has had enough is no failure.
pub(crate) fn say(quiet: bool, text: &str) -> Result<(), Failure> {
    if quiet {
        return Ok(());
    }
    progress::aside(|| written(std::io::stderr().lock(), "stderr", &format!("{}\n", shown_lines(text))))
}

fn written(mut out: impl std::io::Write, name: &'static str, text: &str) -> Result<(), Failure> {
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context(name).into())
        }
        _ => Ok(()),
    }
}

/// Regions of a store for people: number, share of its `voxels`, largest, how they were found.
pub(crate) fn region_words(r: &RegionsEntry, voxels: u64) -> String {
    let share = |n: u64| 100.0 * n as f64 / voxels as f64;
    let how = match r.segmentation_range {
        Some(w) => format!("{} of range {w}", r.method.name()),
        None => r.method.name().to_owned(),
    };
    format!(
        "{} regions ({how}, at least {} voxels): {:.1} % of the voxels, the largest {:.1} %, {:.1} % can leap",
        r.count,
        r.min_region.max(1),
        share(r.voxels),
        share(r.largest),
        share(r.leap_voxels),
    )
}
