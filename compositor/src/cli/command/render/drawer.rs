//! Whoever draws a render's frames: a session of the store or of one of its levels, or one of every level.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::lod::{ChangeBounds, LevelSet, Lod, Rule, Selection, Untold};
use brickcast_volume::scene::{Scene, Transport};
use tokio::task::JoinHandle;

use super::scenes::ScenesPlan;
use crate::balance::Settings;
use crate::cli::args::{BalanceArg, RenderArgs};
use crate::cli::failure::Failure;
use crate::plan::StoreFacts;
use crate::session::ahead::stores_of;
use crate::session::levels::LevelSessions;
use crate::session::levels::pace::FramePace;
use crate::session::{Frame, LoadStats, Session, SessionError};

/// Which levels are asked for, with what else was asked.
///
/// # Errors
/// Usage: flags of levels that contradict themselves; what is not told of several levels.
pub(super) fn asked(args: &RenderArgs, scenes: &ScenesPlan) -> Result<Lod, Failure> {
    let lod = match scenes {
        ScenesPlan::Asked { .. } => args.lod.lod()?,
        ScenesPlan::Drawn(redraw) => redraw.lod()?,
    };
    if let Lod::Full | Lod::Level(_) = lod {
        return Ok(lod);
    }
    let of_one = "is told of one level only: leave --lod auto out, or name a level";
    let flags = [("--audit", args.audit), ("--error", args.error.is_some()), ("--dry-run", args.dry_run)];
    if let Some((flag, _)) = flags.into_iter().find(|(_, is_asked)| *is_asked) {
        return Err(Failure::usage(anyhow!("{flag} {of_one}")));
    }
    if args.lod.frame_budget.is_some() && args.scene.exact {
        return Err(Failure::usage(anyhow!(
            "--frame-budget goes by the time that frames take, so that no two pictures need be the same: leave out \
             --exact, or draw a picture's set of levels again by --scene"
        )));
    }
    Ok(lod)
}

/// Is the picture written coarse first?
///
/// # Errors
/// Usage: with what is no single picture of the volume.
pub(super) fn is_progressive(args: &RenderArgs, scenes: &ScenesPlan, lod: &Lod) -> Result<bool, Failure> {
    if !args.lod.progressive {
        return Ok(false);
    }
    let is_drawn = matches!(scenes, ScenesPlan::Drawn(_));
    let others = [
        ("--scene draws again what was drawn", is_drawn),
        ("a sequence of frames has each once", scenes.count() > 1),
        ("--frame-budget draws as fine as it can at once", args.lod.frame_budget.is_some()),
        ("--audit compares the last picture", args.audit),
        ("--error is of the last picture", args.error.is_some()),
        ("--dry-run draws nothing", args.dry_run),
        ("--lod with a number draws one level", matches!(lod, Lod::Level(_))),
    ];
    match others.into_iter().find(|(_, is_asked)| *is_asked) {
        Some((why, _)) => Err(Failure::usage(anyhow!("--progressive: {why}: leave one of the two out"))),
        None => Ok(true),
    }
}

/// What to say where frames of several levels were to be balanced.
pub(super) fn unbalanced(args: &RenderArgs, lod: &Lod) -> Option<String> {
    let asked = args.balance.balance.filter(|asked| *asked != BalanceArg::Off)?;
    let word = if asked == BalanceArg::Static { "static" } else { "dynamic" };
    matches!(lod, Lod::Auto(_) | Lod::Set(_)).then(|| {
        format!(
            "--balance {word}: frames of several levels are not balanced yet; each level's chunks are shared out evenly"
        )
    })
}

/// Sessions, and which levels they draw.
#[derive(Debug)]
pub(super) struct Drawer {
    /// The store: its level 0, by which scenes are made.
    store: StoreFacts,
    sessions: Sessions,
}

#[derive(Debug)]
enum Sessions {
    /// And what it draws.
    One(Box<Session>, Lod),
    Levels(Box<LevelSessions>, By),
}

/// By what several levels are drawn.
#[derive(Debug)]
enum By {
    /// The volume itself.
    Full,
    Rule(Rule),
    Set(LevelSet),
    /// No finer than the rule asks for, and frames' times allow.
    Time(Rule, Box<FramePace>),
}

