//! Whoever draws a render's frames: a session of the store or of one of its levels, or one of every level.

use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::lod::{Lod, Rule};
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::style::Mode;

use super::plan::ScenesPlan;
use crate::balance::Settings;
use crate::cli::args::{BalanceArg, RenderArgs};
use crate::cli::failure::Failure;
use crate::plan::StoreFacts;
use crate::session::levels::LevelSessions;
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
    let Lod::Auto(_) = lod else { return Ok(lod) };
    let of_one = "is told of one level only: leave --lod auto out, or name a level";
    let flags = [("--audit", args.audit), ("--error", args.error.is_some()), ("--dry-run", args.dry_run)];
    if let Some((flag, _)) = flags.into_iter().find(|(_, is_asked)| *is_asked) {
        return Err(Failure::usage(anyhow!("{flag} {of_one}")));
    }
    if scenes.modes().contains(&Mode::Average) {
        return Err(Failure::usage(anyhow!(
            "--mode average: levels take different numbers of samples, so their mean is none: leave --lod auto out, or \
             name a level"
        )));
    }
    Ok(lod)
}

/// What to say where frames of several levels were to be balanced.
pub(super) fn unbalanced(args: &RenderArgs, lod: Lod) -> Option<String> {
    let asked = args.balance.balance.filter(|asked| *asked != BalanceArg::Off)?;
    let word = if asked == BalanceArg::Static { "static" } else { "dynamic" };
    matches!(lod, Lod::Auto(_)).then(|| {
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
    One(Session),
    Levels(Box<LevelSessions>, Rule),
}

impl Drawer {
    /// `session` is of the store itself.
    ///
    /// # Errors
    /// Usage: a level that is not there. Nodes that cannot be reached again, or lack a level.
    pub(super) async fn open(session: Session, lod: Lod) -> Result<Self, Failure> {
        let store = session.store().clone();
        let sessions = match lod {
            Lod::Full => Sessions::One(session),
            Lod::Level(level) => Sessions::One(at_level(&session, level).await?),
            Lod::Auto(rule) => Sessions::Levels(Box::new(LevelSessions::open(session).await?), rule),
        };
        Ok(Self { store, sessions })
    }

    pub(super) fn store(&self) -> &StoreFacts {
        &self.store
    }

    /// The session where all is drawn on one level.
    pub(super) fn alone(&mut self) -> Option<&mut Session> {
        match &mut self.sessions {
            Sessions::One(session) => Some(session),
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
            Sessions::One(session) => session.load(scene).await,
            Sessions::Levels(levels, rule) => levels.load(scene, *rule).await,
        }
    }

    pub(super) async fn render(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        match &mut self.sessions {
            Sessions::One(session) => session.render(scene, transport, deadline).await,
            Sessions::Levels(levels, rule) => levels.render(scene, *rule, transport, deadline).await,
        }
    }
}

/// # Errors
/// Usage: a level that is not there.
pub(super) async fn at_level(session: &Session, level: u8) -> Result<Session, Failure> {
    session.at_level(level).await.map_err(|error| match error {
        SessionError::NoLevel { .. } => Failure::usage(anyhow!("--lod {level}: {error}")),
        error => error.into(),
    })
}
