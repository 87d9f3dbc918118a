//! Whoever draws pictures of the steps of a series (docs/adr/0024-time.md).
//!
//! The invariant: *a frame is drawn by a session of its own step's store, known by its hash: nodes and tables of one
//! step never serve another. Two steps at most are open at a time, and the next one is loaded beside the frames of
//! the one before.*

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::lod::Lod;
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::store::{Series, check_alike};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use super::drawer::Drawer;
use super::drawers::Drawn;
use super::nodes::Reached;
use super::plan::RenderPlan;
use super::time::TimePlan;
use crate::balance::Settings;
use crate::cli::failure::Failure;
use crate::cli::source::choice_of_step;
use crate::plan::StoreFacts;
use crate::session::{Frame, LoadStats, Session, StoreChoice};

/// How sessions of steps are opened.
#[derive(Debug, Clone)]
struct Opener {
    time: TimePlan,
    reached: Reached,
    lod: Lod,
    progressive: bool,
    frame_budget: Option<Duration>,
    balance: Settings,
    /// What all steps are like.
    like: Option<StoreFacts>,
}

impl Opener {
    async fn open(&self, step: usize) -> Result<Drawer, Failure> {
        let series = &self.time.series;
        let Some(entry) = series.manifest().steps.get(step) else { return Err(anyhow!("there is no step").into()) };
        let choice = self.reached.choice_of_step(series, step, entry.hash);
        let session = Session::open_through(self.reached.dial.clone(), &self.reached.addresses, choice).await?;
        let (got, want) = (session.store().hash, entry.hash);
        if got != want {
            return Err(anyhow!("it is the store {got}, the series names {want}: copy the right one there").into());
        }
        if let Some(like) = &self.like {
            check_alike(step, &session.store().manifest, &like.manifest)?;
        }
        let mut drawer = Drawer::open(session, &self.lod, self.progressive, self.frame_budget).await?;
        drawer.balance(self.balance.clone());
        Ok(drawer)
    }
}

/// Whoever draws frames over time.
#[derive(Debug)]
pub(super) struct Steps {
    opener: Arc<Opener>,
    fetches_ahead: bool,
    /// A step that was opened, or why it could not be.
    current: (usize, Result<Drawer, String>),
    next: Option<Next>,
    /// What the last frame of the current step showed.
    shown: Option<Scene>,
    /// What all steps are like.
    like: StoreFacts,
}

/// A step that is being opened, and loaded.
#[derive(Debug)]
struct Next {
    step: usize,
    opening: JoinHandle<Result<Drawer, Failure>>,
    /// Its turn has come: what is not loaded by then, its frames load.
    its_turn: oneshot::Sender<()>,
}

impl Steps {
    /// Opens the first step; what all are like is known from the first one that can be opened.
    ///
    /// # Errors
    /// None of the steps can be opened.
    pub(super) async fn open(plan: &RenderPlan, time: &TimePlan, reached: Reached) -> Result<Self, Failure> {
        let (lod, frame_budget, balance) = (plan.lod.clone(), plan.frame_budget, plan.balance.clone());
        let progressive = plan.progressive;
        let mut opener = Opener { time: time.clone(), reached, lod, progressive, frame_budget, balance, like: None };
        let mut tried: Vec<usize> = Vec::new();
        let mut first: Option<Result<Drawer, Failure>> = None;
        for &step in &time.steps {
            if tried.contains(&step) {
                continue;
            }
            tried.push(step);
            let opened = opener.open(step).await;
            if let Ok(drawer) = &opened {
                opener.like = Some(time.looked_at(drawer.store()));
            }
            if let Err(Failure::Usage(error)) = opened {
                return Err(Failure::Usage(error));
            }
            let is_there = opened.is_ok();
            if first.is_none() {
                first = Some(opened);
            }
            if is_there {
                break;
            }
        }
        let first = first.unwrap_or_else(|| Err(anyhow!("there is no step").into()));
        let Some(like) = opener.like.clone() else {
            let why = first.err().map(|failure| failure.message()).unwrap_or_default();
            let (place, step) = (time.series.place().display(), time.first());
            return Err(anyhow!("{place}: none of the steps can be shown; step {step}: {why}").into());
        };
        let current = (time.first(), first.map_err(|failure| failure.message()));
        let (opener, fetches_ahead) = (Arc::new(opener), plan.fetches_ahead);
        Ok(Self { opener, fetches_ahead, current, next: None, shown: None, like })
    }

    /// What all steps are like, and what a look is chosen by.
    pub(super) fn like(&self) -> &StoreFacts {
        &self.like
    }

