use std::collections::HashMap;

use super::*;
use crate::brick::BrickGrid;
use crate::ids::BrickIndex;

const BRICK: u32 = 8;
/// Odd and even ends; bricks that are cut.
const DIMS: UVec3 = UVec3::new(61, 48, 37);

fn random(at: IVec3, seed: i32) -> u16 {
    let parts = [(at.x, 73_856_093), (at.y, 19_349_663), (at.z, 83_492_791), (seed, 92_837_111)];
    let hash = parts.iter().fold(0, |hash: i32, (v, by)| (hash ^ v.wrapping_mul(*by)).rotate_left(7));
    (hash.wrapping_mul(0x2c1b_3c6d) >> 12) as u16
}

/// The brick of a level whose voxels are `of`, clamped at the volume's edge.
fn brick(grid: &BrickGrid, index: BrickIndex, ghost: u32, of: &dyn Fn(IVec3) -> u16) -> (OwnedBox, BrickVoxels) {
    let owned = grid.owned_box(index);
    let stored = owned.stored(ghost);
    let last = grid.volume_dims().as_ivec3() - 1;
    let mut codes = Vec::new();
    for z in stored.lo.z..stored.hi.z {
        for y in stored.lo.y..stored.hi.y {
            codes.extend((stored.lo.x..stored.hi.x).map(|x| of(IVec3::new(x, y, z).clamp(IVec3::ZERO, last))));
        }
    }
    (owned, BrickVoxels { stored, codes, has_holes: false })
}

fn at(voxels: &BrickVoxels, at: IVec3) -> u16 {
    let (p, d) = ((at - voxels.stored.lo).as_uvec3(), voxels.stored.dims());
    voxels.codes[((p.z * d.y + p.y) * d.x + p.x) as usize]
}

/// A random volume, and a coarser level that has nothing to do with it.
fn grids() -> [BrickGrid; 2] {
    [DIMS, DIMS.map(|n| n.div_ceil(2))].map(|dims| BrickGrid::new(dims, BRICK).unwrap())
}

fn met(index: BrickIndex, ghost: u32, coarser: Sides) -> (OwnedBox, BrickVoxels) {
    let [fine, coarse] = grids();
    let (owned, mut voxels) = brick(&fine, index, ghost, &|at| random(at, 1));
    let (_, over) = brick(&coarse, BrickIndex(index.0.map(|v| v / 2)), ghost, &|at| random(at, 2));
    take_coarser(&mut voxels, (&owned, DIMS), coarser, &over, false);
    (owned, voxels)
}

/// What the coarser level interpolates at a place, in fine voxels.
fn coarse_at(place: [f64; 3]) -> f64 {
    let last = (grids()[1].volume_dims().as_ivec3() - 1).to_array();
    let place = place.map(|v| v / 2.0 - 0.5);
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let (mut voxel, mut weight) = ([0; 3], 1.0);
        for axis in 0..3 {
            let (low, share) = (place[axis].floor(), place[axis] - place[axis].floor());
            let is_high = corner >> axis & 1 == 1;
            voxel[axis] = (low as i32 + i32::from(is_high)).clamp(0, last[axis]);
            weight *= if is_high { share } else { 1.0 - share };
        }
        sum += weight * f64::from(random(voxel.into(), 2));
    }
    sum
}

