//! No two chunks that share a face are more than one level apart.

use super::levels::Levels;
use crate::ids::ChunkIndex;
use crate::per_chunk::PerChunk;

/// Lowers levels until face neighbours differ by one at most: the coarsest assignment that is nowhere coarser than what
/// was there. There is one, since of two that keep the law the coarser at each place does, too; so a finer wish never
/// makes anything coarser.
pub(super) fn balance(levels: &Levels, of: &mut PerChunk<u8>) {
    let tree = levels.finest();
    let dims = tree.chunk_dims();
    let chunks: Vec<ChunkIndex> = tree.chunk_ids().filter_map(|chunk| tree.chunk_at(chunk)).collect();
    loop {
        let mut changed = false;
        for &chunk in &chunks {
            let allowed = neighbours(chunk, dims.to_array()).map(|near| of[tree.chunk_id(near)] + 1).min();
            let level = of[tree.chunk_id(chunk)];
            if allowed.is_some_and(|allowed| level > allowed) {
                // A coarse chunk is refined whole.
                for finest in levels.under(level, levels.over(level, chunk)) {
                    of[tree.chunk_id(finest)] = level - 1;
                }
                changed = true;
            }
        }
        if !changed {
            return;
        }
    }
}

/// Raises levels until none is finer than its chunk's `floor`, coarse chunks are whole, and face neighbours differ by
/// one at most: the finest assignment that keeps these laws and is nowhere finer than what was there, of which there is
/// one by the same reason. Floors are levels that there are.
pub(super) fn coarsen(levels: &Levels, of: &mut PerChunk<u8>, floor: &PerChunk<u8>) {
    let tree = levels.finest();
    let dims = tree.chunk_dims();
    let chunks: Vec<ChunkIndex> = tree.chunk_ids().filter_map(|chunk| tree.chunk_at(chunk)).collect();
    let raise = |of: &mut PerChunk<u8>, chunk: ChunkIndex, to: u8| {
        let level = &mut of[tree.chunk_id(chunk)];
        let is_finer = *level < to;
        *level = to.max(*level);
        is_finer
    };
    loop {
        let mut changed = false;
        for &chunk in &chunks {
            changed |= raise(of, chunk, floor[tree.chunk_id(chunk)]);
            let level = of[tree.chunk_id(chunk)];
            for same in levels.under(level, levels.over(level, chunk)) {
                changed |= raise(of, same, level);
            }
            for near in neighbours(chunk, dims.to_array()) {
                changed |= raise(of, near, level.saturating_sub(1));
            }
        }
        if !changed {
            return;
        }
    }
}

/// Those that share a face with `chunk`.
pub(super) fn neighbours(chunk: ChunkIndex, dims: [u32; 3]) -> impl Iterator<Item = ChunkIndex> {
    (0..6).filter_map(move |side| {
        let (axis, mut near) = (side / 2, chunk.0);
        near[axis] = if side % 2 == 0 { near[axis].checked_sub(1)? } else { near[axis] + 1 };
        (near[axis] < dims[axis]).then_some(ChunkIndex(near))
    })
}
