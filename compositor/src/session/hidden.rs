//! What frames of coarser levels hide (docs/adr/0025-what-levels-hide.md): by store, look and levels, never by nodes.

use std::collections::{BTreeMap, BTreeSet};

use brickcast_volume::ChunkId;
use brickcast_volume::lod::{Hidden, HiddenNote, Hides, Untold};
use brickcast_volume::scene::Scene;

use super::layered::Frame;
use crate::plan::{LevelShown, StoreFacts};

/// What a session of a coarser level knows of its volume.
#[derive(Debug)]
pub(super) struct OnLevel {
    level: u8,
    finest: StoreFacts,
    /// By the scene that was drawn last.
    hides: Option<(Scene, Result<Hides, Untold>)>,
}

impl OnLevel {
    pub(super) fn new(level: u8, finest: StoreFacts) -> Self {
        Self { level, finest, hides: None }
    }

    /// What is hidden where all of `store`, the level, is drawn, in the chunks that are in view.
    pub(super) fn hidden(
        &mut self,
        store: &StoreFacts,
        scene: &Scene,
        in_view: &BTreeSet<ChunkId>,
    ) -> Result<Hidden, Untold> {
        let known = self.hides.take().filter(|(known, _)| is_same_look(known, scene));
        let (_, hides) = self.hides.insert(known.unwrap_or_else(|| {
            let tables = self.finest.means.as_ref().zip(store.means.as_ref()).ok_or(Untold::Older);
            let level = |means| [(self.level, store.tree(), means)];
            let hides = |(finest, means)| Hides::new(scene, (self.finest.bricks(), finest), level(means));
            (scene.clone(), tables.and_then(hides))
        }));
        let hides = hides.as_mut().map_err(|why| *why)?;
        Ok(hides.hidden(|_, chunk| in_view.contains(&chunk), |_| None).clone())
    }
}

fn is_same_look(a: &Scene, b: &Scene) -> bool {
    a.look == b.look && a.quality.step.to_bits() == b.quality.step.to_bits()
}

/// What levels hide in a look, the finest first.
pub(super) fn of_levels(stores: &[StoreFacts], scene: &Scene) -> Result<Hides, Untold> {
    let mut levels = Vec::new();
    for (level, store) in (0..).zip(stores) {
        levels.push((level, store.tree(), store.means.as_ref().ok_or(Untold::Older)?));
    }
    let (Some(finest), Some((.., means))) = (stores.first(), levels.first()) else { return Err(Untold::Older) };
    Hides::new(scene, (finest.bricks(), means), levels.iter().copied())
}

/// What is hidden of what is drawn of several levels, in those of the finest level's chunks that are in view.
pub(super) fn of_parts(hides: &mut Hides, parts: &[LevelShown], in_view: &BTreeSet<ChunkId>) -> Hidden {
    let chunks: BTreeMap<u8, BTreeSet<ChunkId>> =
        parts.iter().map(|part| (part.level, part.chunks_in(in_view))).collect();
    let borders = |level| parts.iter().find(|part| part.level == level).and_then(LevelShown::borders);
    hides.hidden(|level, chunk| chunks.get(&level).is_some_and(|chunks| chunks.contains(&chunk)), borders).clone()
}

impl Frame {
    /// Tells what it hides.
    pub(super) fn hides(&mut self, hidden: Result<Hidden, Untold>) {
        self.stats.hidden = Some(match &hidden {
            Ok(hidden) => HiddenNote::short(hidden),
            Err(why) => HiddenNote::untold(*why),
        });
        self.hidden = hidden.ok();
    }
}
