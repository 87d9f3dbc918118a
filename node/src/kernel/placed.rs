//! A resident brick in a scene: where its rays run, and which kernel takes them. Both backends ask here.

use brickcast_shaders::layout::BrickUniform;
use brickcast_shaders::{BrickTraits, KernelKey};
use brickcast_volume::OwnedBox;
use brickcast_volume::lod::Sides;

use super::occupied::Occupied;
use super::scene::KernelScene;

/// What a brick needs in a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    /// Its owned box is the part of the brick that may show something, or all of it where other levels are next to it.
    pub(crate) uniform: BrickUniform,
    /// That part, whatever is next to it: rays that do not meet it take nothing.
    pub(crate) shown: OwnedBox,
    pub(crate) key: KernelKey,
}

impl Placed {
    /// `uniform`, `leaps`, `cubes` and `sides` are the brick's; `occupied` where it has macrocells and the scene skips.
    pub(crate) fn new(
        scene: &KernelScene,
        uniform: &BrickUniform,
        (leaps, cubes): (bool, bool),
        occupied: Option<Occupied>,
        sides: Sides,
    ) -> Self {
        let mut uniform = BrickUniform { borders: sides.bits(), ..*uniform };
        let borders = !sides.is_empty();
        let mut traits = BrickTraits { leaps, holes: uniform.holes != 0, cubes, borders, ..BrickTraits::default() };
        let mut shown = uniform.owned();
        if let Some(occupied) = occupied {
            let (bounds, pays) = scene.bounds(occupied, &shown);
            // What of a brick meets other levels is told by all of it: the map says where there is something to see.
            let is_cut = !borders || bounds.voxel_count() == 0;
            (traits.may_skip, traits.skipping_pays) = (true, if is_cut { pays } else { occupied.skips_uncut });
            if is_cut {
                uniform = uniform.within(&bounds);
            }
            shown = bounds;
        }
        Self { uniform, shown, key: KernelKey::of(scene.look(), traits) }
    }
}
