//! The tree's shape, its order, and that any assignment of chunks folds to one picture.

use super::*;
use std::collections::HashMap;

fn tree(dims: [u32; 3], brick: u32) -> MergeTree {
    MergeTree::of(BrickGrid::new(dims.into(), brick).unwrap())
}

#[test]
fn chunks_are_the_largest_that_leave_sixty_four() {
    assert_eq!(tree([256; 3], 64).chunk_bricks(), 1);
    assert_eq!(tree([256; 3], 16).chunk_bricks(), 4);
    assert_eq!(tree([256, 256, 128], 32).chunk_bricks(), 1);
    assert_eq!(tree([256, 256, 128], 16).chunk_bricks(), 2);
    assert_eq!(tree([10, 10, 10], 64).chunk_bricks(), 1);
}

#[test]
fn leaves_boxes_and_order_agree() {
    for dims in [[100, 30, 7], [256, 256, 128], [9, 9, 300]] {
        let t = tree(dims, 8);
        let order = t.chunks_in_tree_order();
        assert_eq!((order.len(), order.len() as u64), (t.chunk_ids().count(), t.chunk_count()));
        for c in order {
            let (lo, hi) = t.chunk_box(t.leaf(c)).unwrap();
            assert_eq!((lo, hi), (UVec3::from(c.0), UVec3::from(c.0) + 1));
            assert!(t.is_leaf(t.leaf(c)) && t.is_under(t.leaf(c), MergeTree::ROOT));
            assert_eq!(t.chunk_at(t.chunk_id(c)), Some(c));
        }
        assert_eq!(t.chunk_box(TreeNode(0)), None);
        assert_eq!(t.chunk_box(TreeNode(u64::MAX)), None);
    }
}

/// Whoever renders what, folding the layers gives the fold of the leaves: the very nesting of `over`, as text.
#[test]
fn any_assignment_folds_to_the_same_nesting() {
    let t = tree([70, 50, 90], 16);
    for from in [
        Viewpoint::Eye(DVec3::new(30.0, -10.0, 44.0)),
        Viewpoint::Eye(DVec3::new(32.0, 16.0, 64.0)),
        Viewpoint::Direction(DVec3::new(-1.0, 0.0, 0.5)),
    ] {
        let mut join = |f: String, b: String| format!("({f} {b})");
        let mut leaf = |n: TreeNode| t.is_leaf(n).then(|| n.0.to_string());
        let whole = t.fold(MergeTree::ROOT, from, &mut leaf, &mut join).unwrap();
        for nodes in [2_u32, 3, 5] {
            let owner = |c: ChunkIndex| (t.chunk_id(c).linear().wrapping_mul(2_654_435_761) >> 16) % nodes;
            let mut layers = HashMap::new();
            for node in 0..nodes {
                for (n, _) in t.layers(&|_| true, &|c| owner(c) == node) {
                    layers.insert(n, t.fold(n, from, &mut leaf, &mut join).unwrap());
                }
            }
            let merged = t.fold(MergeTree::ROOT, from, &mut |n| layers.get(&n).cloned(), &mut join);
            assert_eq!(merged.as_ref(), Some(&whole));
        }
    }
}

/// Walk random rays through the grid: keys must grow strictly from brick to brick.
#[test]
fn keys_grow_along_every_ray() {
    let size = 8.0;
    for seed in 0..2000_u64 {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut eye = DVec3::new(random(), random(), random()) * 120.0 - 40.0;
        if seed % 3 == 0 {
            eye = (eye / size).round() * size; // on brick faces
        }
        let d = (DVec3::new(random(), random(), random()) - 0.5).normalize();
        let mut seen: Vec<BrickIndex> = Vec::new();
        for k in 0..8000 {
            let b = ((eye + d * (f64::from(k) * 0.013)) / size).floor();
            if b.cmpge(DVec3::ZERO).all() && b.cmplt(DVec3::splat(5.0)).all() {
                let b = BrickIndex(b.as_uvec3().into());
                if seen.last() != Some(&b) {
                    seen.push(b);
                }
            }
        }
        for from in [Viewpoint::Eye(eye), Viewpoint::Direction(d)] {
            let mut sorted = seen.clone();
            sorted.reverse();
            sort_front_to_back(&mut sorted, size as u32, from);
            assert_eq!(sorted, seen, "{from:?}");
        }
    }
}
