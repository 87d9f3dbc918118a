//! What is proved of a frame: the intervals of its pixels, and the audit by them.

use brickcast_volume::scene::{Scene, Transport};

use super::plan::RenderPlan;
use crate::cli::failure::Failure;
use crate::output::animation::numbered;
use crate::output::exr;
use crate::session::audit::{self, Audit};
use crate::session::{Frame, Session};

/// A frame of intervals takes as long as some tens of ordinary ones (docs/figures/benchmarks.md), whose deadline the
/// user gave.
const FRAMES_OF_TIME: u32 = 60;

/// Renders the intervals of the `i`-th frame and, for an audit, the frame again without leaping; writes the widths. In
/// words, why there is nothing to say.
///
/// # Errors
/// As [`Session::render`]; widths that cannot be written.
pub(super) async fn of_frame(
    plan: &RenderPlan,
    session: &mut Session,
    (scene, transport): (&Scene, Transport),
    i: usize,
    frame: &Frame,
) -> Result<Result<Option<Audit>, String>, Failure> {
    const INCOMPLETE: &str = "a frame was not complete, so nothing is proved of it";
    let deadline = plan.nodes.deadline;
    let bounded = session.intervals(scene, deadline.saturating_mul(FRAMES_OF_TIME)).await?;
    let Some(intervals) = bounded.intervals.filter(|_| frame.complete) else { return Ok(Err(INCOMPLETE.to_owned())) };
    tracing::info!(
        "intervals: {:.0} and {:.0} ms, the picture {:.0} ms",
        bounded.lowest.stats.frame_ms,
        bounded.highest.stats.frame_ms,
        frame.stats.frame_ms
    );
    if let Some(path) = &plan.error {
        let count = plan.scenes.count();
        let path = if count == 1 { path.clone() } else { numbered(path, i as u32, count) };
        exr::write(&path, &intervals.width()?)?;
    }
    if !plan.audit {
        return Ok(Ok(None));
    }
    let without = session.render(&scene.without_leaping(), transport, deadline).await?;
    if !without.complete {
        return Ok(Err(INCOMPLETE.to_owned()));
    }
    let on_gpu = session.members().any(|(_, node)| node.backend != "cpu");
    let slack = audit::slack(scene, transport, on_gpu);
    Ok(Ok(Some(audit::compare(&frame.picture, &without.picture, &intervals, slack))))
}