    pub(super) fn drawer(&mut self) -> Option<&mut Drawer> {
        self.current.1.as_mut().ok()
    }

    /// Of what the last frame was drawn, or was to be.
    pub(super) fn drawn(&self) -> Drawn<'_> {
        let (step, drawer) = &self.current;
        match drawer {
            Ok(drawer) => Drawn::by(drawer, Some(*step)),
            Err(_) => {
                let entry = self.opener.time.series.manifest().steps.get(*step);
                let hash = entry.map_or(self.like.hash, |entry| entry.hash);
                let store = Cow::Owned(StoreFacts { hash, ..self.like.clone() });
                Drawn { store, lod: self.opener.lod.clone(), step: Some(*step) }
            }
        }
    }

    /// Loads what the first frame shows; a step that cannot be loaded cannot be shown.
    pub(super) async fn load(&mut self, scene: &Scene) -> LoadStats {
        let Ok(drawer) = &mut self.current.1 else { return LoadStats::default() };
        match drawer.load(scene).await {
            Ok(load) => load,
            Err(error) => {
                self.current.1 = Err(error.to_string());
                LoadStats::default()
            }
        }
    }

    /// Draws a frame of its step: one that shows nothing, and says why, where the step is missing or broken. `ahead`:
    /// the scene of a later frame.
    pub(super) async fn render(
        &mut self,
        frame: usize,
        (scene, transport, deadline): (&Scene, Transport, Duration),
        ahead: impl Fn(usize) -> Option<Scene>,
        draw_by: Option<&Lod>,
    ) -> Frame {
        self.turn_to(self.opener.time.step_of(frame)).await;
        if self.fetches_ahead
            && self.next.is_none()
            && let Some(next) = self.opener.time.next_after(frame)
            && let Some(scene) = ahead(next)
        {
            self.fetch(self.opener.time.step_of(next), scene);
        }
        let words = self.opener.time.words(self.current.0);
        let drawn = match &mut self.current.1 {
            Ok(drawer) => {
                if let Some(lod) = draw_by {
                    drawer.draw_by(lod);
                }
                drawer.render(scene, transport, deadline).await.map_err(|error| error.to_string())
            }
            Err(why) => Err(why.clone()),
        };
        self.shown = Some(scene.clone());
        match drawn {
            Ok(mut frame) => {
                frame.problems.iter_mut().for_each(|problem| *problem = format!("{words}: {problem}"));
                frame
            }
            Err(why) => Frame::of_nothing(scene, format!("{words} is not shown: {why}")),
        }
    }

    /// Makes this step the current one; the bricks of the one before are let go of.
    async fn turn_to(&mut self, step: usize) {
        if self.current.0 == step {
            return;
        }
        let opened = match self.next.take() {
            Some(Next { step: next, opening, its_turn }) if next == step => {
                its_turn.send(()).ok();
                opening.await.unwrap_or_else(|error| Err(anyhow!("opening it ended: {error}").into()))
            }
            other => {
                if let Some(other) = other {
                    other.opening.abort();
                }
                self.opener.open(step).await
            }
        };
        let opened = opened.map_err(|failure| failure.message());
        let (_, before) = std::mem::replace(&mut self.current, (step, opened));
        if let (Ok(mut before), Some(scene)) = (before, self.shown.take()) {
            before.let_go(&scene).await;
        }
    }

    /// Opens a step meanwhile, and loads what `scene` shows of it.
    fn fetch(&mut self, step: usize, scene: Scene) {
        let shown = self.current.1.as_ref().map(Drawer::stores).unwrap_or_default();
        let opener = self.opener.clone();
        let (its_turn, turn) = oneshot::channel();
        let opening = async move {
            let mut drawer = opener.open(step).await?;
            let keep = [shown, drawer.stores()].concat();
            tokio::select! {
                () = drawer.load_ahead(&scene, &keep) => {}
                _ = turn => {}
            }
            Ok(drawer)
        };
        self.next = Some(Next { step, opening: tokio::spawn(opening), its_turn });
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        if let Some(next) = &self.next {
            next.opening.abort();
        }
    }
}

impl Reached {
    /// Nodes of this process have the series for their data; others find a step by its hash, unless it lies on a server
    /// that does not list what it has.
    fn choice_of_step(&self, series: &Series, step: usize, hash: StoreHash) -> StoreChoice {
        match self.are_embedded {
            true => StoreChoice::Name(step.to_string()),
            false => choice_of_step(series, step, hash),
        }
    }
}
