//! `brickcast render`: arguments become a plan, a store makes frames of it, nodes render them, and they are told of.

mod drawer;
mod dry_run;
mod frames;
mod kept;
mod manifest;
mod nodes;
mod output_paths;
mod plan;
mod progressive;
mod proof;
mod redraw;
mod report;
mod sequence;

use self::drawer::Drawer;
use self::frames::Frames;
use self::plan::RenderPlan;
use self::report::report;
use crate::cli::args::RenderArgs;
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::session::Session;

pub(crate) use self::manifest::{Origin, manifest};

/// # Errors
/// Usage before anything opens; failures that name what was wrong; [`Failure::Incomplete`] where a frame was written
/// that is not complete; [`Failure::Coarse`] where parts in view were drawn coarser than they are.
pub async fn run(args: RenderArgs, quiet: bool) -> Result<(), Failure> {
    let plan = RenderPlan::of(args)?;
    let source = plan.source.open(&plan.scenes, quiet)?;
    if plan.dry_run {
        return dry_run::run(&plan, source).await;
    }
    let (session, embedded) = plan.nodes.open_session(plan.source.shown(), &source, quiet).await?;
    let result = render(&plan, session, quiet).await;
    drop(embedded);
    result
}

async fn render(plan: &RenderPlan, session: Session, quiet: bool) -> Result<(), Failure> {
    plan.source.agree(&plan.scenes, session.store().hash)?;
    let mut drawer = Drawer::open(session, &plan.lod, plan.progressive, plan.frame_budget).await?;
    let store = drawer.store().clone();
    let frames = Frames::on(&plan.scenes, &store)?;
    frames.tell(&store.manifest, quiet)?;
    plan.unbalanced.as_ref().map_or(Ok(()), |note| say(quiet, note))?;
    let all = match plan.progressive {
        true => progressive::draw(plan, &frames, &mut drawer, quiet).await?,
        false => sequence::draw(plan, &frames, &mut drawer, quiet).await?,
    };
    report(plan, &all, &frames, quiet)
}
