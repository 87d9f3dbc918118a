//! One picture, coarse first: each is complete, and takes the place of the one before it.

use std::time::{Duration, Instant};

use brickcast_volume::lod::{ChangeBounds, Untold};
use brickcast_volume::scene::{Scene, Transport};
use futures_util::future::OptionFuture;
use tokio::task::JoinHandle;

use super::drawer::Drawer;
use super::drawers::Drawn;
use super::frames::Frames;
use super::plan::RenderPlan;
use super::sequence::{Files, Sequence, tell_hidden, warn_of_tight_budgets};
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cli::scene::nothing_shows;
use crate::session::{Frame, LoadStats, SessionError};
use crate::words::time;

type Changing = JoinHandle<Result<ChangeBounds, Untold>>;

/// Draws and writes one picture after the other, up to what the plan asks for; a file that is there is complete.
///
/// # Errors
/// As [`super::sequence::draw`]. The pictures that were written before stay.
pub(super) async fn draw(
    plan: &RenderPlan,
    frames: &Frames<'_>,
    (drawer, step): (&mut Drawer, Option<usize>),
    quiet: bool,
) -> Result<Sequence, Failure> {
    let (started, mut all) = (Instant::now(), Sequence::new(LoadStats::default()));
    let Some((scene, transport)) = frames.each().next() else { return Ok(all) };
    let stages = drawer.stages(&scene, &plan.lod)?;
    let (count, mut changing) = (stages.len(), None);
    for (i, lod) in stages.into_iter().enumerate() {
        drawer.draw_by(&lod);
        let (load, mut frame) = match drawn(drawer, &scene, (transport, plan.nodes.deadline)).await {
            Ok(drawn) if i == 0 || drawn.1.complete => drawn,
            Err(error) if i == 0 => return Err(error.into()),
            // What is there is worth more than a part of what was to follow.
            unfinished => {
                let why = unfinished.map_or_else(|error| error.to_string(), |(_, frame)| frame.problems.join("; "));
                all.unfinished = Some(format!("picture {} of {count}: {why}", i + 1));
                break;
            }
        };
        let mut files = Files::open(plan, frames)?;
        if all.load.fits {
            warn_of_tight_budgets(&load);
        }
        all.load.join(&load);
        let since = started.elapsed().as_secs_f64();
        if i == 0 {
            all.first_frame_ms = since * 1e3;
        }
        all.problems.extend(frame.problems.iter().cloned());
        let is_empty = frame.complete && nothing_shows::is_empty(&frame.picture);
        // Of the last picture, not of all that came before it.
        all.empty = usize::from(is_empty);
        plan.hidden.mark(&mut frame, &scene, &drawer.store().manifest.geometry);
        all.hidden = plan.hidden.told(&frame).into_iter().collect();
        files.push(
            Drawn::by(drawer, step),
            (&scene, transport),
            &frame,
            is_empty.then_some(frames.outlook.as_ref()),
        )?;
        all.written = files.finish()?;
        // The picture does not wait for what is told of the one before it.
        tell_change(&mut changing, &mut all, quiet).await?;
        say(quiet, &in_words((i + 1, count), &frame, since))?;
        // Not twice in the same words.
        if all.frames.last().is_none_or(|last| last.hidden != frame.stats.hidden) {
            tell_hidden(&frame, quiet)?;
        }
        all.frames.push(frame.stats);
        if i + 1 < count {
            changing = drawer.changes(&scene);
        }
        // What follows would lack the same.
        if !all.problems.is_empty() {
            break;
        }
    }
    tell_change(&mut changing, &mut all, quiet).await?;
    Ok(all)
}

/// Tells how far full resolution is from the last picture at the most, which was found while the next one was drawn.
async fn tell_change(changing: &mut Option<Changing>, all: &mut Sequence, quiet: bool) -> Result<(), Failure> {
    let Some(Ok(change)) = OptionFuture::from(changing.take()).await else { return Ok(()) };
    let told = match &change {
        Ok(change) => change.in_words(),
        // Once is enough.
        Err(_) if all.frames.len() > 1 => return Ok(()),
        Err(why) => format!("how far full resolution is from it is not known: {why}"),
    };
    if let Some(lod) = all.frames.last_mut().and_then(|frame| frame.lod.as_mut()) {
        lod.change = change.ok();
    }
    say(quiet, &format!("  {told}"))
}

async fn drawn(
    drawer: &mut Drawer,
    scene: &Scene,
    (transport, deadline): (Transport, Duration),
) -> Result<(LoadStats, Frame), SessionError> {
    let load = drawer.load(scene).await?;
    Ok((load, drawer.render(scene, transport, deadline).await?))
}

fn in_words((stage, count): (usize, usize), frame: &Frame, since: f64) -> String {
    let by = match &frame.stats.lod {
        None => "full resolution".to_owned(),
        Some(lod) => {
            let share = 100.0 * lod.share_of_pixels;
            format!("{}; {share:.0} % of the pixels at full resolution", lod.in_words())
        }
    };
    format!("picture {stage} of {count} after {}: {by}", time(since))
}
