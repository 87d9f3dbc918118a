//! Frames within a time: as fine as what was measured allows. The one choice of levels that does not follow from look
//! and view alone; whoever keeps the set draws the same picture again.

use std::time::Duration;

use brickcast_volume::lod::{Budget, Rule, Selection};
use brickcast_volume::scene::{Scene, Transport};
use futures_util::future::BoxFuture;

use super::LevelSessions;
use super::pace::FramePace;
use crate::session::error::SessionError;
use crate::session::layered::Frame;
use crate::session::stats::FrameBudget;

/// Frames that are drawn before the first one, at most: the coarsest, and what was learnt from that.
const ROUNDS: usize = 4;

impl LevelSessions {
    /// Renders one frame, no finer than `rule` asks for, and no finer than it can be drawn in time. Nothing is known
    /// before the first one: then some are drawn to learn, and the last of them is the frame. Bricks are loaded before
    /// the time is measured.
    ///
    /// # Errors
    /// As [`LevelSessions::render`].
    pub fn render_within<'a>(
        &'a mut self,
        scene: &'a Scene,
        (rule, pace): (Rule, &'a mut FramePace),
        transport: Transport,
        deadline: Duration,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(async move {
            let rounds = if pace.before().is_some() { 1 } else { ROUNDS };
            let mut selection = self.select_within(scene, rule, pace)?;
            let mut frame = self.measured(scene, &selection, pace, (transport, deadline)).await?;
            for _ in 1..rounds {
                selection = self.select_within(scene, rule, pace)?;
                if !frame.complete || pace.before() == Some(&selection) {
                    break;
                }
                frame = self.measured(scene, &selection, pace, (transport, deadline)).await?;
            }
            Ok(frame)
        })
    }

    fn select_within(&mut self, scene: &Scene, rule: Rule, pace: &FramePace) -> Result<Selection, SessionError> {
        let (levels, content) = self.seen(scene);
        let budget = Budget { cost: pace.affordable(), before: pace.before() };
        Ok(Selection::within(levels, content, rule, &scene.view, budget)?)
    }

    /// Renders what is selected, and learns what it took.
    async fn measured(
        &mut self,
        scene: &Scene,
        selection: &Selection,
        pace: &mut FramePace,
        (transport, deadline): (Transport, Duration),
    ) -> Result<Frame, SessionError> {
        self.load(scene, selection).await?;
        let mut frame = self.render(scene, selection, transport, deadline).await?;
        let cost = selection.cost(self.seen(scene).1, &scene.view)?;
        let expected_ms = pace.expected_ms(cost);
        let limit_ms = pace.limit_ms();
        if let Some(lod) = &mut frame.stats.lod {
            lod.frame_budget = Some(FrameBudget { limit_ms, expected_ms });
        }
        // What is not complete says nothing of what it takes.
        let ms = if frame.complete { frame.stats.frame_ms } else { 0.0 };
        pace.learn(selection.clone(), cost, ms);
        Ok(frame)
    }
}
