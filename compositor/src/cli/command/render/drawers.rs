//! Whoever draws the frames of a sequence: one drawer for all, or one for each step of a series.

use std::borrow::Cow;

use brickcast_volume::lod::Lod;
use brickcast_volume::scene::{Scene, Transport};

use super::drawer::Drawer;
use super::frames::Frames;
use super::plan::RenderPlan;
use super::scenes::ScenesPlan;
use super::steps::Steps;
use crate::cli::failure::Failure;
use crate::plan::StoreFacts;
use crate::session::{Frame, LoadStats};

#[derive(Debug)]
pub(super) enum Drawers {
    One(Box<Drawer>),
    Steps(Box<Steps>),
}

/// Of what a frame was drawn.
#[derive(Debug)]
pub(super) struct Drawn<'a> {
    pub(super) store: Cow<'a, StoreFacts>,
    pub(super) lod: Lod,
    /// Of a series.
    pub(super) step: Option<usize>,
}

impl<'a> Drawn<'a> {
    pub(super) fn by(drawer: &'a Drawer, step: Option<usize>) -> Self {
        Self { store: Cow::Borrowed(drawer.store()), lod: drawer.lod(), step }
    }
}

impl Drawers {
    /// That of the frame that was drawn last, if it could be drawn.
    pub(super) fn drawer(&mut self) -> Option<&mut Drawer> {
        match self {
            Self::One(drawer) => Some(drawer),
            Self::Steps(steps) => steps.drawer(),
        }
    }

    /// Of what the last frame was drawn.
    pub(super) fn drawn(&self) -> Drawn<'_> {
        match self {
            Self::One(drawer) => Drawn::by(drawer, None),
            Self::Steps(steps) => steps.drawn(),
        }
    }

    /// Loads what the first frame shows.
    ///
    /// # Errors
    /// As [`Drawer::load`]; not of a series, whose next step may be whole.
    pub(super) async fn load(&mut self, scene: &Scene) -> Result<LoadStats, Failure> {
        match self {
            Self::One(drawer) => Ok(drawer.load(scene).await?),
            Self::Steps(steps) => Ok(steps.load(scene).await),
        }
    }

    /// Draws the `i`-th frame.
    ///
    /// # Errors
    /// As [`Drawer::render`]; not of a series.
    pub(super) async fn render(
        &mut self,
        plan: &RenderPlan,
        frames: &Frames<'_>,
        i: usize,
        (scene, transport): (&Scene, Transport),
    ) -> Result<Frame, Failure> {
        let deadline = plan.nodes.deadline;
        // Levels that were chosen frame by frame are drawn so again.
        let draw_by = match &plan.scenes {
            ScenesPlan::Drawn(redraw) => redraw.manifests.get(i).map(|manifest| &manifest.lod),
            ScenesPlan::Asked { .. } => None,
        };
        let draw_by = draw_by.filter(|lod| matches!(lod, Lod::Set(_)));
        match self {
            Self::One(drawer) => {
                if let Some(lod) = draw_by {
                    drawer.draw_by(lod);
                }
                Ok(drawer.render(scene, transport, deadline).await?)
            }
            Self::Steps(steps) => {
                let ahead = |frame: usize| frames.each().nth(frame).map(|(scene, _)| scene);
                Ok(steps.render(i, (scene, transport, deadline), ahead, draw_by).await)
            }
        }
    }
}
