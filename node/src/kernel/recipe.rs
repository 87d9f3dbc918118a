//! What of a brick is put into the backend's memory. Bricks of different recipes are different resident bricks.

use brickcast_shaders::BrickTraits;
use brickcast_volume::brick::RANGE_MARGIN;
use brickcast_volume::regions::guard_width;
use brickcast_volume::scene::{Filter, Leap, Scene};

/// The store knows of the one region of a brick as far as its margin reaches: a wider ghost layer may hold others.
pub(crate) const fn knows_only_region(ghost: u32) -> bool {
    ghost <= RANGE_MARGIN
}

/// Everything that the texels of a resident brick depend on, the store apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Recipe {
    /// Regions flattened to their means and coded for leaping with this guard width; none: the voxels as they are.
    pub guard: Option<u8>,
    /// Voxels that gradients look beyond a position's support: 0 or 1. Matters with a guard only.
    pub radius: u8,
    /// Macrocells of this edge, whose value ranges say which are empty.
    pub macrocell: Option<u8>,
    /// Macrocells whose codes span at most this are leapt through; goes with `macrocell`, never with `guard`.
    pub homogeneous: Option<u16>,
    /// Also which voxels are in a region: for region views and region transfer functions.
    pub region_flags: bool,
    /// Each voxel as the span of codes that it may have, if it is flattened; nothing else but flags.
    pub interval: bool,
}

impl Recipe {
    /// Of a brick that is drawn from V' or not, in a scene.
    #[must_use]
    pub fn of(scene: &Scene, flattened: bool, has_regions: bool) -> Self {
        let acceleration = &scene.quality.acceleration;
        let interval = scene.quality.extreme.is_some();
        let radius = scene.look.style.gradient_radius();
        let homogeneous = match acceleration.leap {
            // What a cube is flattened by has no bound on surfaces and gradients, and is no label.
            Leap::Macrocells(range)
                if !interval
                    && scene.look.style.surfaces.is_empty()
                    && radius == 0
                    && scene.quality.filter != Filter::Nearest =>
            {
                Some((f64::from(range) * 65535.0) as u16)
            }
            Leap::Off | Leap::Regions | Leap::Macrocells(_) => None,
        };
        let shows_kinds = scene.look.tells_regions_apart();
        Self {
            // Steps are at most 16 voxels: 33.
            guard: flattened.then(|| guard_width(scene.quality.step, radius) as u8),
            radius: radius as u8,
            macrocell: (acceleration.skip_empty && !interval || homogeneous.is_some())
                .then(|| acceleration.macrocell.voxels() as u8),
            homogeneous,
            region_flags: shows_kinds && has_regions,
            interval,
        }
    }

    /// Are labels and distances needed to make such a brick?
    pub(crate) fn reads_regions(&self) -> bool {
        self.guard.is_some() || self.region_flags
    }

    /// Voxels per edge of the macrocells that such a brick has.
    pub(crate) fn cell_edge(&self) -> Option<u8> {
        self.macrocell.or(self.homogeneous.map(|_| 4))
    }

    /// All that bricks of this recipe can be to a kernel: those without leap voxels do not leap, those with little that
    /// is empty do not skip; where voxels of the store may lack data, some have holes, and these never leap. Next to
    /// other levels there are few: their kernels are compiled once they are met.
    #[must_use]
    pub fn traits(&self, may_lack_data: bool) -> Vec<BrickTraits> {
        let cubes = self.homogeneous.is_some();
        let mut all = Vec::new();
        for holes in [false, true] {
            for leaps in [false, true] {
                for skipping_pays in [false, true] {
                    let lacks = holes && !may_lack_data || leaps && (holes || self.guard.is_none());
                    if !lacks && (!skipping_pays || self.macrocell.is_some()) {
                        let may_skip = self.macrocell.is_some();
                        let cubes = cubes && !holes;
                        all.push(BrickTraits { leaps, holes, may_skip, skipping_pays, cubes, borders: false });
                    }
                }
            }
        }
        all
    }
}
