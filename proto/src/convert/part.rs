//! What a node answers: tiles, empties, the receipt.

use brickcast_volume::{ChunkId, Epoch, FrameId, PixelKind};

use super::scene::{format_from_wire, format_to_wire};
use super::{WireError, at_most, duration, tree_node};
use crate::order::MAX_CHUNKS;
use crate::part::{ChunkCost, FramePart, Part, Receipt, TilePart};
use crate::tile::EncodedTile;
use crate::tile_rect::MAX_TILES;
use crate::wire;

/// The farthest tile of any legal picture on one axis.
const LAST_TILE: u32 = brickcast_volume::visibility::MAX_SIDE.div_ceil(crate::TILE) - 1;

const KINDS: [(PixelKind, wire::PixelKind); 4] = [
    (PixelKind::Over, wire::PixelKind::Over),
    (PixelKind::Largest, wire::PixelKind::Largest),
    (PixelKind::Smallest, wire::PixelKind::Smallest),
    (PixelKind::Mean, wire::PixelKind::Mean),
];

/// `None` where it was left out.
fn kind_from_wire(kind: i32) -> Result<Option<PixelKind>, WireError> {
    if kind == 0 {
        return Ok(None);
    }
    let known = KINDS.iter().find(|(_, wire)| i32::from(*wire) == kind);
    let known = known.ok_or_else(|| WireError::Unknown { what: "pixel kind", value: kind.to_string() })?;
    Ok(Some(known.0))
}

impl From<TilePart> for wire::Tile {
    fn from(part: TilePart) -> Self {
        let EncodedTile { kind, format, runs, lz4, payload, crc32c } = part.pixels;
        let [tile_x, tile_y] = part.tile;
        Self {
            tree_node: part.node.0,
            tile_x,
            tile_y,
            format: format_to_wire(format),
            runs,
            lz4,
            payload,
            crc32c,
            kind: KINDS.iter().find(|(known, _)| Some(*known) == kind).map_or(0, |(_, wire)| (*wire).into()),
        }
    }
}

impl TryFrom<wire::Tile> for TilePart {
    type Error = WireError;

    fn try_from(tile: wire::Tile) -> Result<Self, WireError> {
        let node = tree_node(tile.tree_node)?;
        for (what, index) in [("tile column", tile.tile_x), ("tile row", tile.tile_y)] {
            if index > LAST_TILE {
                return Err(WireError::Beyond { what, index: index.into(), last: LAST_TILE.into() });
            }
        }
        let format = format_from_wire(tile.format)?;
        let kind = kind_from_wire(tile.kind)?;
        let pixels = EncodedTile::from_parts(kind, format, tile.runs, tile.lz4, tile.payload, tile.crc32c)?;
        Ok(Self { node, tile: [tile.tile_x, tile.tile_y], pixels })
    }
}

impl From<Receipt> for wire::Receipt {
    fn from(r: Receipt) -> Self {
        Self {
            render_ms: r.render_ms,
            samples: r.samples,
            positions: r.positions,
            bricks: r.bricks,
            layers: r.layers,
            tiles: r.tiles,
            empty_tiles: r.empty_tiles,
            load_ms: r.load_ms,
            decoded_bytes: r.decoded_bytes,
            owned_bytes: r.owned_bytes,
            leapt_positions: r.leapt_positions,
            flattened_bricks: r.flattened_bricks,
            uniform_bricks: r.uniform_bricks,
            over_tolerance_bricks: r.over_tolerance_bricks,
            skips: r.skips,
            work_ms: r.work_ms,
            costs: r
                .costs
                .into_iter()
                .map(|c| wire::ChunkCost { chunk: c.chunk.linear(), samples: c.samples, skips: c.skips })
                .collect(),
        }
    }
}

impl TryFrom<wire::Receipt> for Receipt {
    type Error = WireError;

    fn try_from(r: wire::Receipt) -> Result<Self, WireError> {
        at_most("chunks with a cost", r.costs.len(), MAX_CHUNKS)?;
        if let Some(pair) = r.costs.windows(2).find(|p| p[0].chunk >= p[1].chunk) {
            return Err(WireError::Order { what: "chunks with a cost", before: pair[0].chunk, after: pair[1].chunk });
        }
        Ok(Self {
            render_ms: duration("render_ms", r.render_ms)?,
            samples: r.samples,
            positions: r.positions,
            bricks: r.bricks,
            layers: r.layers,
            tiles: r.tiles,
            empty_tiles: r.empty_tiles,
            load_ms: duration("load_ms", r.load_ms)?,
            decoded_bytes: r.decoded_bytes,
            owned_bytes: r.owned_bytes,
            leapt_positions: r.leapt_positions,
            flattened_bricks: r.flattened_bricks,
            uniform_bricks: r.uniform_bricks,
            over_tolerance_bricks: r.over_tolerance_bricks,
            skips: r.skips,
            work_ms: duration("work_ms", r.work_ms)?,
            costs: r
                .costs
                .into_iter()
                .map(|c| ChunkCost { chunk: ChunkId::new(c.chunk), samples: c.samples, skips: c.skips })
                .collect(),
        })
    }
}

impl From<FramePart> for wire::FramePart {
    fn from(part: FramePart) -> Self {
        let inner = match part.part {
            Part::Tile(tile) => wire::frame_part::Part::Tile(tile.into()),
            Part::Empty { node, tiles } => wire::frame_part::Part::Empty(wire::EmptyTiles { tree_node: node.0, tiles }),
            Part::Progress { work } => wire::frame_part::Part::Progress(wire::Progress { work }),
            Part::Receipt(receipt) => wire::frame_part::Part::Receipt(receipt.into()),
        };
        Self { frame: part.frame.0, epoch: part.epoch.0, part: Some(inner) }
    }
}

impl TryFrom<wire::FramePart> for FramePart {
    type Error = WireError;

    fn try_from(part: wire::FramePart) -> Result<Self, WireError> {
        let inner = match part.part.ok_or(WireError::Missing("frame part"))? {
            wire::frame_part::Part::Tile(tile) => Part::Tile(tile.try_into()?),
            wire::frame_part::Part::Empty(empty) => {
                let node = tree_node(empty.tree_node)?;
                at_most("empty tiles", empty.tiles.len(), MAX_TILES as usize)?;
                if empty.tiles.is_empty() {
                    return Err(WireError::Missing("a tile: the list of empties has none, and that"));
                }
                if let Some(pair) = empty.tiles.windows(2).find(|p| p[0] >= p[1]) {
                    return Err(WireError::Order { what: "empty tiles", before: pair[0], after: pair[1] });
                }
                Part::Empty { node, tiles: empty.tiles }
            }
            wire::frame_part::Part::Progress(progress) => Part::Progress { work: progress.work },
            wire::frame_part::Part::Receipt(receipt) => Part::Receipt(receipt.try_into()?),
        };
        Ok(Self { frame: FrameId(part.frame), epoch: Epoch(part.epoch), part: inner })
    }
}
