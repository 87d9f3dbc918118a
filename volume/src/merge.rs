//! Chunks and the canonical merge tree (docs/definition.md, Exact mode; docs/algorithms.md, One picture whatever the
//! partition).
//!
//! Invariant: the tree is fixed by the store's brick grid alone. Every picture is the leaves (chunks) joined by
//! [`crate::over`] at this tree's nodes only, so its bits do not depend on which node rendered which chunk. A subtree
//! that has nothing to show is the identity of `over` and may be absent.
//!
//! The octree's eight children fold two by two along z, then y, then x; unrolled, this is a binary tree whose root
//! splits x, its children y, their children z, and so on down to chunks. The root is the smallest power-of-two cube of
//! chunks around the grid.

use glam::{DVec3, UVec3};

use crate::brick::{BrickGrid, OwnedBox};
use crate::ids::{BrickIndex, ChunkId, ChunkIndex, TreeNode};

/// The number of chunks that the chunk size leaves at least, where the volume has that many bricks.
pub const MIN_CHUNKS: u64 = 64;

/// From where a picture is seen, as far as visibility order is concerned. Index space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Viewpoint {
    /// Rays leave this point (index space).
    Eye(DVec3),
    /// Rays run along this direction (index space).
    Direction(DVec3),
}

impl Viewpoint {
    /// True where the low side of the plane `axis = plane` (index space) is in front of its high side.
    #[must_use]
    pub fn low_side_first(self, axis: usize, plane: f64) -> bool {
        match self {
            Self::Eye(eye) => eye[axis] < plane,
            Self::Direction(d) => d[axis] >= 0.0,
        }
    }
}

/// The canonical merge tree over a store's chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MergeTree {
    grid: BrickGrid,
    /// Bricks per chunk edge, a power of two.
    chunk_bricks: u32,
    /// The root cube's edge is `2^levels` chunks.
    levels: u32,
}

impl MergeTree {
    /// Chunks are the largest power-of-two cubes of bricks that leave at least [`MIN_CHUNKS`] of them, or single
    /// bricks.
    #[must_use]
    pub fn of(grid: BrickGrid) -> Self {
        let chunk_count = |bricks: u32| grid.dims().map(|n| n.div_ceil(bricks)).as_u64vec3().element_product();
        let mut chunk_bricks = 1;
        while chunk_count(chunk_bricks * 2) >= MIN_CHUNKS {
            chunk_bricks *= 2;
        }
        let widest = grid.dims().map(|n| n.div_ceil(chunk_bricks)).max_element();
        Self { grid, chunk_bricks, levels: widest.next_power_of_two().trailing_zeros() }
    }

    #[must_use]
    pub fn grid(&self) -> BrickGrid {
        self.grid
    }

    /// Bricks per chunk edge.
    #[must_use]
    pub fn chunk_bricks(&self) -> u32 {
        self.chunk_bricks
    }

    /// Chunks per axis.
    #[must_use]
    pub fn chunk_dims(&self) -> UVec3 {
        self.grid.dims().map(|n| n.div_ceil(self.chunk_bricks))
    }

    #[must_use]
    pub fn chunk_count(&self) -> u64 {
        self.chunk_dims().as_u64vec3().element_product()
    }

    /// The place of `chunk` in tables over all chunks, x fastest.
    #[must_use]
    pub fn chunk_id(&self, chunk: ChunkIndex) -> ChunkId {
        let (d, [x, y, z]) = (self.chunk_dims(), chunk.0);
        ChunkId::new(x + d.x * (y + d.y * z))
    }

    /// The chunk at a place of such a table; `None` beyond its end.
    #[must_use]
    pub fn chunk_at(&self, chunk: ChunkId) -> Option<ChunkIndex> {
        let (d, linear) = (self.chunk_dims(), chunk.linear());
        (u64::from(linear) < self.chunk_count())
            .then(|| ChunkIndex([linear % d.x, linear / d.x % d.y, linear / d.x / d.y]))
    }

    /// All places of such a table, ascending.
    pub fn chunk_ids(&self) -> impl Iterator<Item = ChunkId> + use<> {
        (0..self.chunk_count() as u32).map(ChunkId::new)
    }

    /// The chunk that holds `brick`.
    #[must_use]
    pub fn chunk_of(&self, brick: BrickIndex) -> ChunkIndex {
        ChunkIndex(brick.0.map(|v| v / self.chunk_bricks))
    }

