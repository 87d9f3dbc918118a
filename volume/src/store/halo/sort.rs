//! Records of halos that were written tile by tile, brought into the grid's order.

use std::fs::{self, File};
use std::path::Path;

use super::writer::{HaloWriter, WrittenHalos};
use crate::brick::BrickGrid;
use crate::store::error::StoreError;
use crate::store::files::position::read_exact_at;
use crate::store::tiles::{Tile, Tiles};

/// Bytes that are copied at once.
const COPY_BYTES: u64 = 1 << 20;

/// Bricks of one tile that follow each other in either order: those of one y and z.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Position in the file.
    start: u64,
    /// The first brick's place in the order of writing.
    first: usize,
}

/// Copies the records to `path` in the grid's linear order, and removes the file that they were written to: tile after
/// tile, bricks of a tile x fastest, those of so many layers.
pub(crate) fn sorted(
    mut from: HaloWriter,
    (grid, layers): (&BrickGrid, usize),
    tiles: Tiles,
    path: &Path,
) -> Result<WrittenHalos, StoreError> {
    from.flush()?;
    let bricks = |tile: &Tile, axis| tile.cells(axis, grid.brick_size());
    let tiles: Vec<Tile> = tiles.iter().collect();
    let (mut runs, mut run) = (Vec::new(), Run { start: 0, first: 0 });
    // Where in `runs` each tile begins.
    let mut of_tile = Vec::with_capacity(tiles.len());
    for tile in &tiles {
        of_tile.push(runs.len());
        for _ in 0..layers * bricks(tile, 1).len() {
            runs.push(run);
            let records = &from.entries[run.first * from.records..][..bricks(tile, 0).len() * from.records];
            run.start += bytes_of(records);
            run.first += bricks(tile, 0).len();
        }
    }
    #[expect(clippy::disallowed_methods, reason = "a scratch file that was just written")]
    let source = File::open(&from.path).map_err(StoreError::io("read", &from.path))?;
    let mut to = HaloWriter::create(path, from.records)?;
    to.entries.reserve_exact(from.entries.len());
    let mut part = Vec::new();
    for bz in 0..layers {
        for by in 0..grid.dims().y {
            for (tile, first_run) in tiles.iter().zip(&of_tile).filter(|(tile, _)| bricks(tile, 1).contains(&by)) {
                let ys = bricks(tile, 1);
                let run = runs[first_run + bz * ys.len() + (by - ys.start) as usize];
                let records = &from.entries[run.first * from.records..][..bricks(tile, 0).len() * from.records];
                let end = run.start + bytes_of(records);
                let mut at = run.start;
                while at < end {
                    part.resize((end - at).min(COPY_BYTES) as usize, 0);
                    read_exact_at(&source, &mut part, at).map_err(StoreError::io("read", &from.path))?;
                    to.append(&part)?;
                    at += part.len() as u64;
                }
                to.entries.extend_from_slice(records);
            }
        }
    }
    fs::remove_file(&from.path).map_err(StoreError::io("remove", &from.path))?;
    to.finish()
}

fn bytes_of(records: &[(u32, u32)]) -> u64 {
    records.iter().map(|(length, _)| u64::from(*length)).sum()
}
