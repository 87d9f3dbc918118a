//! Tables and their changes: nobody's chunks get lost, and nobody moves without need.

use brickcast_volume::BrickGrid;

use super::*;

/// 5 x 4 x 4 chunks of one brick; every third shows nothing.
fn shown() -> Shown {
    let grid = BrickGrid::new(glam::UVec3::new(80, 64, 64), 16).unwrap();
    let tree = MergeTree::of(grid);
    let bricks: Vec<bool> = (0..grid.brick_count()).map(|b| b % 3 != 0).collect();
    let per_chunk = grid.bricks().map(|b| u32::from(bricks[grid.linear(b)])).collect();
    Shown { tree, bricks, per_chunk }
}

fn bricks(table: &Assignment, shown: &Shown, nodes: usize) -> Vec<Vec<u32>> {
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

#[test]
fn runs_cover_every_chunk_once_in_nearly_equal_shares() {
    let shown = shown();
    let all: Vec<u32> = (0..80).collect();
    for count in 1..=7 {
        let runs = shown.runs(&all, count);
        assert_eq!(runs.iter().map(|(c, _)| *c).collect::<Vec<_>>(), all);
        assert!(runs.windows(2).all(|w| w[0].1 <= w[1].1) && runs.iter().all(|(_, r)| *r < count));
        let weight =
            |run| runs.iter().filter(|(_, r)| *r == run).map(|(c, _)| shown.per_chunk[*c as usize]).sum::<u32>();
        let weights: Vec<u32> = (0..count).map(weight).collect();
        let (least, most) = (weights.iter().min().unwrap(), weights.iter().max().unwrap());
        assert!(most - least <= 2, "{count}: {weights:?}");
    }
}
