//! How a sequence ended, for people and as figures.

use std::path::Path;

use serde_json::json;

use super::plan::{RenderPlan, ScenesPlan};
use super::sequence::Sequence;
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cli::scene::nothing_shows::{self, Outlook};
use crate::output::write_json;
use crate::session::stats;
use crate::words::bytes;

/// Says what was written and writes the statistics.
///
/// # Errors
/// [`Failure::Incomplete`] where a frame is not complete; a picture that is not the one it was compared with.
pub(super) fn report(plan: &RenderPlan, all: &Sequence, outlook: Option<&Outlook>, quiet: bool) -> Result<(), Failure> {
    if let Some(text) = nothing_shows::afterwards(all.empty, all.frames.len(), outlook) {
        tracing::warn!("{text}");
    }
    if let Some(path) = &plan.stats {
        let mut report = stats::report(&all.load, &all.frames, all.first_frame_ms);
        match &all.audits[..] {
            [] => {}
            [one] => report["audit"] = json!(one),
            several => report["audit"] = json!(several),
        }
        write_json(path, &report)?;
    }
    tell(all, quiet)?;
    if !all.problems.is_empty() {
        let problems = all.problems.join("; ");
        return Err(Failure::Incomplete(match &plan.output {
            Some(output) => format!("incomplete picture written to {}: {problems}", output.path.display()),
            None => format!("the picture is not complete, and was not compared: {problems}"),
        }));
    }
    match &plan.scenes {
        ScenesPlan::Drawn(redraw) if redraw.picture.is_some() => say(quiet, &redraw.verdict(&all.differences)?),
        ScenesPlan::Drawn(_) | ScenesPlan::Asked { .. } => Ok(()),
    }
}

fn tell(all: &Sequence, quiet: bool) -> Result<(), Failure> {
    let (Some(first), Some(last)) = (all.written.first(), all.written.last()) else { return Ok(()) };
    let names = if all.written.len() > 1 {
        format!("{} to {}", first.display(), file_name(last))
    } else {
        first.display().to_string()
    };
    let frames = &all.frames;
    let mean = frames.iter().map(|f| f.frame_ms).sum::<f64>() / frames.len().max(1) as f64;
    let samples = frames.iter().map(|f| f.samples).sum::<u64>();
    let received = frames.iter().map(|f| f.bytes_received).sum::<u64>();
    let nodes = frames.last().map_or(0, |f| f.nodes.len());
    say(
        quiet,
        &format!(
            "wrote {names}: {mean:.0} ms a frame on {nodes} node{}, {:.1} M samples, {} received, {:.0} ms loading",
            if nodes == 1 { "" } else { "s" },
            samples as f64 / 1e6,
            bytes(received),
            all.load.load_ms,
        ),
    )
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
