//! The order: what one node renders of one frame.

use std::collections::HashSet;

use brickcast_volume::lod::{Borders, Meets, Sides};
use brickcast_volume::scene::Transport;
use brickcast_volume::{ChunkId, Epoch, FrameId, SessionId, TreeNode};
use prost::Message as _;

use super::scene::{format_from_wire, format_to_wire};
use super::{WireError, at_most, tree_node};
use crate::order::{LayerOrder, LevelPart, MAX_CHUNKS, MAX_LAYERS, MAX_LEVEL, MAX_TILES_OWED, RenderOrder};
use crate::tile_rect::TileRect;
use crate::wire;

impl From<&LayerOrder> for wire::Layer {
    fn from(layer: &LayerOrder) -> Self {
        Self {
            tree_node: layer.node.0,
            chunks: layer.chunks.iter().map(|chunk| chunk.linear()).collect(),
            tile_x0: layer.tiles.lo[0],
            tile_y0: layer.tiles.lo[1],
            tile_x1: layer.tiles.hi[0],
            tile_y1: layer.tiles.hi[1],
        }
    }
}

impl From<&Borders> for wire::Borders {
    fn from(borders: &Borders) -> Self {
        let chunks = borders.iter().map(|(chunk, _)| chunk.linear()).collect();
        let (sides, coarser) = borders.iter().map(|(_, meets)| (meets.others.bits(), meets.coarser.bits())).unzip();
        Self { level: u32::from(borders.level()), chunks, sides, coarser }
    }
}

impl TryFrom<wire::Borders> for Borders {
    type Error = WireError;

    fn try_from(borders: wire::Borders) -> Result<Self, WireError> {
        let wire::Borders { level, chunks, sides, coarser } = borders;
        at_most("chunks at borders", chunks.len(), MAX_CHUNKS)?;
        if chunks.len() != sides.len() || chunks.len() != coarser.len() {
            let (chunks, sides, coarser) = (chunks.len(), sides.len(), coarser.len());
            return Err(WireError::BorderSides { chunks, sides, coarser });
        }
        if let Some(&[before, after]) = chunks.array_windows().find(|[before, after]| before >= after) {
            return Err(WireError::Order { what: "chunks at borders", before, after });
        }
        let known = u8::try_from(level).ok().filter(|level| *level <= MAX_LEVEL);
        let level = known.ok_or(WireError::BorderLevel(level))?;
        let of = |chunk, bits| Sides::from_bits(bits).ok_or(WireError::Border { chunk, bits });
        let meets = |((&chunk, &others), &bits)| {
            let meets = Meets { others: of(chunk, others)?, coarser: of(chunk, bits)? };
            let are_others = meets.others.contains(meets.coarser);
            if are_others { Ok((ChunkId::new(chunk), meets)) } else { Err(WireError::Border { chunk, bits }) }
        };
        let meets = chunks.iter().zip(&sides).zip(&coarser).map(meets).collect::<Result<Vec<_>, _>>()?;
        Self::new(level, meets).ok_or(WireError::Missing("a side of a border"))
    }
}

impl From<&LevelPart> for wire::LevelPart {
    fn from(part: &LevelPart) -> Self {
        Self {
            level: part.level.into(),
            store_hash: part.store.to_string(),
            chunks: part.chunks.iter().map(|chunk| chunk.linear()).collect(),
            borders: part.borders.as_ref().map(Into::into),
        }
    }
}

impl TryFrom<wire::LevelPart> for LevelPart {
    type Error = WireError;

    fn try_from(part: wire::LevelPart) -> Result<Self, WireError> {
        if let Some(&[before, after]) = part.chunks.array_windows().find(|[before, after]| before >= after) {
            return Err(WireError::Order { what: "chunks of a level", before, after });
        }
        let known = u8::try_from(part.level).ok().filter(|level| *level <= MAX_LEVEL);
        let level = known.ok_or(WireError::PartLevel(part.level))?;
        let borders: Option<Borders> = part.borders.map(TryInto::try_into).transpose()?;
        if let Some(other) = borders.as_ref().map(Borders::level).filter(|other| *other != level) {
            return Err(WireError::PartBorders { level, other });
        }
        let chunks = part.chunks.into_iter().map(ChunkId::new).collect();
        Ok(Self { level, store: part.store_hash.parse()?, chunks, borders })
    }
}

impl From<&RenderOrder> for wire::RenderOrder {
    fn from(order: &RenderOrder) -> Self {
        let unsealed = Self {
            session: order.session.0,
            frame: order.frame.0,
            epoch: order.epoch.0,
            store_hash: order.store.to_string(),
            scene: Some((&order.scene).into()),
            transport: format_to_wire(order.transport),
            layers: order.layers.iter().map(Into::into).collect(),
            parts: order.parts.iter().map(Into::into).collect(),
            crc32c: 0,
        };
        unsealed.sealed()
    }
}

