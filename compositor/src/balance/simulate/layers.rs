//! The merge tree over a grid of chunks (as [`brickcast_volume::merge`], for grids of any number): order, and the
//! layers of a division.

use brickcast_volume::ChunkId;
use glam::UVec3;

use super::grid::chunk_at;

/// One tree node: two children, or a chunk.
#[derive(Debug)]
enum Node {
    Leaf(ChunkId),
    Inner(Box<Node>, Box<Node>),
}

#[derive(Debug)]
pub(super) struct Tree {
    root: Node,
}

impl Tree {
    pub(super) fn new(dims: UVec3) -> Self {
        let edge = UVec3::splat(dims.max_element().next_power_of_two());
        let root = build(UVec3::ZERO, edge, 0, dims).unwrap_or(Node::Leaf(ChunkId::default()));
        Self { root }
    }

    /// All chunks, so that runs of them are compact in space.
    pub(super) fn order(&self) -> Vec<ChunkId> {
        fn walk(node: &Node, out: &mut Vec<ChunkId>) {
            match node {
                Node::Leaf(chunk) => out.push(*chunk),
                Node::Inner(low, high) => {
                    walk(low, out);
                    walk(high, out);
                }
            }
        }
        let mut order = Vec::new();
        walk(&self.root, &mut order);
        order
    }

    /// The largest subtrees that one node renders whole: their chunks. `owner`: `None` where a chunk is cut or out of
    /// view.
    pub(super) fn layers(
        &self,
        in_view: &impl Fn(ChunkId) -> bool,
        owner: &impl Fn(ChunkId) -> Option<usize>,
    ) -> Vec<Vec<ChunkId>> {
        let mut layers = Vec::new();
        if let Cover::One(_, chunks) = cover(&self.root, in_view, owner, &mut layers) {
            layers.push(chunks);
        }
        layers
    }
}

fn build(lo: UVec3, edge: UVec3, axis: usize, dims: UVec3) -> Option<Node> {
    if !lo.cmplt(dims).all() {
        return None;
    }
    if edge == UVec3::ONE {
        return Some(Node::Leaf(chunk_at(dims, lo)));
    }
    let mut half = edge;
    half[axis] /= 2;
    let mut high = lo;
    high[axis] += half[axis];
    let next = (axis + 1) % 3;
    match (build(lo, half, next, dims), build(high, half, next, dims)) {
        (Some(low), Some(high)) => Some(Node::Inner(Box::new(low), Box::new(high))),
        (one, other) => one.or(other),
    }
}

enum Cover {
    /// Nothing in view.
    Nothing,
    One(usize, Vec<ChunkId>),
    /// What one node renders of it is among the layers already.
    Several,
}

fn cover(
    node: &Node,
    in_view: &impl Fn(ChunkId) -> bool,
    owner: &impl Fn(ChunkId) -> Option<usize>,
    layers: &mut Vec<Vec<ChunkId>>,
) -> Cover {
    let (low, high) = match node {
        Node::Leaf(chunk) if !in_view(*chunk) => return Cover::Nothing,
        Node::Leaf(chunk) => return owner(*chunk).map_or(Cover::Several, |owner| Cover::One(owner, vec![*chunk])),
        Node::Inner(low, high) => (cover(low, in_view, owner, layers), cover(high, in_view, owner, layers)),
    };
    match (low, high) {
        (Cover::Nothing, other) | (other, Cover::Nothing) => other,
        (Cover::One(a, mut chunks), Cover::One(b, more)) if a == b => {
            chunks.extend(more);
            Cover::One(a, chunks)
        }
        (low, high) => {
            for side in [low, high] {
                if let Cover::One(_, chunks) = side {
                    layers.push(chunks);
                }
            }
            Cover::Several
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_cover_every_chunk_in_view_once() {
        let tree = Tree::new(UVec3::new(5, 3, 6));
        let mut order = tree.order();
        order.sort_unstable();
        assert_eq!(order, (0..90).map(ChunkId::new).collect::<Vec<_>>());
        assert_eq!(tree.layers(&|_| true, &|_| Some(3)).len(), 1);
        let is_multiple_of = |c: ChunkId, n| c.index().is_multiple_of(n);
        let owner = |c: ChunkId| (!is_multiple_of(c, 11)).then_some(c.index() / 7 % 4);
        let layers = tree.layers(&|c| !is_multiple_of(c, 5), &owner);
        let mut all: Vec<ChunkId> = layers.concat();
        assert!(layers.iter().all(|l| l.iter().all(|c| owner(*c) == owner(l[0]))));
        all.sort_unstable();
        let mut want: Vec<ChunkId> = (0..90).map(ChunkId::new).collect();
        want.retain(|c| !is_multiple_of(*c, 5) && !is_multiple_of(*c, 11));
        assert_eq!(all, want);
    }
}
