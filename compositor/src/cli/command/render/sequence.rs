//! Frame after frame: rendered, written, told of, compared.

use std::time::Instant;

use brickcast_volume::leftovers::Farewell;
use brickcast_volume::lod::HiddenNote;
use brickcast_volume::scene::{Scene, Transport};

use super::drawer::Drawer;
use super::drawers::{Drawers, Drawn};
use super::frames::Frames;
use super::kept::Unended;
use super::manifest::{Origin, manifest};
use super::plan::RenderPlan;
use super::proof;
use super::scenes::ScenesPlan;
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::{answer, say};
use crate::cli::scene::nothing_shows::{self, Outlook};
use crate::output::{Difference, FrameOptions, FrameWriter, animation_manifest, hatched, write_manifest};
use crate::session::audit::Audit;
use crate::session::{Frame, FrameStats, LoadStats};

/// What became of a sequence.
#[derive(Debug)]
pub(super) struct Sequence {
    pub(super) load: LoadStats,
    pub(super) frames: Vec<FrameStats>,
    pub(super) first_frame_ms: f64,
    pub(super) audits: Vec<Audit>,
    /// Against the pictures that were drawn before.
    pub(super) differences: Vec<Difference>,
    /// What is missing and why; empty where all frames are complete.
    pub(super) problems: Vec<String>,
    /// Why no finer picture followed the last one, which is complete.
    pub(super) unfinished: Option<String>,
    /// Complete frames that show nothing.
    pub(super) empty: usize,
    pub(super) written: Vec<std::path::PathBuf>,
    /// Of each frame, where a file of it is asked for.
    pub(super) hidden: Vec<serde_json::Value>,
}

impl Sequence {
    /// Nothing yet but what was loaded.
    pub(super) fn new(load: LoadStats) -> Self {
        Self {
            load,
            frames: Vec::new(),
            first_frame_ms: 0.0,
            audits: Vec::new(),
            differences: Vec::new(),
            problems: Vec::new(),
            unfinished: None,
            empty: 0,
            written: Vec::new(),
            hidden: Vec::new(),
        }
    }
}

/// The files of a sequence in the making.
pub(super) struct Files<'a> {
    plan: &'a RenderPlan,
    written: Option<(FrameWriter, Unended)>,
    /// While there is a writer.
    _farewell: Option<Farewell>,
}

/// Where nodes cannot hold what they render.
pub(super) fn warn_of_tight_budgets(load: &LoadStats) {
    if !load.fits {
        tracing::warn!(
            "a node's memory budget holds fewer bricks than it renders: frames load on the way and are slow"
        );
    }
}

/// Renders and writes every frame.
///
/// # Errors
/// As [`Session::load`] and [`Session::render`]; files that cannot be written. The frames that were done stay.
pub(super) async fn draw(
    plan: &RenderPlan,
    frames: &Frames<'_>,
    drawers: &mut Drawers,
    quiet: bool,
) -> Result<Sequence, Failure> {
    let mut files = Files::open(plan, frames)?;
    let started = Instant::now();
    let load = drawers.load(frames.first()).await?;
    warn_of_tight_budgets(&load);
    let flag = if plan.audit { "--audit" } else { "--error" };
    let alone = drawers.drawer().and_then(Drawer::alone);
    let has_regions = alone.is_some_and(|session| session.store().manifest.regions.is_some());
    if (plan.audit || plan.error.is_some()) && !has_regions {
        let why = "the store has no regions, so no ray leaps, and the picture without leaping is the same";
        say(quiet, &format!("{flag}: {why}; stores that were prepared with --segmentation-range W have some"))?;
    }
    let mut all = Sequence::new(load);
    let drawn = each(plan, frames, drawers, (&mut files, &mut all), (started, quiet)).await;
    if let Err(failure) = drawn {
        if let Some(kept) = files.keep() {
            say(quiet, &kept)?;
        }
        return Err(failure);
    }
    all.written = files.finish()?;
    Ok(all)
}

