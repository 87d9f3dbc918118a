//! An order becomes tiles: plan, then slices that fit the memory and some 0.1 s, joined along the merge tree, cut into
//! tiles. A piece of the picture is sent as soon as it is done; between slices others have their turn.
//!
//! Memory is bounded three ways: bricks by the residency's budget, accumulators of units that are begun by
//! [`MAX_BATCH_BYTES`], and pictures by working in bands of whole tile rows of at most [`MAX_BAND_PIXELS`] pixels.

mod answer;
mod batch;
mod choice;
mod join;
mod levels;
mod load;
mod meter;
mod order;
mod pace;
mod plan;
mod slices;
mod tables;
#[cfg(test)]
mod tests;
mod workshop;

use brickcast_proto::{Part, RenderOrder};

use crate::error::NodeError;
use crate::kernel::Watch;
use crate::stores::Sources;
use batch::Batches;
use plan::FramePlan;

pub use meter::{FrameMeter, LoadMeter};
pub use pace::Pace;
pub use tables::TableCache;
pub use workshop::{MAX_BAND_PIXELS, MAX_BATCH_BYTES, Turns, Workshop};

pub(crate) use choice::BrickChoice;
pub(crate) use load::{load_beside, load_bricks};

/// Renders `order` and hands every ordered (layer, tile) pair to `emit` exactly once, as pixels or as an empty; the
/// receipt is the caller's. Stops within milliseconds once `cancelled`.
///
/// # Errors
/// An order that does not fit the store, bricks over budget, a broken store, a failing adapter; what `emit` answers.
pub fn render_frame(
    order: &RenderOrder,
    sources: &Sources<'_>,
    workshop: Workshop<'_>,
    meter: &mut FrameMeter,
    (cancelled, turns): (&(dyn Fn() -> bool + Sync), &dyn Turns),
    emit: &mut dyn FnMut(Part) -> Result<(), NodeError>,
) -> Result<(), NodeError> {
    let plan = FramePlan::new(order, sources, workshop)?;
    let watch = Watch::new(workshop.pulse, cancelled);
    let mut batches = Batches::new(&plan, sources, workshop, watch, turns);
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