impl wire::RenderOrder {
    /// With the checksum of what it says: a flipped bit must not become another camera, and so another picture.
    #[must_use]
    pub fn sealed(mut self) -> Self {
        self.crc32c = self.checksum();
        self
    }

    /// The crc32c of its encoding without one.
    fn checksum(&mut self) -> u32 {
        let sealed = std::mem::take(&mut self.crc32c);
        let crc = crc32c::crc32c(&self.encode_to_vec());
        self.crc32c = sealed;
        crc
    }
}

impl From<RenderOrder> for wire::RenderOrder {
    fn from(order: RenderOrder) -> Self {
        (&order).into()
    }
}

impl TryFrom<wire::Layer> for LayerOrder {
    type Error = WireError;

    fn try_from(layer: wire::Layer) -> Result<Self, WireError> {
        let node = tree_node(layer.tree_node)?;
        if layer.chunks.is_empty() {
            return Err(WireError::NoChunks(node));
        }
        let tiles = TileRect { lo: [layer.tile_x0, layer.tile_y0], hi: [layer.tile_x1, layer.tile_y1] };
        Ok(Self { node, chunks: layer.chunks.into_iter().map(ChunkId::new).collect(), tiles })
    }
}

impl TryFrom<wire::RenderOrder> for RenderOrder {
    type Error = WireError;

    fn try_from(mut order: wire::RenderOrder) -> Result<Self, WireError> {
        let (got, want) = (order.checksum(), order.crc32c);
        if got != want {
            return Err(WireError::OrderChecksum { got, want });
        }
        at_most("layers", order.layers.len(), MAX_LAYERS)?;
        if order.layers.is_empty() {
            return Err(WireError::Missing("a layer: the order has none, and that"));
        }
        at_most("chunks", order.layers.iter().map(|l| l.chunks.len()).sum(), MAX_CHUNKS)?;
        let store = order.store_hash.parse()?;
        let scene: brickcast_volume::scene::Scene = order.scene.ok_or(WireError::Missing("scene"))?.try_into()?;
        let transport = format_from_wire(order.transport)?;
        match transport {
            Transport::F16 if scene.quality.exact => return Err(WireError::ExactTransport("f16")),
            Transport::U8 if scene.quality.exact => return Err(WireError::ExactTransport("u8")),
            Transport::F16 | Transport::U8 if scene.quality.extreme.is_some() => {
                return Err(WireError::ExtremeTransport(transport));
            }
            _ => {}
        }
        let kind = scene.look.style.mode.pixel_kind();
        if !transport.carries(kind) {
            return Err(WireError::CodesTransport { kind, transport });
        }
        let layers: Vec<LayerOrder> = order.layers.into_iter().map(TryInto::try_into).collect::<Result<_, _>>()?;
        let picture = TileRect::of_picture(scene.view.size);
        if let Some(layer) = layers.iter().find(|l| l.tiles.is_empty() || !l.tiles.fits(scene.view.size)) {
            return Err(WireError::Tiles { node: layer.node, tiles: layer.tiles, picture });
        }
        let owed: u64 = layers.iter().map(|l| u64::from(l.tiles.count())).sum();
        if owed > MAX_TILES_OWED {
            return Err(WireError::TooMany { what: "layers x tiles", got: owed, max: MAX_TILES_OWED });
        }
        disjoint(&layers)?;
        let (session, frame, epoch) = (SessionId(order.session), FrameId(order.frame), Epoch(order.epoch));
        at_most("parts of levels", order.parts.len(), usize::from(MAX_LEVEL) + 1)?;
        at_most("chunks of levels", order.parts.iter().map(|part| part.chunks.len()).sum(), MAX_CHUNKS)?;
        let parts: Vec<LevelPart> = order.parts.into_iter().map(TryInto::try_into).collect::<Result<_, _>>()?;
        if let Some([before, after]) = parts.array_windows().find(|[before, after]| before.level >= after.level) {
            let (before, after) = (before.level.into(), after.level.into());
            return Err(WireError::Order { what: "levels of an order", before, after });
        }
        Ok(Self { session, frame, epoch, store, scene, transport, layers, parts })
    }
}

/// No layer twice, none inside another, no chunk twice.
fn disjoint(layers: &[LayerOrder]) -> Result<(), WireError> {
    let mut nodes = HashSet::with_capacity(layers.len());
    for layer in layers {
        if !nodes.insert(layer.node.0) {
            return Err(WireError::LayerTwice(layer.node));
        }
    }
    for layer in layers {
        let ancestors = std::iter::successors(Some(layer.node.0 >> 1), |n| Some(n >> 1)).take_while(|&n| n > 0);
        for outer in ancestors {
            if nodes.contains(&outer) {
                return Err(WireError::NestedLayers { inner: layer.node, outer: TreeNode(outer) });
            }
        }
    }
    let mut chunks = HashSet::new();
    for chunk in layers.iter().flat_map(|l| &l.chunks) {
        if !chunks.insert(chunk) {
            return Err(WireError::Twice { what: "chunk", index: chunk.linear() });
        }
    }
    Ok(())
}
