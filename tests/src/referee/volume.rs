//! Values in space.

use glam::{DMat3, DVec3};

/// Values on a grid, x fastest, in data units; NaN where there is no data. Index space: voxel i covers `[i, i + 1)`,
/// its centre is `i + 0.5`.
#[derive(Debug, Clone)]
pub struct Volume {
    pub dims: [usize; 3],
    /// World units per voxel.
    pub spacing: DVec3,
    /// World position of the centre of voxel (0, 0, 0).
    pub origin: DVec3,
    /// The grid's axes in the world, one a column; of length one and at right angles.
    pub directions: DMat3,
    pub values: Vec<f64>,
}

impl Volume {
    /// The same value everywhere.
    #[must_use]
    pub fn filled(dims: [usize; 3], spacing: [f64; 3], origin: [f64; 3], value: f64) -> Self {
        let values = vec![value; dims.iter().product()];
        Self { dims, spacing: spacing.into(), origin: origin.into(), directions: DMat3::IDENTITY, values }
    }

    #[must_use]
    pub fn min_spacing(&self) -> f64 {
        self.spacing.x.min(self.spacing.y).min(self.spacing.z)
    }

    #[must_use]
    pub fn index_from_world(&self, world: DVec3) -> DVec3 {
        self.parts_along_axes(world - self.origin) / self.spacing + 0.5
    }

    /// How far a world vector goes along each of the grid's axes, world units.
    #[must_use]
    pub fn parts_along_axes(&self, v: DVec3) -> DVec3 {
        let axes = self.directions;
        DVec3::new(v.dot(axes.x_axis), v.dot(axes.y_axis), v.dot(axes.z_axis))
    }

    #[must_use]
    pub fn world_from_index(&self, index: DVec3) -> DVec3 {
        let along = (index - 0.5) * self.spacing;
        let axes = self.directions;
        axes.x_axis * along.x + axes.y_axis * along.y + axes.z_axis * along.z + self.origin
    }

    /// The low and the high corner of the volume's box, low and high along the grid's axes.
    #[must_use]
    pub fn world_box(&self) -> (DVec3, DVec3) {
        let high = DVec3::new(self.dims[0] as f64, self.dims[1] as f64, self.dims[2] as f64);
        (self.world_from_index(DVec3::ZERO), self.world_from_index(high))
    }

    /// The value at a position in index space: trilinear between the eight nearest centres, clamped to the edge beyond
    /// the outermost ones. NaN where a voxel without data has weight.
    #[must_use]
    pub fn sample(&self, index: DVec3) -> f64 {
        self.sample_within(index, [0; 3], self.dims, Self::offset)
    }

    /// The value of the voxel that holds a position in index space, clamped to the edge.
    #[must_use]
    pub fn nearest(&self, index: DVec3) -> f64 {
        let voxel = |axis: usize| index[axis].floor().clamp(0.0, (self.dims[axis] - 1) as f64) as usize;
        self.values[self.offset([voxel(0), voxel(1), voxel(2)])]
    }

    /// As [`Self::sample`], from the voxels in `[low, high)` only, fetched with `offset`: what a sabotaged reader sees.
    pub(super) fn sample_within(
        &self,
        index: DVec3,
        low: [usize; 3],
        high: [usize; 3],
        offset: fn(&Self, [usize; 3]) -> usize,
    ) -> f64 {
        let mut pairs = [(0, 0, 0.0); 3];
        for axis in 0..3 {
            let centred = index[axis] - 0.5;
            let floor = centred.floor();
            let clamped = |i: f64| i.clamp(low[axis] as f64, (high[axis] - 1) as f64) as usize;
            pairs[axis] = (clamped(floor), clamped(floor + 1.0), centred - floor);
        }
        let [(x0, x1, u), (y0, y1, v), (z0, z1, w)] = pairs;
        let mut sum = 0.0;
        for (x, wx) in [(x0, 1.0 - u), (x1, u)] {
            for (y, wy) in [(y0, 1.0 - v), (y1, v)] {
                for (z, wz) in [(z0, 1.0 - w), (z1, w)] {
                    // Nothing times no data is no data.
                    if wx * wy * wz > 0.0 {
                        sum += wx * wy * wz * self.values[offset(self, [x, y, z])];
                    }
                }
            }
        }
        sum
    }

    /// True where f32 cannot tell whether a voxel without data has weight at a position.
    pub(super) fn is_doubtful(&self, index: DVec3) -> bool {
        const SLACK: f64 = 2e-5;
        let near = |a: usize| (index[a] - 0.5 - (index[a] - 0.5).round()).abs() < SLACK;
        let differs = |a: usize| {
            let by = |d: f64| {
                let mut at = index;
                at[a] += d;
                self.sample(at).is_nan()
            };
            by(-SLACK) != by(SLACK)
        };
        (0..3).any(|a| near(a) && differs(a))
    }

    /// Where a voxel stands in `values`.
    #[must_use]
    pub fn offset(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Where a reader that takes z for the fastest axis would look for it.
    pub(super) fn offset_z_fastest(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.dims[1] + y) * self.dims[2] + z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two voxels along each axis, value = 1 x + 10 y + 100 z at the centres.
    fn cube() -> Volume {
        let mut volume = Volume::filled([2, 2, 2], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0], 0.0);
        volume.values = vec![0.0, 1.0, 10.0, 11.0, 100.0, 101.0, 110.0, 111.0];
        volume
    }

    #[test]
    fn values_are_exact_at_centres_linear_between_and_clamped_beyond() {
        let volume = cube();
        assert_eq!(volume.sample(DVec3::new(0.5, 0.5, 0.5)), 0.0);
        assert_eq!(volume.sample(DVec3::new(1.5, 0.5, 1.5)), 101.0);
        assert_eq!(volume.sample(DVec3::new(1.0, 0.75, 0.5)), 0.5 + 2.5);
        assert_eq!(volume.sample(DVec3::new(0.1, 0.0, 0.3)), 0.0);
        assert_eq!(volume.sample(DVec3::new(2.0, 1.9, 9.0)), 111.0);
    }

    #[test]
    fn a_hole_has_weight_up_to_its_neighbours_centres() {
        let mut volume = cube();
        volume.values[1] = f64::NAN;
        assert_eq!(volume.sample(DVec3::new(0.5, 0.75, 0.5)), 2.5);
        assert!(volume.sample(DVec3::new(0.500_001, 0.75, 0.5)).is_nan());
        assert!(volume.sample(DVec3::new(1.5, 0.5, 0.5)).is_nan());
        assert_eq!(volume.sample(DVec3::new(1.0, 1.5, 0.5)), 10.5);
        assert!(volume.is_doubtful(DVec3::new(0.500_001, 0.75, 0.5)));
        assert!(!volume.is_doubtful(DVec3::new(0.51, 0.75, 0.5)) && !volume.is_doubtful(DVec3::new(1.0, 1.0, 1.0)));
    }

    #[test]
    fn origin_is_the_first_centre_and_the_box_begins_half_a_voxel_before() {
        let volume = cube();
        assert_eq!(volume.index_from_world(volume.origin), DVec3::splat(0.5));
        assert_eq!(volume.world_box(), (DVec3::new(9.5, 19.0, 28.5), DVec3::new(11.5, 23.0, 34.5)));
    }
}
