//! What is hidden of a picture, as statistics, manifests and files tell it.

use serde::{Deserialize, Serialize};

use super::place::{Hidden, HiddenPlace};

/// The most places that statistics and manifests list.
const MOST: usize = 64;

/// Why it is not known what levels hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Untold {
    #[error("the store is older than what tells it (version 10): prepare it anew")]
    Older,
    #[error("it is told of colours by value: not of --mode, nor where regions are told apart")]
    Look,
    #[error("values in flattened regions are not the volume's: --accel ert,ess leaves them as they are")]
    Flattened,
}

/// What is hidden; see [`Hidden`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HiddenNote {
    /// Why nothing of it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unknown: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    counts: Option<Counts>,
    /// Those that are gone first; all of them only where all are asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    places: Vec<Place>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Counts {
    cells: u64,
    of: u64,
    lost: u64,
    filled: u64,
    gone: u64,
    places: u64,
}

/// A box in voxels of the finest level, `lo` in it and `hi` behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Place {
    level: u8,
    lo: [u32; 3],
    hi: [u32; 3],
    lost: bool,
    filled: bool,
    gone: bool,
}

impl HiddenNote {
    /// For statistics and manifests.
    #[must_use]
    pub fn short(hidden: &Hidden) -> Self {
        Self::of(hidden, MOST)
    }

    /// With all places.
    #[must_use]
    pub fn whole(hidden: &Hidden) -> Self {
        Self::of(hidden, usize::MAX)
    }

    #[must_use]
    pub fn untold(why: Untold) -> Self {
        Self { unknown: Some(why.to_string()), counts: None, places: Vec::new() }
    }

    /// Of a picture of the finest level alone.
    #[must_use]
    pub fn nothing() -> Self {
        Self::short(&Hidden::default())
    }

    fn of(hidden: &Hidden, most: usize) -> Self {
        let Hidden { places, cells, lost, filled, gone, of } = hidden;
        let counts =
            Counts { cells: *cells, of: *of, lost: *lost, filled: *filled, gone: *gone, places: places.len() as u64 };
        let (gone, others): (Vec<&HiddenPlace>, Vec<&HiddenPlace>) = places.iter().partition(|place| place.how.gone);
        let listed = gone.into_iter().chain(others).take(most);
        Self { unknown: None, counts: Some(counts), places: listed.map(Place::from).collect() }
    }

    /// One line for people; nothing where nothing is hidden.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        if let Some(why) = &self.unknown {
            return Some(format!("what coarser levels hide is not known: {why}"));
        }
        let Counts { cells, of, lost, filled, gone, .. } = self.counts.filter(|counts| counts.cells > 0)?;
        let share = 100.0 * cells as f64 / of.max(1) as f64;
        Some(format!(
            "coarser levels hide something in {cells} of {of} cells ({share:.1} %): in {lost} what full resolution \
             shows, in {filled} what it leaves clear; of {gone} nothing is left around"
        ))
    }
}

impl From<&HiddenPlace> for Place {
    fn from(place: &HiddenPlace) -> Self {
        let (voxels, how) = (place.voxels, place.how);
        let (lo, hi) = (voxels.lo.to_array(), voxels.hi.to_array());
        Self { level: place.level, lo, hi, lost: how.lost, filled: how.filled, gone: how.gone }
    }
}
