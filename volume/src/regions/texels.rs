//! From labels and distances to what a brick's texture holds, for one guard width.

use glam::UVec3;

use super::code::{CodedTexel, Density, MAX_SLOTS, code_of_density, density_of_code};
use super::table::{BrickRegions, NO_REGION, RegionTable};
use crate::brick::{BrickVoxels, StoredBox};

/// A brick of V', as it is drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RegionTexels {
    /// No voxel of the stored box is in a region: the voxels' own 16-bit codes serve.
    Plain,
    /// Region voxels, but none to leap from: V' in 16-bit codes.
    Flat { codes: Vec<u16> },
    /// Leaps and densities (`regions/code.rs`).
    Coded {
        texels: Vec<u16>,
        /// V' of each slot's region.
        means: Vec<Density>,
        /// The region of each slot.
        labels: Vec<u32>,
    },
    /// The whole stored box is one region: its mean says everything.
    Uniform { label: u32, mean: Density },
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RegionTexelsError {
    #[error("{got} codes, {labels} labels and {distances} distances for boxes of {voxels} and {covered} voxels")]
    Counts { got: usize, labels: usize, distances: usize, voxels: u64, covered: u64 },
    #[error(
        "labels cover {covered:?}, which must reach {margin} voxels beyond the stored box {stored:?} on every side"
    )]
    Margin { covered: StoredBox, stored: StoredBox, margin: u32 },
    #[error("a voxel has the label {label}, but there are {regions} regions; prepare the store again")]
    Label { label: u32, regions: usize },
    #[error(
        "more than {MAX_SLOTS} regions with leap voxels in one brick of {dims:?} voxels; prepare the store with \
         smaller bricks or a larger smallest region"
    )]
    Slots { dims: [u32; 3] },
}

/// The texels of a stored box for rays whose step needs `guard` (see [`super::guard_width`]);
/// `gradient_radius` is 0 for density alone. `regions` covers the stored box and at least `1 + gradient_radius` voxels
/// more.
///
/// # Errors
/// Boxes and voxels that do not fit each other, labels that the table lacks, too many regions for the slots.
pub fn region_texels(
    voxels: &BrickVoxels,
    regions: &BrickRegions,
    table: &RegionTable,
    guard: u32,
    gradient_radius: u32,
) -> Result<RegionTexels, RegionTexelsError> {
    let (stored, covered) = (voxels.stored, regions.covered);
    let margin = 1 + gradient_radius;
    let reach = glam::IVec3::splat(margin as i32);
    if covered.lo.cmpgt(stored.lo - reach).any() || covered.hi.cmplt(stored.hi + reach).any() {
        return Err(RegionTexelsError::Margin { covered, stored, margin });
    }
    let (got, labels, distances) = (voxels.codes.len(), regions.labels.len(), regions.distances.len());
    let (count, all) = (stored.voxel_count(), covered.voxel_count());
    if got as u64 != count || labels as u64 != all || distances as u64 != all {
        return Err(RegionTexelsError::Counts { got, labels, distances, voxels: count, covered: all });
    }
    let inside = Inside::new(&stored, &covered);
    let first = inside.rows().next().map_or(NO_REGION, |row| regions.labels[row.start]);
    let mut is_uniform = first != NO_REGION;
    let (mut has_regions, mut has_leaps) = (false, false);
    for row in inside.rows() {
        for (&label, &distance) in regions.labels[row.clone()].iter().zip(&regions.distances[row]) {
            is_uniform &= label == first;
            has_regions |= label != NO_REGION;
            has_leaps |= label != NO_REGION && u32::from(distance) > guard;
        }
    }
    let mean = |label: u32| {
        let region = table.get(label).ok_or(RegionTexelsError::Label { label, regions: table.0.len() })?;
        Ok(region.mean())
    };
    if !has_regions {
        return Ok(RegionTexels::Plain);
    }
    if is_uniform {
        return Ok(RegionTexels::Uniform { label: first, mean: mean(first)? });
    }
    // The means of the last label seen: neighbours mostly share one.
    let mut last = (NO_REGION, 0);
    let mut mean_of = |label: u32| {
        if label != last.0 {
            last = (label, mean(label)?);
        }
        Ok(last.1)
    };
    let mut codes = voxels.codes.iter();
    if !has_leaps {
        let mut flat = Vec::with_capacity(got);
        for row in inside.rows() {
            for (&label, &code) in regions.labels[row].iter().zip(&mut codes) {
                flat.push(if label == NO_REGION { code } else { code_of_density(mean_of(label)?) });
            }
        }
        return Ok(RegionTexels::Flat { codes: flat });
    }
    let near_leap = near_leaps(regions, guard, margin);
    let mut slots = Slots::default();
    let mut texels = Vec::with_capacity(got);
    for row in inside.rows() {
        for (at, &code) in row.zip(&mut codes) {
            let (label, distance) = (regions.labels[at], regions.distances[at]);
            let texel = if label == NO_REGION {
                CodedTexel::Value { density: density_of_code(code), inner: false }
            } else if u32::from(distance) > guard {
                let slot = slots.of(label).ok_or(RegionTexelsError::Slots { dims: stored.dims().into() })?;
                CodedTexel::Leap { distance, slot }
            } else {
                CodedTexel::Value { density: mean_of(label)?, inner: near_leap[at] }
            };
            texels.push(texel.pack());
        }
    }
    let labels = slots.labels;
    let means = labels.iter().map(|&label| mean(label)).collect::<Result<_, _>>()?;
    Ok(RegionTexels::Coded { texels, means, labels })
}

