//! Frame after frame: rendered, written, told of, compared.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use brickcast_volume::scene::{Scene, Transport};

use super::frames::Frames;
use super::manifest::{Origin, manifest};
use super::plan::{RenderPlan, ScenesPlan};
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cli::scene::nothing_shows::{self, Outlook};
use crate::output::{Difference, FrameOptions, FrameWriter, PictureManifest, hatched, write_manifest};
use crate::session::audit::{self, Audit};
use crate::session::{Frame, FrameStats, LoadStats, Session};

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
    /// Complete frames that show nothing.
    pub(super) empty: usize,
    pub(super) written: Vec<std::path::PathBuf>,
}

/// The files of a sequence in the making.
struct Files<'a> {
    plan: &'a RenderPlan,
    writer: Option<FrameWriter>,
    /// Of an animation, whose one manifest is written at its end.
    manifests: Vec<PictureManifest>,
}

/// Renders and writes every frame.
///
/// # Errors
/// As [`Session::load`] and [`Session::render`]; files that cannot be written.
pub(super) async fn draw(
    plan: &RenderPlan,
    frames: &Frames<'_>,
    session: &mut Session,
    quiet: bool,
) -> Result<Sequence, Failure> {
    session.balance(plan.balance.clone());
    let mut files = Files::open(plan, frames)?;
    let started = Instant::now();
    let load = session.load(frames.first()).await?;
    if !load.fits {
        tracing::warn!(
            "a node's memory budget holds fewer bricks than it renders: frames load on the way and are slow"
        );
    }
    let mut all = Sequence {
        load,
        frames: Vec::new(),
        first_frame_ms: 0.0,
        audits: Vec::new(),
        differences: Vec::new(),
        problems: Vec::new(),
        empty: 0,
        written: Vec::new(),
    };
    for (i, (scene, transport)) in frames.each().enumerate() {
        let frame = session.render(&scene, transport, plan.nodes.deadline).await?;
        if i == 0 {
            all.first_frame_ms = started.elapsed().as_secs_f64() * 1e3;
        }
        all.problems.extend(frame.problems.iter().map(|p| format!("frame {i}: {p}")));
        let is_empty = frame.complete && nothing_shows::is_empty(&frame.picture);
        all.empty += usize::from(is_empty);
        let empty_because = is_empty.then_some(frames.outlook.as_ref());
        files.push(session, (&scene, transport), &frame, empty_because)?;
        if let (ScenesPlan::Drawn(redraw), true) = (&plan.scenes, frame.complete) {
            all.differences.extend(redraw.compare(i, &frame.picture, plan.background));
        }
        if plan.audit {
            match audited(session, (&scene, transport), &frame, plan.nodes.deadline).await {
                Ok(audit) => {
                    say(quiet, &audit.in_words())?;
                    all.audits.push(audit);
                }
                Err(why) => all.problems.push(format!("frame {i}: no audit: {why:#}")),
            }
        }
        all.frames.push(frame.stats);
    }
    all.written = files.finish()?;
    Ok(all)
}

impl<'a> Files<'a> {
    fn open(plan: &'a RenderPlan, frames: &Frames<'_>) -> Result<Self, Failure> {
        let writer = match &plan.output {
            Some(output) => {
                let background = output.format.background(plan.background);
                let options = FrameOptions { frames: plan.scenes.count(), fps: output.fps, background };
                Some(FrameWriter::open(output.format, &output.path, frames.first().view.size, options)?)
            }
            None => None,
        };
        Ok(Self { plan, writer, manifests: Vec::new() })
    }

    /// `empty_because` is there where nothing shows.
    fn push(
        &mut self,
        session: &Session,
        shown: (&Scene, Transport),
        frame: &Frame,
        empty_because: Option<Option<&Outlook>>,
    ) -> Result<(), Failure> {
        let (Some(output), Some(writer)) = (&self.plan.output, &mut self.writer) else { return Ok(()) };
        writer.push(&hatched(&frame.picture, &frame.missing_tiles))?;
        if !output.has_manifest {
            return Ok(());
        }
        let background = output.format.background(self.plan.background);
        let origin = Origin { path: self.plan.source.given.as_deref(), background };
        let mut manifest = manifest(session, shown, frame, origin);
        manifest.about.empty = empty_because.is_some();
        manifest.about.empty_because = empty_because.flatten().map(|outlook| outlook.why().to_owned());
        match writer.last_written() {
            Some(path) => drop(write_manifest(path, &serde_json::json!(manifest))?),
            None => self.manifests.push(manifest),
        }
        Ok(())
    }

    fn finish(self) -> Result<Vec<std::path::PathBuf>, Failure> {
        let (Some(output), Some(writer)) = (&self.plan.output, self.writer) else { return Ok(Vec::new()) };
        let written = writer.finish()?;
        if !self.manifests.is_empty() {
            write_manifest(&output.path, &serde_json::json!({ "frames": self.manifests }))?;
        }
        Ok(written)
    }
}

/// Renders the frame again without leaping and compares.
async fn audited(
    session: &mut Session,
    (scene, transport): (&Scene, Transport),
    frame: &Frame,
    deadline: Duration,
) -> anyhow::Result<Audit> {
    let store = session.store().clone();
    let view = scene.view_of(&store.manifest.geometry)?;
    let bounds = audit::bounds(&store, scene, &view);
    let without = session.render(&scene.without_leaping(), transport, deadline).await?;
    if !(frame.complete && without.complete) {
        return Err(anyhow!("a frame was not complete, so there is nothing to compare"));
    }
    Ok(audit::compare(&frame.picture, &without.picture, &bounds, scene, transport))
}
