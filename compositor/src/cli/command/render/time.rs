//! Which step of a series each frame shows.

use anyhow::anyhow;
use brickcast_volume::store::Series;

use crate::cli::args::TimeChoice;
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::plan::StoreFacts;

/// Which step each frame shows.
#[derive(Debug, Clone)]
pub(super) struct TimePlan {
    pub(super) series: Series,
    /// At least one.
    pub(super) steps: Vec<usize>,
    /// Nobody said which step.
    is_default: bool,
}

impl TimePlan {
    pub(super) fn new(series: Series, steps: Vec<usize>, is_default: bool) -> Self {
        Self { series, steps, is_default }
    }

    /// # Errors
    /// Usage: a step that is not there.
    pub(super) fn asked(series: &Series, asked: Option<TimeChoice>, frames: Option<u32>) -> Result<Self, Failure> {
        let count = series.manifest().steps.len();
        let choice = asked.unwrap_or(TimeChoice::One(0));
        let place = series.place().display();
        let steps = choice.steps(count).map_err(|why| Failure::usage(anyhow!("{why} in the series {place}")))?;
        let frames = frames.map_or(steps.len(), |frames| frames as usize);
        let of_frame = |frame: usize| steps[frame * steps.len() / frames.max(1)];
        Ok(Self::new(series.clone(), (0..frames).map(of_frame).collect(), asked.is_none()))
    }

    pub(super) fn frames(&self) -> u32 {
        u32::try_from(self.steps.len()).unwrap_or(u32::MAX)
    }

    /// Does it show several steps?
    pub(super) fn is_sequence(&self) -> bool {
        self.steps.windows(2).any(|pair| pair[0] != pair[1])
    }

    pub(super) fn first(&self) -> usize {
        self.steps.first().copied().unwrap_or(0)
    }

    pub(super) fn step_of(&self, frame: usize) -> usize {
        self.steps.get(frame).copied().unwrap_or(0)
    }

    /// The first frame of another step than the one that `frame` shows, from there on.
    pub(super) fn next_after(&self, frame: usize) -> Option<usize> {
        let now = self.step_of(frame);
        (frame..self.steps.len()).find(|&other| self.steps[other] != now)
    }

    /// A step, with its time where that is known.
    pub(super) fn words(&self, step: usize) -> String {
        let manifest = self.series.manifest();
        let unit = manifest.time_unit.as_deref().map(|unit| format!(" {unit}")).unwrap_or_default();
        match manifest.steps.get(step).and_then(|entry| entry.time) {
            Some(time) => format!("step {step} ({time}{unit})"),
            None => format!("step {step}"),
        }
    }

    /// What was chosen for the user.
    pub(super) fn tell(&self, quiet: bool) -> Result<(), Failure> {
        let count = self.series.manifest().steps.len();
        match self.is_default && count > 1 {
            true => {
                let last = count - 1;
                say(quiet, &format!("step 0 of {count} is shown; --time T takes another, --time 0..{last} all of them"))
            }
            false => Ok(()),
        }
    }

    /// What is known of a step's store, with what is said of all steps in place of its own statistics.
    pub(super) fn looked_at(&self, store: &StoreFacts) -> StoreFacts {
        StoreFacts { manifest: self.series.manifest().statistics.in_place_of(&store.manifest), ..store.clone() }
    }
}
