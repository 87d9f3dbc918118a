//! Bricks put together from their own inner chunks and their halo.

use super::cache::ChunkCache;
use super::store::Store;
use super::window::{RowDecoder, Window};
use crate::brick::StoredBox;
use crate::ids::BrickIndex;
use crate::store::error::StoreError;
use crate::store::halo::read::HaloPart;
use crate::store::halo::shell::core_chunks;
use crate::store::shard::read::Shards;

impl Store {
    /// The elements of one array in a box about a brick, from the brick's own inner chunks and its halo: `halo_row`
    /// gives a part's elements from a position of its shell on.
    pub(crate) fn read_with_halo<T: Copy + Default, H>(
        &self,
        shards: &Shards,
        (brick, stored): (BrickIndex, StoredBox),
        cache: &ChunkCache,
        decoder: &impl RowDecoder<T>,
        (halo, halo_row): (&[HaloPart<H>], impl Fn(Option<&H>, usize, &mut [T])),
    ) -> Result<Vec<T>, StoreError> {
        let grid = &self.manifest().grid;
        let mut window = Window::new(stored, grid.volume_dims());
        self.fill(&mut window, shards, cache, decoder, core_chunks(grid, brick))?;
        for part in halo {
            window.fill_shell(part.shell, |first, out| halo_row(part.content.as_ref(), first, out));
        }
        Ok(window.clamped_to_edge())
    }
}
