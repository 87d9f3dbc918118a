//! What a frame is owed and nobody was asked for: tiles of chunks, as rectangles.

use std::collections::BTreeMap;

use brickcast_proto::TileRect;
use brickcast_volume::ChunkId;

/// Per chunk in view that is not altogether ordered, the tiles that are not: disjoint rectangles.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Unordered(BTreeMap<ChunkId, Vec<TileRect>>);

impl Unordered {
    pub(crate) fn all(in_view: &BTreeMap<ChunkId, TileRect>) -> Self {
        Self(in_view.iter().filter(|(_, tiles)| !tiles.is_empty()).map(|(c, tiles)| (*c, vec![*tiles])).collect())
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Chunks and their open tiles, in the grid's order.
    pub fn iter(&self) -> impl Iterator<Item = (ChunkId, &[TileRect])> {
        self.0.iter().map(|(chunk, tiles)| (*chunk, &tiles[..]))
    }

    pub fn chunks(&self) -> impl Iterator<Item = ChunkId> + '_ {
        self.0.keys().copied()
    }

    /// The open tiles of a chunk.
    #[must_use]
    pub fn of(&self, chunk: ChunkId) -> &[TileRect] {
        self.0.get(&chunk).map_or(&[], |tiles| &tiles[..])
    }

    /// That of some chunks.
    #[must_use]
    pub(crate) fn only(&self, wanted: impl Fn(ChunkId) -> bool) -> Self {
        Self(self.0.iter().filter(|(chunk, _)| wanted(**chunk)).map(|(chunk, tiles)| (*chunk, tiles.clone())).collect())
    }

    /// Takes tiles out; false, and nothing is changed, where one of them is not open.
    pub(crate) fn take(&mut self, chunk: ChunkId, tiles: &TileRect) -> bool {
        let Some(open) = self.0.get_mut(&chunk) else { return false };
        let count = |rects: &[TileRect]| rects.iter().map(|r| u64::from(r.count())).sum::<u64>();
        let rest: Vec<TileRect> = open.iter().flat_map(|r| r.without(tiles)).collect();
        if tiles.is_empty() || count(open) - count(&rest) != u64::from(tiles.count()) {
            return false;
        }
        *open = rest;
        if open.is_empty() {
            self.0.remove(&chunk);
        }
        true
    }

    /// Puts tiles back that were taken out.
    pub(crate) fn put(&mut self, chunk: ChunkId, tiles: TileRect) {
        let open = self.0.entry(chunk).or_default();
        let mut new = tiles;
        while let Some((at, joined)) = open.iter().enumerate().find_map(|(i, r)| Some((i, r.joined(&new)?))) {
            open.remove(at);
            new = joined;
        }
        open.push(new);
    }
}
