//! What goes to stdout.

use std::io::Write as _;

use brickcast_volume::shown::shown_lines;
use brickcast_volume::store::RegionsEntry;

use super::failure::Failure;

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
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("stdout").into())
        }
        _ => Ok(()),
    }
}

/// What was done, for people: stdout, unless quiet.
pub(crate) fn say(quiet: bool, text: &str) -> Result<(), Failure> {
    if quiet { Ok(()) } else { tell(&format!("{text}\n")) }
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