/// Along the normal of a border both sides interpolate the same function; what does not touch the border is as it was.
#[test]
fn a_brick_continues_the_coarser_one_that_it_meets() {
    let [fine, _] = grids();
    for (index, axis, side) in [([3, 2, 1], 0, 1), ([4, 2, 1], 0, -1), ([5, 3, 2], 1, 1), ([2, 2, 2], 2, -1)] {
        let mut place = [0; 3];
        place[axis] = side;
        let (owned, voxels) = met(BrickIndex(index), 2, Sides::around(|at| at == place));
        let plane = if side > 0 { owned.hi[axis] } else { owned.lo[axis] } as i32;
        let (_, plain) = brick(&fine, BrickIndex(index), 2, &|at| random(at, 1));
        let (mut changed, mut jumps) = (0, 0);
        for z in owned.lo.z as i32..owned.hi.z as i32 {
            for y in owned.lo.y as i32..owned.hi.y as i32 {
                for x in owned.lo.x as i32..owned.hi.x as i32 {
                    let voxel = IVec3::new(x, y, z);
                    let is_outermost = voxel[axis] == if side > 0 { plane - 1 } else { plane };
                    if !is_outermost {
                        assert_eq!(at(&voxels, voxel), at(&plain, voxel), "{voxel} does not touch it");
                        continue;
                    }
                    let mut beyond = voxel;
                    beyond[axis] += side;
                    let middle = |v: IVec3| v.as_dvec3() + 0.5;
                    for share in [0.0, 0.25, 0.5, 1.0] {
                        let between = |of: &BrickVoxels| {
                            f64::from(at(of, voxel)) * (1.0 - share) + f64::from(at(of, beyond)) * share
                        };
                        let want = coarse_at((middle(voxel).lerp(middle(beyond), share)).to_array());
                        assert!((between(&voxels) - want).abs() <= 0.5, "{voxel}: {} {want}", between(&voxels));
                        jumps += u32::from((between(&plain) - want).abs() > 1000.0);
                    }
                    changed += 1;
                }
            }
        }
        assert!(changed == 64 && jumps > 200, "{changed} voxels, {jumps} jumps before");
    }
}

/// Whatever the places of levels are, a voxel that several bricks store has one value.
#[test]
fn bricks_agree_on_the_voxels_that_they_share() {
    let fine = grids()[0];
    let (mut shared, mut taken) = (0, 0);
    for seed in 3..9 {
        let dims = fine.dims().as_ivec3();
        // Coarse bricks as a whole, or eight fine ones.
        let is_coarse = |brick: IVec3| {
            let is_there = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(dims).all();
            is_there && random(brick.map(|v| v.div_euclid(2)), seed).is_multiple_of(3)
        };
        let mut known: HashMap<IVec3, u16> = HashMap::new();
        for index in fine.bricks().filter(|index| !is_coarse(index.0.map(|v| v as i32).into())) {
            let around = |side: [i32; 3]| is_coarse(IVec3::from(index.0.map(|v| v as i32)) + IVec3::from(side));
            let (_, voxels) = met(index, 3, Sides::around(around));
            let stored = voxels.stored;
            for (i, &code) in voxels.codes.iter().enumerate() {
                let (d, i) = (stored.dims(), i as u32);
                let place = stored.lo + UVec3::new(i % d.x, i / d.x % d.y, i / (d.x * d.y)).as_ivec3();
                let place = place.clamp(IVec3::ZERO, DIMS.as_ivec3() - 1);
                taken += u32::from(code != random(place, 1));
                if let Some(other) = known.insert(place, code) {
                    assert_eq!(other, code, "{place}, seed {seed}, {index:?}");
                    shared += 1;
                }
            }
        }
    }
    assert!(shared > 100_000 && taken > 50_000, "{shared} {taken}");
}

#[test]
fn voxels_without_data_stay_and_count_for_nothing() {
    let [fine, coarse] = grids();
    let index = BrickIndex([2, 2, 2]);
    let hole = IVec3::new(23, 20, 20);
    let code = |at: IVec3| if at == hole { NO_DATA_CODE } else { 5000 };
    let (owned, mut voxels) = brick(&fine, index, 1, &code);
    // The coarser voxel in which (23, 18, 18) lies is 9000; those behind it hold nothing.
    let of_coarse = |at: IVec3| if at.x > 11 { NO_DATA_CODE } else { 9000 };
    let (_, over) = brick(&coarse, BrickIndex([1, 1, 1]), 1, &of_coarse);
    let right = Sides::around(|side| side == [1, 0, 0]);
    let taken =
        |may_lack_data, voxels: &mut BrickVoxels| take_coarser(voxels, (&owned, DIMS), right, &over, may_lack_data);
    let mut without = voxels.clone();
    taken(true, &mut voxels);
    assert_eq!((at(&voxels, hole), at(&voxels, IVec3::new(23, 18, 18))), (NO_DATA_CODE, 9000));
    taken(false, &mut without);
    assert_eq!((at(&without, hole), at(&without, IVec3::new(23, 18, 18))), (6750, 6750), "a code like all others");
}
