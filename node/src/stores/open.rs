//! Stores that are open, and what bricks are loaded from.

use std::sync::Arc;

use brickcast_volume::StoreHash;
use brickcast_volume::store::BrickSource;

/// A store that stays open while it is used.
#[derive(Debug)]
pub struct OpenStore {
    pub name: String,
    pub store: Arc<dyn BrickSource>,
    /// The next coarser level's.
    pub coarser: Option<StoreHash>,
}

/// What bricks are loaded from: a store, and the next coarser level where bricks of the two meet.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    pub store: &'a OpenStore,
    pub coarser: Option<&'a OpenStore>,
}

/// What a frame is rendered from.
#[derive(Debug, Clone)]
pub struct Sources<'a> {
    /// The order's store.
    pub root: &'a OpenStore,
    /// Of each of the order's parts; the store itself where it has none.
    pub parts: Vec<Source<'a>>,
}

impl<'a> Sources<'a> {
    /// A store, none of whose coarser levels is drawn.
    #[must_use]
    pub fn of(root: &'a OpenStore) -> Self {
        Self { root, parts: vec![Source::of(root)] }
    }

    /// All of them; some twice.
    pub fn stores(&self) -> impl Iterator<Item = &'a OpenStore> + '_ {
        let of_parts = self.parts.iter().flat_map(|part| std::iter::once(part.store).chain(part.coarser));
        std::iter::once(self.root).chain(of_parts)
    }
}

impl<'a> Source<'a> {
    /// Of bricks that meet none.
    #[must_use]
    pub fn of(store: &'a OpenStore) -> Self {
        Self { store, coarser: None }
    }
}
