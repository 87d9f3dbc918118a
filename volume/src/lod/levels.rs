//! The levels of a volume as trees of chunks.
//!
//! Invariant: the merge trees of all levels have one root cube. A level's chunk is the same cube of the world as one
//! node of the finest tree, and by the same heap path: a leaf of its level's tree, and a leaf of the finest or an inner
//! node above some. So a layer of any level can be joined at the finest tree's nodes. It holds since bricks of all
//! levels have as many voxels, `ceil(ceil(n / 2^l) / b) = ceil(n / (2^l b))`, and chunks are powers of two of bricks.

use crate::brick::{BrickGrid, OwnedBox};
use crate::ids::{BrickIndex, ChunkIndex};
use crate::merge::MergeTree;
use crate::space::Geometry;
use glam::{DVec3, UVec3};

/// A volume, and the merge tree of each of its levels, the finest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    geometry: Geometry,
    trees: Vec<MergeTree>,
}

impl Levels {
    /// The first `count` levels of a volume in bricks of `grid`, itself among them; no more than there are until one
    /// is a single brick.
    #[must_use]
    pub fn new(geometry: &Geometry, grid: BrickGrid, count: u8) -> Self {
        let last = grid.dims().max_element().next_power_of_two().trailing_zeros() as u8;
        let tree = |level: u8| {
            let dims = grid.volume_dims().map(|n| n.div_ceil(1 << level));
            BrickGrid::new(dims, grid.brick_size()).ok().map(MergeTree::of)
        };
        let coarser = (1..count.min(last + 1)).map_while(tree);
        Self { geometry: *geometry, trees: std::iter::once(MergeTree::of(grid)).chain(coarser).collect() }
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u8 {
        self.trees.len() as u8
    }

    /// All levels, the finest first.
    pub fn all(&self) -> std::ops::Range<u8> {
        0..self.count()
    }

    /// The volume's, in finest voxels.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The finest level's tree, at whose nodes layers of all levels are joined.
    #[must_use]
    pub fn finest(&self) -> &MergeTree {
        &self.trees[0]
    }

    /// A level's own tree; that of the coarsest for one beyond it.
    #[must_use]
    pub fn tree(&self, level: u8) -> &MergeTree {
        &self.trees[usize::from(level).min(self.trees.len() - 1)]
    }

    /// Finest chunks along an edge of a level's chunk: a power of two.
    fn ratio(&self, level: u8) -> u32 {
        (self.tree(level).chunk_bricks() << level) / self.finest().chunk_bricks()
    }

    /// The chunk of `level` in which a finest chunk lies.
    #[must_use]
    pub fn over(&self, level: u8, finest: ChunkIndex) -> ChunkIndex {
        ChunkIndex(finest.0.map(|v| v / self.ratio(level)))
    }

    /// The finest chunks in a level's chunk.
    pub fn under(&self, level: u8, chunk: ChunkIndex) -> impl Iterator<Item = ChunkIndex> + use<> {
        within(chunk, self.ratio(level), self.finest().chunk_dims())
    }

    /// The chunks of the next finer level in a level's chunk: one, or eight and fewer at the volume's ends.
    pub(super) fn refined(&self, level: u8, chunk: ChunkIndex) -> impl Iterator<Item = ChunkIndex> + use<> {
        let finer = level.saturating_sub(1);
        within(chunk, self.ratio(level) / self.ratio(finer), self.tree(finer).chunk_dims())
    }

    /// The finest voxels that a level's chunk stands for; at the volume's high ends those beyond the last, which it
    /// covers too.
    #[must_use]
    pub fn voxels(&self, level: u8, chunk: ChunkIndex) -> OwnedBox {
        let tree = self.tree(level);
        let edge = tree.chunk_bricks() * tree.grid().brick_size();
        let lo = UVec3::from(chunk.0) * edge;
        let hi = (lo + edge).min(tree.grid().volume_dims());
        OwnedBox { lo: lo * (1 << level), hi: hi * (1 << level) }
    }

    /// The middles of the tiles (bricks of `level`, as if none was cut by the volume's end) in a level's chunk, world.
    pub(super) fn tiles(&self, level: u8, chunk: ChunkIndex) -> impl Iterator<Item = DVec3> + '_ {
        let edge = self.tile_edge(level);
        let middle = move |brick: BrickIndex| (UVec3::from(brick.0).as_dvec3() + 0.5) * edge;
        self.tree(level).bricks_of(chunk).map(move |brick| self.geometry.world_from_voxel(middle(brick)))
    }

    /// The length of a level's tile from corner to corner, world.
    pub(super) fn tile_diagonal(&self, level: u8) -> f64 {
        (self.geometry.spacing() * self.tile_edge(level)).length()
    }

    /// Of a tile, in finest voxels.
    fn tile_edge(&self, level: u8) -> f64 {
        f64::from(self.finest().grid().brick_size()) * f64::from(level).exp2()
    }
}

/// The cubes of a grid of `dims` in a cube that is `ratio` of them long.
fn within(cube: ChunkIndex, ratio: u32, dims: UVec3) -> impl Iterator<Item = ChunkIndex> + use<> {
    let lo = UVec3::from(cube.0) * ratio;
    let hi = (lo + ratio).min(dims);
    (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| ChunkIndex([x, y, z]))))
}