    /// The bricks of `chunk`, x fastest.
    pub fn bricks_of(&self, chunk: ChunkIndex) -> impl Iterator<Item = BrickIndex> + use<> {
        let lo = UVec3::from(chunk.0) * self.chunk_bricks;
        let hi = (lo + self.chunk_bricks).min(self.grid.dims());
        (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| BrickIndex([x, y, z]))))
    }

    pub const ROOT: TreeNode = TreeNode(1);

    /// Depth of a leaf: three splits for every octree level.
    #[must_use]
    pub fn leaf_depth(&self) -> u32 {
        3 * self.levels
    }

    /// The chunks `[lo, hi)` under `node`, clipped to the grid; `None` for an id that is no node of this tree or a node
    /// without chunks.
    #[must_use]
    pub fn chunk_box(&self, node: TreeNode) -> Option<(UVec3, UVec3)> {
        let depth = node.0.checked_ilog2()?;
        if depth > self.leaf_depth() {
            return None;
        }
        let mut lo = UVec3::ZERO;
        let mut edge = UVec3::splat(1 << self.levels);
        for level in 0..depth {
            let axis = (level % 3) as usize;
            edge[axis] /= 2;
            lo[axis] += edge[axis] * (node.0 >> (depth - 1 - level) & 1) as u32;
        }
        let hi = (lo + edge).min(self.chunk_dims());
        lo.cmplt(hi).all().then_some((lo, hi))
    }

    /// The voxels under `node`.
    #[must_use]
    pub fn voxel_box(&self, node: TreeNode) -> Option<OwnedBox> {
        let (lo, hi) = self.chunk_box(node)?;
        let voxels = self.chunk_bricks * self.grid.brick_size();
        Some(OwnedBox { lo: lo * voxels, hi: (hi * voxels).min(self.grid.volume_dims()) })
    }

    /// True where `node` is a single chunk's leaf.
    #[must_use]
    pub fn is_leaf(&self, node: TreeNode) -> bool {
        node.0.checked_ilog2() == Some(self.leaf_depth())
    }

    /// The leaf of `chunk`.
    #[must_use]
    pub fn leaf(&self, chunk: ChunkIndex) -> TreeNode {
        let mut path = 1;
        for bit in (0..self.levels).rev() {
            for v in chunk.0 {
                path = path << 1 | u64::from(v >> bit & 1);
            }
        }
        TreeNode(path)
    }

    /// True where `node` lies in the subtree of `ancestor` (or is it).
    #[must_use]
    pub fn is_under(&self, node: TreeNode, ancestor: TreeNode) -> bool {
        let (n, a) = (node.0.max(1).ilog2(), ancestor.0.max(1).ilog2());
        n >= a && node.0 >> (n - a) == ancestor.0
    }

    /// The children of an inner node as `(front, back)` seen from `from`.
    #[must_use]
    pub fn front_and_back(&self, node: TreeNode, from: Viewpoint) -> (TreeNode, TreeNode) {
        let depth = node.0.max(1).ilog2();
        let axis = (depth % 3) as usize;
        // The low corner of the high child, in voxels, not clipped to the grid.
        let mut lo = 0_u64;
        let mut edge = 1_u64 << self.levels;
        for level in (axis as u32..depth).step_by(3) {
            edge /= 2;
            lo += edge * (node.0 >> (depth - 1 - level) & 1);
        }
        let plane = (lo + edge / 2) * u64::from(self.chunk_bricks * self.grid.brick_size());
        let (low, high) = (TreeNode(node.0 * 2), TreeNode(node.0 * 2 + 1));
        if from.low_side_first(axis, plane as f64) { (low, high) } else { (high, low) }
    }

    /// Joins layers at the tree's nodes, from `node` down. `layer` answers `Some` for a node whose layer is given (its
    /// subtree is then not visited); `join` is `front over back`. Absent subtrees are the identity.
    pub fn fold<T>(
        &self,
        node: TreeNode,
        from: Viewpoint,
        layer: &mut impl FnMut(TreeNode) -> Option<T>,
        join: &mut impl FnMut(T, T) -> T,
    ) -> Option<T> {
        self.fold_by(node, &|node| self.front_and_back(node, from), layer, join)
    }

    /// As [`MergeTree::fold`]; `order` gives the children of an inner node as `(front, back)`.
    pub fn fold_by<T>(
        &self,
        node: TreeNode,
        order: &impl Fn(TreeNode) -> (TreeNode, TreeNode),
        layer: &mut impl FnMut(TreeNode) -> Option<T>,
        join: &mut impl FnMut(T, T) -> T,
    ) -> Option<T> {
        self.chunk_box(node)?;
        if let Some(found) = layer(node) {
            return Some(found);
        }
        if self.is_leaf(node) {
            return None;
        }
        let (front, back) = order(node);
        match (self.fold_by(front, order, layer, join), self.fold_by(back, order, layer, join)) {
            (Some(f), Some(b)) => Some(join(f, b)),
            (one, other) => one.or(other),
        }
    }

    /// The maximal subtrees all of whose chunks that satisfy `active` satisfy `mine` too, with those chunks in the
    /// tree's order: the layers that a node which renders `mine` can merge without changing a bit.
    pub fn layers(
        &self,
        active: &impl Fn(ChunkIndex) -> bool,
        mine: &impl Fn(ChunkIndex) -> bool,
    ) -> Vec<(TreeNode, Vec<ChunkIndex>)> {
        let mut layers = Vec::new();
        if let Cover::Whole(chunks) = self.cover(Self::ROOT, active, mine, &mut layers)
            && !chunks.is_empty()
        {
            layers.push((Self::ROOT, chunks));
        }
        layers
    }

    fn cover(
        &self,
        node: TreeNode,
        active: &impl Fn(ChunkIndex) -> bool,
        mine: &impl Fn(ChunkIndex) -> bool,
        layers: &mut Vec<(TreeNode, Vec<ChunkIndex>)>,
    ) -> Cover {
        let Some((lo, _)) = self.chunk_box(node) else { return Cover::Whole(Vec::new()) };
        if self.is_leaf(node) {
            let chunk = ChunkIndex(lo.into());
            return match (active(chunk), mine(chunk)) {
                (false, _) => Cover::Whole(Vec::new()),
                (true, true) => Cover::Whole(vec![chunk]),
                (true, false) => Cover::Split,
            };
        }
        let children = [TreeNode(node.0 * 2), TreeNode(node.0 * 2 + 1)];
        let covers = children.map(|child| self.cover(child, active, mine, layers));
        match covers {
            [Cover::Whole(mut low), Cover::Whole(high)] => {
                low.extend(high);
                Cover::Whole(low)
            }
            split => {
                for (child, cover) in children.into_iter().zip(split) {
                    if let Cover::Whole(chunks) = cover
                        && !chunks.is_empty()
                    {
                        layers.push((child, chunks));
                    }
                }
                Cover::Split
            }
        }
    }

    /// All chunks in the tree's order (a Z-order curve): contiguous runs are compact in space.
    #[must_use]
    pub fn chunks_in_tree_order(&self) -> Vec<ChunkIndex> {
        self.layers(&|_| true, &|_| true).into_iter().flat_map(|(_, chunks)| chunks).collect()
    }
}