impl Drawer {
    /// `session` is of the store itself; `progressive`: other levels are drawn, too.
    ///
    /// # Errors
    /// Usage: a level that is not there. Nodes that cannot be reached again, or lack a level.
    pub(super) async fn open(
        session: Session,
        lod: &Lod,
        progressive: bool,
        frame_budget: Option<Duration>,
    ) -> Result<Self, Failure> {
        let store = session.store().clone();
        let by = match (lod, frame_budget) {
            (Lod::Full, _) if progressive => By::Full,
            (Lod::Full, _) => return Ok(Self { store, sessions: Sessions::One(Box::new(session), Lod::Full) }),
            (Lod::Level(level), _) => {
                let session = at_level(&session, *level).await?;
                return Ok(Self { store, sessions: Sessions::One(Box::new(session), lod.clone()) });
            }
            (Lod::Auto(rule), Some(limit)) => By::Time(*rule, Box::new(FramePace::new(limit))),
            (Lod::Auto(rule), None) => By::Rule(*rule),
            (Lod::Set(set), _) => By::Set(set.clone()),
        };
        Ok(Self { store, sessions: Sessions::Levels(Box::new(LevelSessions::open(session).await?), by) })
    }

    pub(super) fn store(&self) -> &StoreFacts {
        &self.store
    }

    /// The session where all is drawn on one level.
    pub(super) fn alone(&mut self) -> Option<&mut Session> {
        match &mut self.sessions {
            Sessions::One(session, _) => Some(session),
            Sessions::Levels(..) => None,
        }
    }

    pub(super) fn balance(&mut self, settings: Settings) {
        if let Some(session) = self.alone() {
            session.balance(settings);
        }
    }

    pub(super) async fn load(&mut self, scene: &Scene) -> Result<LoadStats, SessionError> {
        match &mut self.sessions {
            Sessions::One(session, _) => session.load(scene).await,
            Sessions::Levels(levels, by) => match by.selected(levels, scene)? {
                Some(selection) => levels.load(scene, &selection).await,
                None if matches!(by, By::Full) => levels.load_full(scene).await,
                // What is loaded follows from what frames take.
                None => Ok(LoadStats::default()),
            },
        }
    }

    pub(super) async fn render(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        let started = Instant::now();
        if let Sessions::One(session, lod) = &mut self.sessions {
            let frame = session.render(scene, transport, deadline).await?;
            let is_full = matches!(lod, Lod::Full);
            if frame.complete || frame.lacking.is_empty() || !is_full || self.store.manifest.levels.is_empty() {
                return frame.of_something();
            }
            // What cannot be read is drawn of a coarser level.
            match LevelSessions::open(Session::on(session.cluster().clone())).await {
                Ok(mut levels) => {
                    levels.draw_instead_of(&frame.lacking);
                    self.sessions = Sessions::Levels(Box::new(levels), By::Full);
                }
                Err(error) => {
                    tracing::debug!("no other level: {error}");
                    return frame.of_something();
                }
            }
        }
        let deadline = deadline.saturating_sub(started.elapsed());
        match &mut self.sessions {
            Sessions::One(session, _) => session.render(scene, transport, deadline).await,
            Sessions::Levels(levels, By::Time(rule, pace)) => {
                levels.render_within(scene, (*rule, pace), transport, deadline).await
            }
            Sessions::Levels(levels, by) => match by.selected(levels, scene)? {
                Some(selection) => levels.render(scene, &selection, transport, deadline).await,
                None => levels.render_full(scene, transport, deadline).await,
            },
        }
    }

    /// The stores that its frames are of.
    pub(super) fn stores(&self) -> Vec<StoreHash> {
        stores_of(&self.store)
    }

    /// Loads what it will render of `scene`, beside frames of the stores `keep`.
    pub(super) async fn load_ahead(&mut self, scene: &Scene, keep: &[StoreHash]) {
        match &mut self.sessions {
            Sessions::One(session, _) => session.load_ahead(scene, keep).await,
            Sessions::Levels(levels, by) => {
                if let Ok(Some(selection)) = by.selected(levels, scene) {
                    levels.draw(scene, &selection);
                    levels.load_ahead(scene, keep).await;
                }
            }
        }
    }

