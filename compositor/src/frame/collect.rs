//! Reads one node's answers to one order until its receipt, decoding tiles on the way.

use brickcast_proto::{FramePart, Part, Receipt, RenderOrder, TileRect, decode_tile};
use brickcast_volume::{Epoch, FrameId, TreeNode};
use futures_util::{StreamExt as _, pin_mut};
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
    pin_mut!(parts);
    while let Some(part) = parts.next().await {
        let (FramePart { frame, epoch, part }, bytes) = part?;
        let at = (frame, epoch);
        let tell = async |layer, tile, pixels, bytes| {
            events.send(Event::Tile { ticket, at, layer, tile, pixels, bytes }).await.map_err(|_| None)
        };
        match part {
            Part::Tile(tile) => {
                let pixels = decode_tile(&tile.pixels, TileRect::tile_pixels(tile.tile, size).size(), kind);
                let pixels = pixels.map_err(|e| invalid(format!("tile {:?}: {e}", tile.tile)))?;
                tell(tile.node, tile.tile, Some(pixels), bytes).await?;
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
