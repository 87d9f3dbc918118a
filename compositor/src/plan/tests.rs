//! Tables and their changes: nobody's chunks get lost, and nobody moves without need.

use brickcast_volume::BrickGrid;
use brickcast_volume::merge::MergeTree;
use brickcast_volume::{BrickId, ChunkId, Epoch, FrameId, View};

use super::*;
use crate::frame::ledger::{Ledger, Ticket, Void};

/// 5 x 4 x 4 chunks of one brick; every third shows nothing.
fn shown() -> Shown {
    let grid = BrickGrid::new(glam::UVec3::new(80, 64, 64), 16).unwrap();
    let tree = MergeTree::of(grid);
    let bricks: Vec<bool> = (0..grid.brick_count()).map(|b| b % 3 != 0).collect();
    Shown::of(tree, bricks)
}

fn bricks(table: &Assignment, shown: &Shown, nodes: usize) -> Vec<Vec<BrickId>> {
    (0..nodes).map(|n| table.bricks_of(shown, n)).collect()
}

#[test]
fn chunks_of_absent_nodes_go_to_the_others_and_nobody_elses_move() {
    let shown = shown();
    let whole = Assignment::contiguous(&shown, 4);
    let before = bricks(&whole, &shown, 4);
    let table = whole.clone().without_absent(&shown, &[true, false, true, false]);
    let after = bricks(&table, &shown, 4);
    assert!(after[1].is_empty() && after[3].is_empty());
    for node in [0, 2] {
        assert!(before[node].iter().all(|b| after[node].contains(b)), "node {node} lost a brick");
        let moved = after[node].len() - before[node].len();
        assert!(moved + 1 >= (before[1].len() + before[3].len()) / 2, "node {node} took {moved}");
    }
    assert_eq!(after.iter().map(Vec::len).sum::<usize>(), shown.brick_count());
    // A node that returns finds the old table.
    assert_eq!(bricks(&whole.clone().without_absent(&shown, &[true; 4]), &shown, 4), before);
    // With nobody left there is nobody to deal to.
    assert_eq!(whole.clone().without_absent(&shown, &[false; 4]), whole);
}

/// What several nodes share of a view, and what is dealt again of it, is each tile of each chunk once.
#[test]
fn shared_chunks_are_ordered_once_tile_by_tile() {
    let shown = shown();
    let geometry = brickcast_volume::Geometry::new([80, 64, 64], [1.0; 3], [0.0; 3]).unwrap();
    let camera = brickcast_volume::Camera::orbit(&geometry, brickcast_volume::Orbit::default()).unwrap();
    let size = brickcast_volume::PictureSize::new(1200, 1000).unwrap();
    let view = View::new(&geometry, &camera, size, 1.0).unwrap();
    let in_view = InView::new(&shown, &view);
    let shares = |tiles: &brickcast_proto::TileRect| {
        let count = tiles.strip_count();
        vec![(2, [0, count / 3]), (0, [count / 3, count / 2]), (1, [count / 2, count])]
    };
    let even = in_view.chunks().into_iter().filter(|(c, _)| c.linear() % 2 == 0);
    let shared = even.map(|(c, tiles)| (c, shares(&tiles))).collect();
    let table = Assignment::contiguous(&shown, 3).sharing(shared);
    let mut ledger = Ledger::new(FrameId(1), Epoch(1), in_view.chunks());
    let (mut tickets, mut shared) = (0, 0);
    for node in 0..3 {
        for layers in in_view.orders_of(&table, node) {
            // The ledger refuses what is owed already.
            ledger.order(Ticket(tickets), &layers).unwrap();
            shared += layers.iter().filter(|l| !in_view.chunks().values().any(|tiles| *tiles == l.tiles)).count();
            tickets += 1;
        }
        let holds = table.chunks_of(node);
        assert!(in_view.chunks().keys().filter(|c| c.linear() % 2 == 0).all(|c| holds.contains(c)));
    }
    assert!(ledger.unordered().is_empty() && tickets == 3 && shared > 20, "{tickets}, {shared}");
    // Two of three are lost; of what they leave, some chunks are open in part only.
    ledger.make_void(Ticket(1), Void::All);
    ledger.make_void(Ticket(2), Void::All);
    let open = ledger.unordered().clone();
    assert!(open.iter().any(|(_, tiles)| tiles.len() > 1), "parts at both ends");
    for (i, orders) in in_view.deal(&shown, &open, 2).into_iter().enumerate() {
        assert!(!orders.is_empty());
        for layers in orders {
            ledger.order(Ticket(10 + i), &layers).unwrap();
        }
    }
    assert!(ledger.unordered().is_empty());
    // Absent nodes share nothing.
    let rest = table.without_absent(&shown, &[true, false, true]);
    assert!((0..80).map(ChunkId::new).all(|c| rest.sharers_of(c).is_empty()));
}

#[test]
fn runs_cover_every_chunk_once_in_nearly_equal_shares() {
    let shown = shown();
    let all: Vec<ChunkId> = (0..80).map(ChunkId::new).collect();
    for count in 1..=7 {
        let runs = shown.runs(&all, count);
        assert_eq!(runs.iter().map(|(c, _)| *c).collect::<Vec<_>>(), all);
        assert!(runs.windows(2).all(|w| w[0].1 <= w[1].1) && runs.iter().all(|(_, r)| *r < count));
        let weight = |run| runs.iter().filter(|(_, r)| *r == run).map(|(c, _)| shown.per_chunk[*c]).sum::<u32>();
        let weights: Vec<u32> = (0..count).map(weight).collect();
        let (least, most) = (weights.iter().min().unwrap(), weights.iter().max().unwrap());
        assert!(most - least <= 2, "{count}: {weights:?}");
    }
}
