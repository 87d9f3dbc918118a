//! Tables over all chunks.

use std::ops::{Index, IndexMut};

use crate::ids::ChunkId;

/// One value for every chunk of a store, in the order of [`ChunkId`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PerChunk<T>(Vec<T>);

impl<T> PerChunk<T> {
    /// The same value for each of `count` chunks.
    #[must_use]
    pub fn filled(value: T, count: usize) -> Self
    where
        T: Clone,
    {
        Self(vec![value; count])
    }

    /// How many chunks there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// All chunks of the table, ascending.
    pub fn ids(&self) -> impl Iterator<Item = ChunkId> + use<T> {
        (0..self.0.len() as u32).map(ChunkId::new)
    }

    /// Chunks with their values, ascending.
    pub fn iter(&self) -> impl Iterator<Item = (ChunkId, &T)> {
        self.ids().zip(&self.0)
    }

    /// The values, by ascending chunk.
    pub fn values(&self) -> std::slice::Iter<'_, T> {
        self.0.iter()
    }

    /// As [`PerChunk::values`].
    pub fn values_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// Nothing for a chunk beyond the last one.
    #[must_use]
    pub fn get(&self, chunk: ChunkId) -> Option<&T> {
        self.0.get(chunk.index())
    }
}

/// Of no chunks.
impl<T> Default for PerChunk<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> From<Vec<T>> for PerChunk<T> {
    fn from(values: Vec<T>) -> Self {
        Self(values)
    }
}

impl<T> FromIterator<T> for PerChunk<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T> Index<ChunkId> for PerChunk<T> {
    type Output = T;

    fn index(&self, chunk: ChunkId) -> &T {
        &self.0[chunk.index()]
    }
}

impl<T> IndexMut<ChunkId> for PerChunk<T> {
    fn index_mut(&mut self, chunk: ChunkId) -> &mut T {
        &mut self.0[chunk.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_their_chunk() {
        let mut table: PerChunk<u8> = [4, 5, 6].into_iter().collect();
        let last = ChunkId::new(2);
        table[last] = 9;
        assert_eq!((table[last], table.get(ChunkId::new(3)), table.count()), (9, None, 3));
        assert_eq!(table.iter().last(), Some((last, &9)));
        assert_eq!(table.ids().collect::<Vec<_>>(), [0, 1, 2].map(ChunkId::new));
    }
}