enum Cover {
    /// All active chunks of the subtree are mine: these.
    Whole(Vec<ChunkIndex>),
    /// Someone else renders a part.
    Split,
}

/// Sorts bricks front to back: with `e = floor(eye in brick units)`, not clamped, the key `|i-ex| + |j-ey| + |k-ez|`
/// grows along every ray, and bricks of equal key never share a ray; for parallel rays the key is `sum sign(d_a) i_a`.
/// Ties keep the grid's order, so the result is deterministic.
pub fn sort_front_to_back(bricks: &mut [BrickIndex], brick_size: u32, from: Viewpoint) {
    let key = |b: &BrickIndex| -> i64 {
        match from {
            Viewpoint::Eye(eye) => {
                let e = (eye / f64::from(brick_size)).floor().as_i64vec3();
                (0..3).map(|a| i64::from(b.0[a]).saturating_sub(e[a]).saturating_abs()).sum()
            }
            Viewpoint::Direction(d) => (0..3)
                .map(|a| match d[a] {
                    v if v > 0.0 => i64::from(b.0[a]),
                    v if v < 0.0 => -i64::from(b.0[a]),
                    _ => 0,
                })
                .sum(),
        }
    };
    bricks.sort_by_key(|b| (key(b), b.0[2], b.0[1], b.0[0]));
}

#[cfg(test)]
mod tests;
