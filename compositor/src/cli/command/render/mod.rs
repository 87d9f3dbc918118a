//! `brickcast render`: arguments become a plan, a store makes frames of it, nodes render them, and they are told of.

mod drawer;
mod drawers;
mod dry_run;
mod frames;
mod hidden;
mod kept;
mod manifest;
mod nodes;
mod output_paths;
mod plan;
mod progressive;
mod proof;
mod redraw;
mod report;
mod scenes;
mod sequence;
mod source;
mod steps;
mod time;

use self::drawer::Drawer;
use self::drawers::Drawers;
use self::frames::Frames;
use self::plan::RenderPlan;
use self::report::report;
use self::steps::Steps;
use self::time::TimePlan;
use crate::cli::args::RenderArgs;
use crate::cli::failure::Failure;
use crate::cli::input::tell;
use crate::cli::say::say;
use crate::cli::source::Source;
use crate::plan::StoreFacts;
use crate::session::Session;

pub(crate) use self::manifest::{Origin, manifest};

/// # Errors
/// Usage before anything opens; failures that name what was wrong; [`Failure::Incomplete`] where a frame was written
/// that is not complete; [`Failure::Coarse`] where parts in view were drawn coarser than they are.
pub async fn run(args: RenderArgs, quiet: bool) -> Result<(), Failure> {
    let plan = RenderPlan::of(args)?;
    if let Some(time) = &plan.time {
        return over_time(&plan, time, quiet).await;
    }
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
    drawer.balance(plan.balance.clone());
    let store = drawer.store().clone();
    draw(plan, &store, Drawers::One(Box::new(drawer)), quiet).await
}

/// Steps of a series.
async fn over_time(plan: &RenderPlan, time: &TimePlan, quiet: bool) -> Result<(), Failure> {
    time.tell(quiet)?;
    if plan.dry_run {
        return dry_run::run(plan, Source::Store(time.series.open_step(time.first())?)).await;
    }
    let place = time.series.place();
    let (reached, embedded) = plan.nodes.reach(place, quiet).await?;
    let steps = Steps::open(plan, time, reached).await?;
    let store = steps.like().clone();
    tell(place, &store.manifest);
    let result = draw(plan, &store, Drawers::Steps(Box::new(steps)), quiet).await;
    drop(embedded);
    result
}

/// `store`: what scenes are made by.
async fn draw(plan: &RenderPlan, store: &StoreFacts, mut drawers: Drawers, quiet: bool) -> Result<(), Failure> {
    let frames = Frames::on(&plan.scenes, store)?;
    frames.tell(&store.manifest, quiet)?;
    plan.unbalanced.as_ref().map_or(Ok(()), |note| say(quiet, note))?;
    let step = drawers.drawn().step;
    let all = match drawers.drawer().filter(|_| plan.progressive) {
        Some(drawer) => progressive::draw(plan, &frames, (drawer, step), quiet).await?,
        None => sequence::draw(plan, &frames, &mut drawers, quiet).await?,
    };
    report(plan, &all, &frames, quiet)
}
