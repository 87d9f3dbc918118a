//! Reads one node's answers to one order until its receipt, decoding tiles on the way: several at a time, and heard of
//! in the order in which they came.

use std::num::NonZero;

use brickcast_proto::{EncodedTile, FramePart, Part, Receipt, RenderOrder, TileRect, decode_tile};
use brickcast_volume::{Epoch, FrameId, PictureSize, PixelKind, TreeNode};
use futures_util::{StreamExt as _, pin_mut};
use glam::UVec2;
use tokio::sync::mpsc;

use super::ledger::{Ticket, TilePixels};
use crate::cluster::{CallError, NodeClient};

/// What a frame's loop hears of its orders.
#[derive(Debug)]
pub(crate) enum Event {
    Tile {
        ticket: Ticket,
        at: (FrameId, Epoch),
        layer: TreeNode,
        tile: [u32; 2],
        /// `None` for an explicit empty.
        pixels: Option<TilePixels>,
        /// Size of the message on the wire. A message that lists many empty tiles is one event a tile: the first has
        /// its size, the others 0.
        bytes: usize,
    },
    /// The node waits for its turn or works; a number that grew tells that it did something.
    Progress { ticket: Ticket, work: u64 },
    /// The last of a ticket that was answered.
    Receipt { ticket: Ticket, receipt: Receipt },
    /// The last of a ticket that was not.
    Failed { ticket: Ticket, error: CallError },
}

/// Sends the order and tells of everything that comes back; the last event is a receipt or a failure.
pub(crate) async fn collect(client: NodeClient, ticket: Ticket, order: RenderOrder, events: mpsc::Sender<Event>) {
    let last = match answers(client, ticket, order, &events).await {
        Ok(receipt) => Event::Receipt { ticket, receipt },
        Err(Some(error)) => Event::Failed { ticket, error },
        Err(None) => return,
    };
    events.send(last).await.ok();
}

/// A part of the answer, and what its pixels are.
struct Heard {
    part: FramePart,
    bytes: usize,
    /// Of a tile.
    pixels: Option<Result<TilePixels, String>>,
}

impl Heard {
    async fn of((part, bytes): (FramePart, usize), size: PictureSize, kind: PixelKind) -> Self {
        let mut pixels = None;
        if let Part::Tile(tile) = &part.part {
            // Its payload is shared, not copied.
            let encoded = tile.pixels.clone();
            pixels = Some(decoded(encoded, TileRect::tile_pixels(tile.tile, size).size(), kind).await);
        }
        Self { part, bytes, pixels }
    }
}

/// A tile's pixels, decoded on a thread that may take its time.
async fn decoded(tile: EncodedTile, size: UVec2, kind: PixelKind) -> Result<TilePixels, String> {
    let decode = move || decode_tile(&tile, size, kind).map_err(|e| e.to_string());
    tokio::task::spawn_blocking(decode).await.map_err(|e| e.to_string())?
}

/// `Err(None)` where nobody listens any more.
async fn answers(
    mut client: NodeClient,
    ticket: Ticket,
    order: RenderOrder,
    events: &mpsc::Sender<Event>,
) -> Result<Receipt, Option<CallError>> {
    let (now, size) = ((order.frame, order.epoch), order.scene.view.size);
    let kind = order.scene.look.style.mode.pixel_kind();
    let rects: Vec<(TreeNode, TileRect)> = order.layers.iter().map(|l| (l.node, l.tiles)).collect();
    let address = client.address().to_owned();
    let invalid = |reason: String| CallError::Invalid { address: address.clone(), call: "RenderFrame", reason };
    let parts = client.render(order).await?;
    // One node alone may answer faster than one thread decodes.
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let parts = parts.map(async |part| Ok::<_, CallError>(Heard::of(part?, size, kind).await)).buffered(threads);
    pin_mut!(parts);
    while let Some(heard) = parts.next().await {
        let Heard { part: FramePart { frame, epoch, part }, bytes, pixels } = heard?;
        let at = (frame, epoch);
        let tell = async |layer, tile, pixels, bytes| {
            events.send(Event::Tile { ticket, at, layer, tile, pixels, bytes }).await.map_err(|_| None)
        };
        match part {
            Part::Tile(tile) => {
                let pixels = pixels.transpose().map_err(|e| invalid(format!("tile {:?}: {e}", tile.tile)))?;
                tell(tile.node, tile.tile, pixels, bytes).await?;
            }
            Part::Empty { node, tiles } => {
                let rect = rects.iter().find(|(n, _)| *n == node).map(|(_, rect)| *rect);
                for (i, tile) in tiles.into_iter().filter_map(|i| rect?.tile_at(i)).enumerate() {
                    tell(node, tile, None, if i == 0 { bytes } else { 0 }).await?;
                }
            }
            Part::Progress { work } => events.send(Event::Progress { ticket, work }).await.map_err(|_| None)?,
            Part::Receipt(receipt) if at == now => return Ok(receipt),
            Part::Receipt(_) => return Err(Some(invalid("a receipt of another frame".to_owned()))),
        }
    }
    Err(Some(CallError::Lost { address, call: "RenderFrame", reason: "it ended before its receipt".to_owned() }))
}
