//! An order becomes tiles: plan, then batches of jobs that fit the memory, joined along the merge tree, cut into tiles.
//!
//! Memory is bounded three ways: bricks by the residency's budget, accumulators of one call by [`MAX_BATCH_BYTES`], and
//! pictures by working in bands of whole tile rows of at most [`MAX_BAND_PIXELS`] pixels.

mod answer;
mod batch;
mod choice;
mod join;
mod plan;
mod tables;
#[cfg(test)]
mod tests;

use brickcast_proto::{Part, RenderOrder};
use brickcast_volume::store::ChunkCache;

pub use tables::TableCache;

use crate::error::NodeError;
use crate::meter::FrameMeter;
use crate::pace::Pace;
use crate::raycaster::Raycaster;
use crate::residency::Residency;
use crate::stores::OpenStore;
pub(crate) use batch::load_bricks;
pub(crate) use choice::{BrickChoice, knows_only_region};

use batch::Batches;
use plan::FramePlan;

/// Bytes of accumulators in one call of the kernel.
pub const MAX_BATCH_BYTES: u64 = 256 << 20;
/// Pixels of a layer worked on at once.
pub const MAX_BAND_PIXELS: u64 = 4 << 20;

/// What rendering needs of its node.
#[derive(Debug, Clone, Copy)]
pub struct Workshop<'a> {
    pub raycaster: &'a dyn Raycaster,
    pub residency: &'a Residency,
    pub cache: &'a ChunkCache,
    pub tables: &'a TableCache,
    pub pace: &'a Pace,
}

/// Renders `order` and hands every ordered (layer, tile) pair to `emit` exactly once, as pixels or as an empty; the receipt
/// is the caller's. Stops at the next batch once `cancelled`.
///
/// # Errors
/// An order that does not fit the store, bricks over budget, a broken store, a failing adapter; what `emit` answers.
pub fn render_frame(
    order: &RenderOrder,
    store: &OpenStore,
    workshop: Workshop<'_>,
    meter: &mut FrameMeter,
    cancelled: &(dyn Fn() -> bool + Sync),
    emit: &mut dyn FnMut(Part) -> Result<(), NodeError>,
) -> Result<(), NodeError> {
    let plan = FramePlan::new(order, &store.store, workshop)?;
    let mut batches = Batches::new(&plan, store, workshop, cancelled);
    for piece in &plan.pieces {
        if cancelled() {
            return Err(NodeError::Cancelled);
        }
        let picture = join::picture(&plan, piece, &mut batches, meter)?;
        let answers = answer::answer(piece, &order.layers[piece.layer], order, picture.as_ref());
        meter.answered(answers.tiles.len(), answers.empty.len());
        for tile in answers.tiles {
            emit(Part::Tile(tile))?;
        }
        if !answers.empty.is_empty() {
            emit(Part::Empty { node: order.layers[piece.layer].node, tiles: answers.empty })?;
        }
    }
    Ok(())
}
