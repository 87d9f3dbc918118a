//! A resident brick in a scene: where its rays run, and which kernel takes them. Both backends ask here.

use brickcast_shaders::layout::BrickUniform;
use brickcast_shaders::{BrickTraits, KernelKey};

use super::occupied::Occupied;
use super::scene::KernelScene;

/// What a brick needs in a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    /// Its owned box is the part of the brick that may show something.
    pub(crate) uniform: BrickUniform,
    pub(crate) key: KernelKey,
}

impl Placed {
    /// `uniform`, `leaps` and `cubes` are the brick's; `occupied` where it has macrocells and the scene skips.
    pub(crate) fn new(
        scene: &KernelScene,
        uniform: &BrickUniform,
        (leaps, cubes): (bool, bool),
        occupied: Option<Occupied>,
    ) -> Self {
        let mut uniform = *uniform;
        let mut traits = BrickTraits { leaps, holes: uniform.holes != 0, cubes, ..BrickTraits::default() };
        if let Some(occupied) = occupied {
            let (bounds, pays) = scene.bounds(occupied, &uniform.owned());
            (traits.may_skip, traits.skipping_pays) = (true, pays);
            uniform = uniform.within(&bounds);
        }
        Self { uniform, key: KernelKey::of(scene.look(), traits) }
    }
}
