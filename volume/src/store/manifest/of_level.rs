//! The door where manifests of coarser levels are checked: each must say what follows from its store's.

use super::Manifest;
use super::checks::field;
use crate::store::error::{ManifestError, StoreError};
use crate::store::hash::ContentHash;

impl Manifest {
    /// The manifest of one of this store's coarser levels, from 1 on, from its bytes.
    ///
    /// # Errors
    /// Bytes that are not those that this manifest promises; a manifest that says what cannot be of that level.
    pub fn level_from_bytes(&self, level: u8, bytes: &[u8]) -> Result<Self, StoreError> {
        let entry = usize::from(level).checked_sub(1).and_then(|place| self.levels.get(place));
        let Some(entry) = entry else {
            return Err(field("levels", format!("there is no level {level}")).into());
        };
        let (got, want) = (ContentHash::of(bytes), entry.hash);
        if got != want {
            return Err(ManifestError::LevelHash { got, want }.into());
        }
        let of_level = Self::any_from_bytes(bytes)?;
        self.check_level(level, &of_level)?;
        Ok(of_level)
    }

    /// All that a level must share with its store, or that follows from it.
    fn check_level(&self, level: u8, m: &Self) -> Result<(), ManifestError> {
        let stored = |m: &Self| m.no_data.as_ref().map(|n| (n.stored, n.fill.clone()));
        let shared = |m: &Self| m.regions.as_ref().map(|r| (r.method, r.files.group, r.files.image));
        let told = |m: &Self| (m.min, m.max, m.mean, m.otsu, m.quantiles, m.noise);
        let agree = [
            ("level", m.level == level),
            ("version, writer", (m.version, &m.writer) == (self.version, &self.writer)),
            ("source", m.source == self.source),
            ("dims, spacing, origin, directions", self.geometry.at_level(level).as_ref() == Ok(&m.geometry)),
            ("brick_size", m.grid.brick_size() == self.grid.brick_size()),
            ("scale, offset", (m.scale, m.offset) == (self.scale, self.offset)),
            ("range", m.data_range == self.data_range),
            ("min, max, mean, otsu, quantiles, noise", told(m) == told(self)),
            ("no_data", stored(m) == stored(self)),
            ("files", m.files.group == self.files.group),
            ("regions", shared(m) == shared(self)),
        ];
        match agree.into_iter().find(|(_, agrees)| !agrees) {
            Some((name, _)) => Err(field(name, format!("not what follows from the store for its level {level}"))),
            None => Ok(()),
        }
    }
}