/// Slots in the order of their first leap voxel.
#[derive(Default)]
struct Slots {
    labels: Vec<u32>,
    last: usize,
}

impl Slots {
    /// `None` where all are taken.
    fn of(&mut self, label: u32) -> Option<u8> {
        if self.labels.get(self.last) != Some(&label) {
            self.last = self.labels.iter().position(|&known| known == label).unwrap_or(self.labels.len());
            if self.last == MAX_SLOTS {
                return None;
            }
            if self.last == self.labels.len() {
                self.labels.push(label);
            }
        }
        Some(self.last as u8)
    }
}

/// The stored box inside the covered one.
struct Inside {
    /// Offset of the stored box.
    from: UVec3,
    dims: UVec3,
    covered: UVec3,
}

impl Inside {
    fn new(stored: &StoredBox, covered: &StoredBox) -> Self {
        Self { from: (stored.lo - covered.lo).as_uvec3(), dims: stored.dims(), covered: covered.dims() }
    }

    /// Indices in the covered box, a row of the stored one at a time.
    fn rows(&self) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let Self { from, dims, covered } = *self;
        (0..dims.z as usize).flat_map(move |z| {
            (0..dims.y as usize).map(move |y| {
                let row = (z + from.z as usize) * covered.y as usize + y + from.y as usize;
                let start = row * covered.x as usize + from.x as usize;
                start..start + dims.x as usize
            })
        })
    }
}

/// True where a leap voxel lies within Chebyshev distance `reach`; over the covered box.
fn near_leaps(regions: &BrickRegions, guard: u32, reach: u32) -> Vec<bool> {
    let dims = {
        let d = regions.covered.dims();
        [d.x as usize, d.y as usize, d.z as usize]
    };
    let mut near: Vec<bool> = regions.distances.iter().map(|&d| u32::from(d) > guard).collect();
    for (stride, count) in [(1, dims[0]), (dims[0], dims[1]), (dims[0] * dims[1], dims[2])] {
        for _ in 0..reach {
            let before = near.clone();
            for (i, near) in near.iter_mut().enumerate() {
                let at = i / stride % count;
                *near |= (at > 0 && before[i - stride]) || (at + 1 < count && before[i + stride]);
            }
        }
    }
    near
}