async fn each(
    plan: &RenderPlan,
    frames: &Frames<'_>,
    drawers: &mut Drawers,
    (files, all): (&mut Files<'_>, &mut Sequence),
    (started, quiet): (Instant, bool),
) -> Result<(), Failure> {
    let count = plan.scenes.count();
    let bar = (count > 1).then(|| Bar::counting(&plan.words(), "frames"));
    let far = |done: usize| bar.iter().for_each(|bar| bar.at(done as u64, count.into()));
    far(0);
    for (i, (scene, transport)) in frames.each().enumerate() {
        let mut frame = drawers.render(plan, frames, i, (&scene, transport)).await?;
        if i == 0 {
            all.first_frame_ms = started.elapsed().as_secs_f64() * 1e3;
            frame.stats.lod.as_ref().map_or(Ok(()), |lod| say(quiet, &lod.in_words()))?;
            tell_hidden(&frame, quiet)?;
        }
        all.problems.extend(frame.problems.iter().map(|p| format!("frame {i}: {p}")));
        let is_empty = frame.complete && nothing_shows::is_empty(&frame.picture);
        all.empty += usize::from(is_empty);
        plan.hidden.mark(&mut frame, &scene, &drawers.drawn().store.manifest.geometry);
        all.hidden.extend(plan.hidden.told(&frame));
        let empty_because = is_empty.then_some(frames.outlook.as_ref());
        files.push(drawers.drawn(), (&scene, transport), &frame, empty_because)?;
        if let (ScenesPlan::Drawn(redraw), true) = (&plan.scenes, frame.complete) {
            all.differences.extend(redraw.compare(i, &frame.picture, plan.background));
        }
        let alone = drawers.drawer().and_then(Drawer::alone);
        let is_proved = plan.audit || plan.error.is_some();
        if is_proved && alone.is_none() {
            all.problems.push(format!("frame {i}: no proof, which is of full resolution: a part was drawn coarser"));
        }
        if let (true, Some(session)) = (is_proved, alone) {
            match proof::of_frame(plan, session, (&scene, transport), i, &frame).await? {
                Ok(audit) => {
                    audit.map_or(Ok(()), |audit| answer(quiet, &audit.in_words()))?;
                    all.audits.extend(audit);
                }
                Err(why) => all.problems.push(format!("frame {i}: {why}")),
            }
        }
        all.frames.push(frame.stats);
        far(i + 1);
    }
    Ok(())
}

/// What coarser levels hide of a frame, for people.
pub(super) fn tell_hidden(frame: &Frame, quiet: bool) -> Result<(), Failure> {
    let words = frame.stats.hidden.as_ref().and_then(HiddenNote::in_words);
    words.map_or(Ok(()), |words| say(quiet, &words))
}

impl<'a> Files<'a> {
    pub(super) fn open(plan: &'a RenderPlan, frames: &Frames<'_>) -> Result<Self, Failure> {
        let written = match &plan.output {
            Some(output) => {
                let background = output.format.background(plan.background);
                let options = FrameOptions { frames: plan.scenes.count(), fps: output.fps, background };
                let writer = FrameWriter::open(output.format, &output.path, frames.first().view.size, options)?;
                let unended = Unended::new(writer.keeper(), output.has_manifest);
                Some((writer, unended))
            }
            None => None,
        };
        let farewell = written.as_ref().map(|(_, unended)| unended.farewell());
        Ok(Self { plan, written, _farewell: farewell })
    }

    /// `empty_because` is there where nothing shows.
    pub(super) fn push(
        &mut self,
        drawn: Drawn<'_>,
        shown: (&Scene, Transport),
        frame: &Frame,
        empty_because: Option<Option<&Outlook>>,
    ) -> Result<(), Failure> {
        let (Some(output), Some((writer, unended))) = (&self.plan.output, &mut self.written) else { return Ok(()) };
        let picture = hatched(&frame.picture, &frame.missing_tiles);
        if !output.has_manifest {
            return Ok(writer.push(&picture)?);
        }
        let background = output.format.background(self.plan.background);
        let origin = Origin { path: self.plan.source.given.as_deref(), background, lod: drawn.lod, step: drawn.step };
        let mut manifest = manifest(&drawn.store, shown, frame, origin);
        manifest.marks_hidden = self.plan.hidden.marks;
        manifest.about.empty = empty_because.is_some();
        manifest.about.empty_because = empty_because.flatten().map(|outlook| outlook.why().to_owned());
        if output.format.is_animation() {
            unended.tell(manifest);
            return Ok(writer.push(&picture)?);
        }
        writer.push(&picture)?;
        writer.last_written().map_or(Ok(()), |path| {
            write_manifest(path, &serde_json::json!(manifest))?;
            Ok(())
        })
    }

    /// Keeps the frames that are done, and says what that is.
    fn keep(&self) -> Option<String> {
        self.written.as_ref()?.1.keep(false)
    }

    pub(super) fn finish(self) -> Result<Vec<std::path::PathBuf>, Failure> {
        let (Some(output), Some((writer, unended))) = (&self.plan.output, self.written) else { return Ok(Vec::new()) };
        let written = writer.finish()?;
        let count = self.plan.scenes.count();
        if let Some(manifests) = unended.told(count).filter(|told| !told.is_empty()) {
            write_manifest(&output.path, &animation_manifest(&manifests, count))?;
        }
        Ok(written)
    }
}
