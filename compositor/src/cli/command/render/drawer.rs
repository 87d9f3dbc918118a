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

/// Is the picture written coarse first?
///
/// # Errors
/// Usage: with what is no single picture of the volume.
pub(super) fn is_progressive(args: &RenderArgs, scenes: &ScenesPlan, lod: Lod) -> Result<bool, Failure> {
    if !args.lod.progressive {
        return Ok(false);
    }
    let is_drawn = matches!(scenes, ScenesPlan::Drawn(_));
    let others = [
        ("--scene draws again what was drawn", is_drawn),
        ("a sequence of frames has each once", scenes.count() > 1),
        ("--audit compares the last picture", args.audit),
        ("--error is of the last picture", args.error.is_some()),
        ("--dry-run draws nothing", args.dry_run),
        ("--lod with a number draws one level", matches!(lod, Lod::Level(_))),
        ("--mode average has no mean of several levels", scenes.modes().contains(&Mode::Average)),
    ];
    match others.into_iter().find(|(_, is_asked)| *is_asked) {
        Some((why, _)) => Err(Failure::usage(anyhow!("--progressive: {why}: leave one of the two out"))),
        None => Ok(true),
    }
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
    /// By the rule, or the volume itself.
    Levels(Box<LevelSessions>, Option<Rule>),
}

impl Drawer {
    /// `session` is of the store itself; `progressive`: other levels are drawn, too.
    ///
    /// # Errors
    /// Usage: a level that is not there. Nodes that cannot be reached again, or lack a level.
    pub(super) async fn open(session: Session, lod: Lod, progressive: bool) -> Result<Self, Failure> {
        let store = session.store().clone();
        let sessions = match lod {
            Lod::Full if progressive => Sessions::Levels(Box::new(LevelSessions::open(session).await?), None),
            Lod::Full => Sessions::One(session),
            Lod::Level(level) => Sessions::One(at_level(&session, level).await?),
            Lod::Auto(rule) => Sessions::Levels(Box::new(LevelSessions::open(session).await?), Some(rule)),
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
            Sessions::Levels(levels, None) => levels.load_full(scene).await,
            Sessions::Levels(levels, Some(rule)) => levels.load(scene, *rule).await,
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
            Sessions::Levels(levels, None) => levels.render_full(scene, transport, deadline).await,
            Sessions::Levels(levels, Some(rule)) => levels.render(scene, *rule, transport, deadline).await,
        }
    }

    /// What comes before `last`, and that: by smaller and smaller errors, none of which chooses as the one before.
    ///
    /// # Errors
    /// A view that is none.
    pub(super) fn stages(&mut self, scene: &Scene, last: Lod) -> Result<Vec<Lod>, SessionError> {
        let mut stages = Vec::new();
        if let Sessions::Levels(levels, rule) = &mut self.sessions {
            let mut chosen = rule.map(|rule| levels.select(scene, rule)).transpose()?;
            let least = if let Some(Rule::Error { pixels }) = rule { *pixels } else { 0.0 };
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
        stages.push(last);
        Ok(stages)
    }

    /// Draws by `lod` from now on, one of [`Drawer::stages`].
    pub(super) fn draw_by(&mut self, lod: Lod) {
        if let Sessions::Levels(_, rule) = &mut self.sessions {
            *rule = if let Lod::Auto(by) = lod { Some(by) } else { None };
        }
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