    /// Lets go of what was loaded; `scene` was shown.
    pub(super) async fn let_go(&mut self, scene: &Scene) {
        match &mut self.sessions {
            Sessions::One(session, _) => session.let_go(scene).await,
            Sessions::Levels(levels, _) => levels.let_go(scene).await,
        }
    }

    /// What the last frame was drawn of, for whoever draws it again.
    pub(super) fn lod(&self) -> Lod {
        if let Sessions::Levels(levels, _) = &self.sessions
            && let Some(set) = levels.drawn_instead()
        {
            return Lod::Set(set);
        }
        match &self.sessions {
            Sessions::One(_, lod) => lod.clone(),
            Sessions::Levels(_, By::Full) => Lod::Full,
            Sessions::Levels(_, By::Rule(rule)) => Lod::Auto(*rule),
            Sessions::Levels(_, By::Set(set)) => Lod::Set(set.clone()),
            Sessions::Levels(_, By::Time(rule, pace)) => {
                pace.before().map_or(Lod::Auto(*rule), |selection| Lod::Set(selection.set()))
            }
        }
    }

    /// What comes before `last`, and that: by smaller and smaller errors, none of which chooses as the one before.
    ///
    /// # Errors
    /// A view that is none.
    pub(super) fn stages(&mut self, scene: &Scene, last: &Lod) -> Result<Vec<Lod>, SessionError> {
        let mut stages = Vec::new();
        if let Sessions::Levels(levels, by) = &mut self.sessions {
            let mut chosen = by.selected(levels, scene)?;
            let least = if let By::Rule(Rule::Error { pixels }) = by { *pixels } else { 0.0 };
            // From the last one back, so that what is left out is what a finer one repeats.
            for pixels in ERRORS.into_iter().filter(|&pixels| pixels > least) {
                let rule = Rule::Error { pixels };
                let selection = levels.select(scene, rule)?;
                if selection.used().any(|level| level > 0) && chosen.as_ref() != Some(&selection) {
                    stages.push(Lod::Auto(rule));
                }
                chosen = Some(selection);
            }
        }
        stages.reverse();
        stages.push(last.clone());
        Ok(stages)
    }

    /// Begins to find how far full resolution can be from what is drawn of several levels; nothing where all is.
    pub(super) fn changes(&mut self, scene: &Scene) -> Option<JoinHandle<Result<ChangeBounds, Untold>>> {
        let Sessions::Levels(levels, by) = &mut self.sessions else { return None };
        let selection = by.selected(levels, scene).ok()??;
        let changes = levels.changes(scene, &selection);
        Some(tokio::task::spawn_blocking(|| changes().map(|changes| changes.bounds())))
    }

    /// Draws by `lod` from now on, where several levels are drawn: one of [`Drawer::stages`], or a set.
    pub(super) fn draw_by(&mut self, lod: &Lod) {
        if let Sessions::Levels(_, by) = &mut self.sessions {
            *by = match lod {
                Lod::Auto(rule) => By::Rule(*rule),
                Lod::Set(set) => By::Set(set.clone()),
                Lod::Full | Lod::Level(_) => By::Full,
            };
        }
    }
}

impl By {
    /// Nothing where it is the volume itself, and where it follows from what frames take.
    fn selected(&self, levels: &mut LevelSessions, scene: &Scene) -> Result<Option<Selection>, SessionError> {
        Ok(match self {
            Self::Full | Self::Time(..) => None,
            Self::Rule(rule) => Some(levels.select(scene, *rule)?),
            Self::Set(set) => Some(levels.select_again(scene, set)?),
        })
    }
}

/// Pixel errors of the pictures before the last, the smallest first.
const ERRORS: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// # Errors
/// Usage: a level that is not there.
pub(super) async fn at_level(session: &Session, level: u8) -> Result<Session, Failure> {
    session.at_level(level).await.map_err(|error| match error {
        SessionError::NoLevel { .. } => Failure::usage(anyhow!("--lod {level}: {error}")),
        error => error.into(),
    })
}
