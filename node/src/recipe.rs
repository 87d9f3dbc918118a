//! What of a brick is put into the backend's memory. Bricks of different recipes are different resident bricks.

use crate::raycaster::Features;

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
}

impl Recipe {
    /// What of the kernel such a brick takes; some bricks take less (those without leap voxels).
    #[must_use]
    pub fn features(&self) -> Features {
        Features {
            leap: self.guard.is_some(),
            map: self.macrocell.is_some(),
            regions: self.region_flags,
            // What a store lacks is no recipe's business.
            holes: false,
            integral: None,
        }
    }

    /// The same of bricks with and without holes, where voxels of the store may lack data; bricks with holes never leap.
    #[must_use]
    pub fn all_features(&self, may_lack_data: bool) -> Vec<Features> {
        let whole = self.features();
        let holed = may_lack_data.then_some(Features { holes: true, leap: false, ..whole });
        std::iter::once(whole).chain(holed).collect()
    }
}
