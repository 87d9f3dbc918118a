//! The values of a brick where a coarser level is next to it (docs/definition.md, Levels 4).
//!
//! Invariant: on the plane between a fine brick and a coarse one both interpolate the same function along its normal.
//! The coarse one interpolates between its voxels on both sides of the plane; so the fine one has, in its outermost
//! voxels and in those beyond, what that function is there. Which voxels these are follows from the places of levels
//! around, and their values from the coarse level alone, so bricks that share a voxel agree on it.

use glam::{IVec3, UVec3};

use super::borders::Sides;
use crate::brick::{BrickVoxels, OwnedBox};
use crate::store::NO_DATA_CODE;

/// Gives those voxels of a brick that touch `coarser` places, by a face, an edge or a corner, the next coarser level's
/// values, interpolated. The brick owns `owned` in a volume of `dims` voxels; `coarse` is the brick of the next coarser
/// level in which it lies, with as many ghost layers. Where `may_lack_data`, voxels without data stay so, and count for
/// nothing.
pub fn take_coarser(
    voxels: &mut BrickVoxels,
    (owned, dims): (&OwnedBox, UVec3),
    coarser: Sides,
    coarse: &BrickVoxels,
    may_lack_data: bool,
) {
    if coarser.is_empty() {
        return;
    }
    let stored = voxels.stored;
    let axes = [0, 1, 2].map(|axis| {
        let (own, last) = (owned.lo[axis] as i32..owned.hi[axis] as i32, dims[axis] as i32 - 1);
        let at = |v: i32| Place::new(v.clamp(0, last), &own);
        (stored.lo[axis]..stored.hi[axis]).map(at).collect::<Vec<_>>()
    });
    let touches = Touches::new(coarser);
    let (box_dims, no_data) = (coarse.stored.dims().as_ivec3(), may_lack_data.then_some(NO_DATA_CODE));
    let coarse_at = |at: IVec3| {
        let is_there = at.cmpge(coarse.stored.lo).all() && at.cmplt(coarse.stored.hi).all();
        let at = at - coarse.stored.lo;
        is_there.then(|| coarse.codes[((at.z * box_dims.y + at.y) * box_dims.x + at.x) as usize])
    };
    let mut codes = voxels.codes.iter_mut();
    for z in &axes[2] {
        for y in &axes[1] {
            for (x, code) in axes[0].iter().zip(&mut codes) {
                if touches.any(x, y, z) && Some(*code) != no_data {
                    let known = Place::corners([x, y, z]).filter_map(|(at, weight)| Some((coarse_at(at)?, weight)));
                    *code = mean(known.filter(|(code, _)| Some(*code) != no_data)).unwrap_or(*code);
                }
            }
        }
    }
}

/// Rounded half up; nothing of nothing.
fn mean(codes: impl Iterator<Item = (u16, u32)>) -> Option<u16> {
    let (sum, weights) = codes.fold((0, 0), |(sum, weights), (code, weight)| {
        let code = u32::from(code);
        (sum + code * weight, weights + weight)
    });
    (weights > 0).then(|| ((sum + weights / 2) / weights) as u16)
}

/// A voxel's place on one axis.
struct Place {
    /// On which sides of the brick, from before it to behind it, the voxel or one next to it is: bits 0 to 2.
    sides: u32,
    /// The coarser voxel in which it lies, and that which is next to it on its side. A fine voxel's middle is a quarter
    /// of a coarse voxel from the middle of the one in which it lies.
    near: i32,
    far: i32,
}

impl Place {
    fn new(at: i32, own: &std::ops::Range<i32>) -> Self {
        let side = |v: i32| {
            if v < own.start {
                1
            } else if v < own.end {
                2
            } else {
                4
            }
        };
        let near = at >> 1;
        Self { sides: side(at - 1) | side(at) | side(at + 1), near, far: if at & 1 == 1 { near + 1 } else { near - 1 } }
    }

    /// The eight coarser voxels around, and their weights in 64ths.
    fn corners(axes: [&Self; 3]) -> impl Iterator<Item = (IVec3, u32)> {
        (0..8_u32).map(move |corner| {
            let is_far = [0, 1, 2].map(|axis| corner >> axis & 1 == 1);
            let at = [0, 1, 2].map(|axis| if is_far[axis] { axes[axis].far } else { axes[axis].near });
            (at.into(), is_far.map(|far| if far { 1 } else { 3 }).iter().product())
        })
    }
}

/// Whether a voxel touches any of some places, by its sides on each axis.
struct Touches(Vec<bool>);

impl Touches {
    fn new(places: Sides) -> Self {
        let of = |sides: u32, axis: u32| {
            let sides = sides >> (3 * axis);
            (-1..2).filter(move |side| sides >> (side + 1) & 1 == 1)
        };
        let any =
            |sides: u32| of(sides, 2).any(|z| of(sides, 1).any(|y| of(sides, 0).any(|x| places.is_at([x, y, z]))));
        Self((0..512).map(any).collect())
    }

    fn any(&self, x: &Place, y: &Place, z: &Place) -> bool {
        self.0[(x.sides | y.sides << 3 | z.sides << 6) as usize]
    }
}

#[cfg(test)]
mod tests;
