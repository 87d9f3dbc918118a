//! Fill values that an input declares.

use crate::format::VoxelType;
use crate::store::no_data::MAX_FILL;
use crate::store::voxel::StoredType;

/// Fill values as the voxels of a source hold them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fill {
    /// As declared.
    declared: Vec<f64>,
    values: Vec<f64>,
}

impl Fill {
    pub(crate) fn new(voxel_type: VoxelType, declared: &[f64]) -> Self {
        let declared: Vec<f64> = declared.iter().copied().filter(|v| !v.is_nan()).take(MAX_FILL).collect();
        // A header says -9999.9, the voxel holds the nearest f32.
        let held = |v: &f64| if voxel_type == VoxelType::F32 { f64::from(*v as f32) } else { *v };
        let values = declared.iter().map(held).collect();
        Self { declared, values }
    }

    pub(crate) fn declared(&self) -> &[f64] {
        &self.declared
    }

    /// Does a voxel of this value hold no data?
    #[inline(always)]
    pub(crate) fn is_no_data(&self, value: f64) -> bool {
        value.is_nan() || self.values.contains(&value)
    }

    /// The ordinals of the fill values that a source of `stored_type` can hold, where it is stored as it is.
    pub(crate) fn ordinals(&self, stored_type: StoredType) -> Vec<u16> {
        let ordinal = |v: &f64| {
            let ordinal = v - f64::from(stored_type.min());
            let is_one = ordinal.fract() == 0.0 && (0.0..stored_type.values() as f64).contains(&ordinal);
            is_one.then_some(ordinal as u16)
        };
        self.values.iter().filter_map(ordinal).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fill_values_are_met_as_the_voxels_hold_them() {
        let fill = Fill::new(VoxelType::F32, &[-9999.9, f64::NAN]);
        assert!(fill.is_no_data(f64::from(-9999.9f32)) && fill.is_no_data(f64::NAN) && !fill.is_no_data(-9999.0));
        assert_eq!(fill.declared(), [-9999.9]);
        let fill = Fill::new(VoxelType::I16, &[-32768.0, 0.5, 40_000.0, 7.0]);
        assert_eq!(fill.ordinals(StoredType::I16), [0, 32_775]);
        assert_eq!(fill.ordinals(StoredType::U8), [7]);
    }
}
