//! From the numbers of voxels to the values that they stand for, for formats that have no slope and intercept.

use brickcast_volume::format::{Rescale, SourceHeader, VoxelType};

use crate::number::{number_of, put};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers {
    from: VoxelType,
    to: VoxelType,
    rescale: Rescale,
}

impl Numbers {
    /// Nothing where numbers are values. `values`: the smallest and the largest.
    pub(super) fn of(header: &SourceHeader, values: Option<(f64, f64)>) -> Option<Self> {
        let (from, rescale) = (header.voxel_type, header.rescale);
        if rescale.is_identity() {
            return None;
        }
        let is_whole = |v: f64| v.fract() == 0.0;
        // Numbers are whole, slope and intercept too: so are values.
        let is_integer = !matches!(from, VoxelType::F32 | VoxelType::F64);
        let stays_whole = is_integer && is_whole(rescale.value(0.0)) && is_whole(rescale.value(1.0));
        let no_data = header.no_data.iter().map(|number| rescale.value(*number));
        let bounds = values.map(|(lo, hi)| no_data.fold((lo, hi), |(lo, hi), v| (lo.min(v), hi.max(v))));
        let fits = |(_, lo, hi): &(VoxelType, f64, f64)| bounds.is_some_and(|(min, max)| *lo <= min && max <= *hi);
        let whole = WHOLE.iter().filter(|(to, ..)| to.bytes() >= from.bytes()).find(|to| fits(to));
        let to = match whole.filter(|_| stays_whole) {
            Some((to, ..)) => *to,
            // What 32 bits of a float hold exactly.
            None if from.bytes() <= 2 => VoxelType::F32,
            None => VoxelType::F64,
        };
        Some(Self { from, to, rescale })
    }

    pub(super) fn voxel_type(&self) -> VoxelType {
        self.to
    }

    pub(super) fn note(&self, rescale: Rescale) -> String {
        let (slope, intercept) = (rescale.value(1.0) - rescale.value(0.0), rescale.value(0.0));
        format!("values were written, {slope} times the voxels' numbers plus {intercept}, as {}", self.to)
    }

    /// Bytes of numbers that become at most `most` of values.
    pub(super) fn bytes_for(&self, most: usize) -> usize {
        (most / self.to.bytes()).max(1) * self.from.bytes()
    }

    pub(super) fn convert(&self, numbers: &[u8], values: &mut Vec<u8>) {
        values.reserve(numbers.len() / self.from.bytes() * self.to.bytes());
        for number in numbers.chunks_exact(self.from.bytes()) {
            put(self.to, self.rescale.value(number_of(self.from, number)), values);
        }
    }
}

const WHOLE: [(VoxelType, f64, f64); 6] = [
    (VoxelType::U8, 0.0, 255.0),
    (VoxelType::I8, -128.0, 127.0),
    (VoxelType::I16, -32_768.0, 32_767.0),
    (VoxelType::U16, 0.0, 65_535.0),
    (VoxelType::I32, -2_147_483_648.0, 2_147_483_647.0),
    (VoxelType::U32, 0.0, 4_294_967_295.0),
];

#[cfg(test)]
mod tests {
    use brickcast_volume::space::Geometry;

    use super::*;

    fn numbers(from: VoxelType, rescale: (f64, f64), values: Option<(f64, f64)>, no_data: Vec<f64>) -> Option<Numbers> {
        let geometry = Geometry::new([1; 3], [1.0; 3], [0.0; 3]).unwrap();
        let rescale = Rescale::new(rescale.0, rescale.1).unwrap();
        Numbers::of(&SourceHeader { rescale, no_data, ..SourceHeader::new("test", geometry, from) }, values)
    }

    #[test]
    fn whole_values_become_the_smallest_type_that_has_them() {
        let hounsfield = |values, no_data| numbers(VoxelType::I16, (1.0, -1024.0), values, no_data).unwrap().to;
        assert_eq!(hounsfield(Some((-1024.0, 3071.0)), vec![]), VoxelType::I16);
        assert_eq!(hounsfield(Some((-1024.0, 3071.0)), vec![-32_768.0]), VoxelType::I32);
        assert_eq!(hounsfield(Some((0.0, 40_000.0)), vec![]), VoxelType::U16);
        assert_eq!(hounsfield(None, vec![]), VoxelType::F32);
        assert_eq!(numbers(VoxelType::U8, (0.5, 0.0), Some((0.0, 100.0)), vec![]).unwrap().to, VoxelType::F32);
        assert_eq!(numbers(VoxelType::I32, (0.5, 0.0), Some((0.0, 100.0)), vec![]).unwrap().to, VoxelType::F64);
        assert_eq!(numbers(VoxelType::U8, (1.0, 0.0), None, vec![]), None);
        let mut values = Vec::new();
        let by = numbers(VoxelType::I16, (1.0, -1024.0), Some((-1024.0, 3071.0)), vec![]).unwrap();
        by.convert(&[0i16, 1, 4095].map(i16::to_le_bytes).concat(), &mut values);
        assert_eq!(values, [-1024i16, -1023, 3071].map(i16::to_le_bytes).concat());
    }
}
