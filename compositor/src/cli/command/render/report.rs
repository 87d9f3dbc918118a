//! How a sequence ended, for people and as figures.

use std::path::Path;

use brickcast_volume::PictureSize;
use serde_json::json;

use super::frames::Frames;
use super::hidden;
use super::plan::RenderPlan;
use super::scenes::ScenesPlan;
use super::sequence::Sequence;
use crate::cli::failure::Failure;
use crate::cli::say::{answer, say};
use crate::cli::scene::nothing_shows;
use crate::output::write_json;
use crate::session::{FrameStats, LodStats, stats};
use crate::words::{bytes, time};

/// Says what was written and writes the statistics.
///
/// # Errors
/// [`Failure::Incomplete`] where a frame is not complete; a picture that is not the one it was compared with.
pub(super) fn report(plan: &RenderPlan, all: &Sequence, frames: &Frames<'_>, quiet: bool) -> Result<(), Failure> {
    let outlook = frames.outlook.as_ref();
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
    if let Some(path) = &plan.hidden.file {
        write_json(path, &hidden::file(&all.hidden))?;
    }
    tell(plan, all, frames.first().view.size, quiet)?;
    if !all.problems.is_empty() {
        let problems = all.problems.iter().cloned().chain(unread(&all.frames).map(|why| format!("drawn coarser{why}")));
        let problems = problems.collect::<Vec<_>>().join("; ");
        return Err(Failure::Incomplete(match &plan.output {
            Some(output) => format!("incomplete picture written to {}: {problems}", output.path.display()),
            None => format!("the picture is not complete, and was not compared: {problems}"),
        }));
    }
    if let (Some(why), Some(output)) = (&all.unfinished, &plan.output) {
        let output = output.path.display();
        return Err(Failure::Coarse(format!(
            "complete picture written to {output}, not at the resolution that was asked for: {why}"
        )));
    }
    match &plan.scenes {
        ScenesPlan::Drawn(redraw) if redraw.picture.is_some() => answer(quiet, &redraw.verdict(&all.differences)?),
        ScenesPlan::Drawn(_) | ScenesPlan::Asked { .. } => coarse(plan, &all.frames).map_or(Ok(()), Err),
    }
}

/// Where something in view was drawn coarser than it is.
fn coarse(plan: &RenderPlan, frames: &[FrameStats]) -> Option<Failure> {
    // Of pictures that take each other's place the last one counts.
    let frames = if plan.progressive { &frames[frames.len().saturating_sub(1)..] } else { frames };
    let lods = || frames.iter().filter_map(|frame| frame.lod.as_ref());
    let coarse = lods().map(LodStats::coarse_in_view).max().filter(|&chunks| chunks > 0)?;
    let of = lods().map(|lod| lod.in_view.iter().sum::<u64>()).max().unwrap_or(coarse);
    let output = plan.output.as_ref()?.path.display();
    let why = unread(frames).unwrap_or_else(|| "; --lod full draws all as they are".to_owned());
    Some(Failure::Coarse(format!(
        "complete picture written to {output}, not at full resolution: {coarse} of {of} chunks in view are drawn \
         coarser{why}"
    )))
}

/// Why something was drawn coarser than was asked.
fn unread(frames: &[FrameStats]) -> Option<String> {
    let lods = frames.iter().filter_map(|frame| frame.lod.as_ref());
    let mut reasons: Vec<String> = lods.flat_map(|lod| lod.unreadable.iter().cloned()).collect();
    reasons.dedup();
    let (why, more) = reasons.split_first()?;
    Some(match more.len() {
        0 => format!(", since not all can be read: {why}"),
        more => format!(", since not all can be read: {why}; and {more} more bricks"),
    })
}

/// A line for what was written, and with -v another with more figures.
fn tell(plan: &RenderPlan, all: &Sequence, size: PictureSize, quiet: bool) -> Result<(), Failure> {
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
    let took = match frames.len() {
        1 => time(all.first_frame_ms / 1e3),
        n if plan.progressive => format!("{n} pictures, the first after {}", time(all.first_frame_ms / 1e3)),
        n => format!("{n} frames, {} each", time(mean / 1e3)),
    };
    let (w, h, s) = (size.width(), size.height(), if nodes == 1 { "" } else { "s" });
    say(quiet, &format!("{names} {w} x {h}, {took}, {nodes} node{s}"))?;
    tracing::info!(
        "{:.1} M samples, {} received, {} loading, {mean:.0} ms a frame",
        samples as f64 / 1e6,
        bytes(received),
        time(all.load.load_ms / 1e3),
    );
    Ok(())
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
