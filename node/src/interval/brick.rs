//! A brick whose voxels are spans of codes.

use std::any::Any;

use brickcast_shaders::layout::{BrickUniform, PLAIN_SCALE};
use brickcast_shaders::twin::bindings::BrickData;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::regions::code::MAX_DISTANCE;
use brickcast_volume::regions::{Region, code_spans, codes_of_region};

use crate::brick::texels::BuiltBrick;
use crate::kernel::{BrickInput, RaycastError, Recipe, ResidentBrick};

/// In the node's memory, whatever its backend.
#[derive(Debug)]
pub(crate) struct IntervalBrick {
    pub(super) uniform: BrickUniform,
    /// The voxels' codes, or the lower ends of what they may be.
    low: Vec<u16>,
    /// Where the brick is flattened.
    flattened: Option<Flattened>,
    flags: Vec<u8>,
}

#[derive(Debug)]
pub(super) struct Flattened {
    pub(super) high: Vec<u16>,
    pub(super) distances: Vec<u8>,
}

impl ResidentBrick for IntervalBrick {
    fn bytes(&self) -> u64 {
        let flattened = self.flattened.as_ref().map_or(0, |f| f.high.len() * size_of::<u16>() + f.distances.len());
        (self.low.len() * size_of::<u16>() + flattened + self.flags.len()) as u64
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl IntervalBrick {
    /// # Errors
    /// Input that does not fit the recipe or itself.
    pub(crate) fn new(owned: OwnedBox, input: &BrickInput<'_>) -> Result<Self, RaycastError> {
        let BrickInput { voxels, regions, recipe } = *input;
        // The voxels as they are, checked, with their flags.
        let plain = Recipe { region_flags: recipe.region_flags, ..Recipe::default() };
        let built = BuiltBrick::new(&owned, &BrickInput { recipe: plain, ..*input })?;
        let (uniform, flags) = (built.uniform, built.flags.unwrap_or_default());
        if recipe.guard.is_none() {
            return Ok(Self { uniform, low: built.texels.into_owned(), flattened: None, flags });
        }
        let (regions, table) = regions.ok_or(RaycastError::NoRegions(recipe))?;
        let spans = code_spans(voxels, regions, table)?;
        let flattened = Some(Flattened { high: spans.high, distances: spans.distances });
        Ok(Self { uniform, low: spans.low, flattened, flags })
    }

    /// All of it is one region: one voxel answers for every position.
    pub(crate) fn uniform(owned: &OwnedBox, region: &Region) -> Self {
        let uniform = BuiltBrick::uniform(owned, region.mean()).uniform;
        let uniform = BrickUniform { code_scale: PLAIN_SCALE, ..uniform };
        let [low, high] = codes_of_region(region);
        let flattened = Some(Flattened { high: vec![high], distances: vec![MAX_DISTANCE] });
        Self { uniform, low: vec![low], flattened, flags: Vec::new() }
    }

    pub(super) fn flattened(&self) -> Option<&Flattened> {
        self.flattened.as_ref()
    }

    pub(super) fn data(&self) -> BrickData<'_> {
        BrickData { texels: &self.low, means: None, map: None, flags: &self.flags }
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::StoredBox;
    use brickcast_volume::regions::{BrickRegions, RegionTable};
    use brickcast_volume::store::BrickVoxels;
    use glam::UVec3;

    use super::*;
    use crate::brick::bytes::interval_bytes;

    #[test]
    fn bricks_are_as_large_as_they_are_expected_to_be() {
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(4) };
        let stored = owned.stored(1);
        let covered = StoredBox { lo: stored.lo - 1, hi: stored.hi + 1 };
        let voxels = BrickVoxels { stored, codes: vec![7; stored.voxel_count() as usize], has_holes: false };
        let count = covered.voxel_count() as usize;
        let mut labels = vec![1; count];
        // Well within the stored box, six voxels wide.
        labels[(4 * 8 + 4) * 8 + 4] = 0;
        let regions = BrickRegions { covered, labels, distances: vec![1; count] };
        let table = RegionTable(vec![Region { root: 0, voxels: 9, sum: 18, min: 1, max: 3 }]);
        for (guard, region_flags) in [(None, false), (Some(4), false), (None, true), (Some(4), true)] {
            let recipe = Recipe { guard, region_flags, interval: true, ..Recipe::default() };
            let input = BrickInput { voxels: &voxels, regions: Some((&regions, &table)), recipe };
            let brick = IntervalBrick::new(owned, &input).unwrap();
            assert_eq!(brick.bytes(), interval_bytes(stored.voxel_count(), recipe), "{recipe:?}");
            assert_eq!(brick.flattened().is_some(), guard.is_some());
        }
        let bare = Recipe { guard: Some(4), interval: true, ..Recipe::default() };
        let input = BrickInput { voxels: &voxels, regions: None, recipe: bare };
        assert!(matches!(IntervalBrick::new(owned, &input), Err(RaycastError::NoRegions(_))));
    }
}
