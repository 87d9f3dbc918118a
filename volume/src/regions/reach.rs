//! What a brick's rays can meet where they read further than the margin that the store speaks of.

use super::table::{BrickFacts, NO_REGION};
use crate::brick::{BrickGrid, RANGE_MARGIN};
use crate::ids::{BrickId, BrickIndex};

/// The range of codes, and what is known of regions, over the brick's owned box grown by what positions up to `reach`
/// voxels beyond it read: the brick's own where the store's margin covers that (steps up to one voxel), else joined
/// with those of all bricks so far.
#[must_use]
pub fn within_reach(
    grid: &BrickGrid,
    ranges: &[[u16; 2]],
    facts: Option<&[BrickFacts]>,
    brick: BrickIndex,
    reach: u32,
) -> ([u16; 2], Option<BrickFacts>) {
    let own = grid.id(brick);
    let range_of = |brick: BrickId| ranges.get(brick.index()).copied().unwrap_or([0, u16::MAX]);
    let fact_of = |brick: BrickId| facts.and_then(|f| f.get(brick.index())).copied();
    let (mut range, mut fact) = (range_of(own), fact_of(own));
    if reach < RANGE_MARGIN {
        return (range, fact);
    }
    let bricks = (reach + 1).div_ceil(grid.brick_size());
    let dims = grid.dims();
    let span = |a: usize| brick.0[a].saturating_sub(bricks)..=(brick.0[a] + bricks).min(dims[a] - 1);
    for z in span(2) {
        for y in span(1) {
            for x in span(0) {
                let near = grid.id(BrickIndex([x, y, z]));
                let [min, max] = range_of(near);
                range = [range[0].min(min), range[1].max(max)];
                fact = match (fact, fact_of(near)) {
                    (Some(a), Some(b)) => Some(joined(a, b)),
                    _ => None,
                };
            }
        }
    }
    (range, fact)
}

fn joined(a: BrickFacts, b: BrickFacts) -> BrickFacts {
    BrickFacts {
        min: a.min.min(b.min),
        max: a.max.max(b.max),
        deviation: a.deviation.max(b.deviation),
        has_regions: a.has_regions || b.has_regions,
        has_leaps: a.has_leaps || b.has_leaps,
        only_region: if a.only_region == b.only_region { a.only_region } else { NO_REGION },
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    /// One brick differs: the bricks whose reach holds one of its voxels must know, others must not.
    #[test]
    fn ranges_are_joined_as_far_as_positions_reach() {
        let grid = BrickGrid::new(UVec3::new(80, 8, 20), 8).unwrap();
        let mut ranges = vec![[100, 200]; grid.brick_count() as usize];
        let odd = BrickIndex([5, 0, 1]);
        ranges[grid.id(odd).index()] = [7, 200];
        for reach in [0, 1, 2, 7, 8, 16] {
            for brick in grid.bricks() {
                let (range, facts) = within_reach(&grid, &ranges, None, brick, reach);
                assert!(facts.is_none());
                let away = brick.0[0].abs_diff(5).max(brick.0[2].abs_diff(1));
                // Its voxels, and the margin that its own range holds.
                let knows = away == 0 || (reach >= 2 && (away - 1) * 8 < reach + 1);
                assert_eq!(range[0] == 7, knows, "{brick} with {reach}");
            }
        }
    }
}
