//! A brick made ready for either backend: its recipe carried out.

use std::borrow::Cow;

use brickcast_shaders::layout::{BrickUniform, CODED_SCALE, RegionFlags};
use brickcast_volume::brick::{GHOST_SAMPLED, OwnedBox};
use brickcast_volume::macrocell::{Macrocells, MapTexel};
use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY, MAX_DISTANCE, code_of_density};
use brickcast_volume::regions::{
    BrickRegions, Density, NO_REGION, RegionTable, RegionTexels, RegionTexelsError, region_texels,
};
use brickcast_volume::store::{BrickVoxels, NO_DATA_CODE};
use glam::IVec3;

use super::bytes::{HOMOGENEOUS_BYTES, reached};
use super::worth::leaps_enough;
use crate::kernel::{BrickInput, RaycastError, check_brick};

/// What goes into the backend's memory.
#[derive(Debug)]
pub(crate) struct BuiltBrick<'a> {
    /// Boxes, scale, cells and flags; rectangle, accumulator, counter and the map's mask are the dispatch's.
    pub(crate) uniform: BrickUniform,
    /// Of the stored box, x fastest; one texel where the brick is all one region.
    pub(crate) texels: Cow<'a, [u16]>,
    /// Codes (0..=1) by slot, where texels hold leaps.
    pub(crate) means: Option<Vec<f32>>,
    pub(crate) cells: Option<BuiltCells>,
    /// 1 for voxels of a region, where that differs from voxel to voxel.
    pub(crate) flags: Option<Vec<u8>>,
}

#[derive(Debug)]
pub(crate) struct BuiltCells {
    pub(crate) cells: Macrocells,
    /// The map's homogeneous bits by cell.
    pub(crate) homogeneous: Option<Vec<u32>>,
}

/// A value of a coded brick may lie this far below and above the codes of its densities: half a density, and rounding.
const CODED_SLACK: (u16, u16) = (1, 3);

impl<'a> BuiltBrick<'a> {
    pub(crate) fn new(owned: &OwnedBox, input: &BrickInput<'a>) -> Result<Self, RaycastError> {
        let BrickInput { voxels, regions, recipe } = *input;
        check_brick(owned, voxels)?;
        let regions = match regions {
            None if recipe.guard.is_some() || recipe.region_flags => return Err(RaycastError::NoRegions(recipe)),
            given => given,
        };
        let mut uniform = BrickUniform::of_boxes(owned, &voxels.stored);
        uniform.holes = u32::from(voxels.has_holes);
        let mut means = None;
        let mut texels = Cow::Borrowed(voxels.codes.as_slice());
        if let (Some(guard), Some((regions, table))) = (recipe.guard, regions) {
            // A guard as wide as distances go leaves no leap voxel: V' as plain texels. Coded ones have no room for
            // voxels without data.
            let worth = !voxels.has_holes && leaps_enough(&voxels.stored, regions, u32::from(guard));
            let guard = if worth { u32::from(guard) } else { u32::from(MAX_DISTANCE) };
            match texels_of_regions(voxels, regions, table, guard, recipe.radius)? {
                RegionTexels::Plain => {}
                RegionTexels::Flat { mut codes } => {
                    if voxels.has_holes {
                        keep_holes(&voxels.codes, &mut codes);
                    }
                    texels = Cow::Owned(codes);
                }
                RegionTexels::Uniform { mean, .. } => return Ok(Self::uniform(owned, mean)),
                RegionTexels::Coded { texels: coded, means: densities, .. } => {
                    texels = Cow::Owned(coded);
                    means = Some(densities.into_iter().map(code_of_mean).collect());
                    uniform.code_scale = CODED_SCALE;
                }
            }
        }
        let flags = match regions.filter(|_| recipe.region_flags) {
            Some((regions, _)) => flags_of(&voxels.stored, regions),
            None => Flags::NoVoxel,
        };
        uniform.region_flags = match flags {
            Flags::NoVoxel => RegionFlags::NoVoxel,
            Flags::EveryVoxel => RegionFlags::EveryVoxel,
            Flags::Some(_) => RegionFlags::Texture,
        } as u32;
        let edge = recipe.cell_edge();
        let reached = reached(owned, &voxels.stored);
        let cells = edge.map(|edge| cells_of(&reached, input, &texels, means.as_deref(), edge)).transpose()?;
        if let Some(cells) = &cells {
            uniform.cell_lo = cells.cells.lo.into();
            uniform.cell_shift = cells.cells.edge.trailing_zeros();
        }
        let flags = if let Flags::Some(flags) = flags { Some(flags) } else { None };
        Ok(Self { uniform, texels, means, cells, flags })
    }

    /// All one region: one leap voxel, as wide as they come, answers for every position.
    pub(crate) fn uniform(owned: &OwnedBox, mean: Density) -> Self {
        let mut uniform = BrickUniform::of_boxes(owned, &owned.stored(GHOST_SAMPLED));
        uniform.stored_dims = [1; 3];
        uniform.code_scale = CODED_SCALE;
        uniform.region_flags = RegionFlags::EveryVoxel as u32;
        let texels = Cow::Owned(vec![CodedTexel::Leap { distance: MAX_DISTANCE, slot: 0 }.pack()]);
        Self { uniform, texels, means: Some(vec![code_of_mean(mean)]), cells: None, flags: None }
    }

    /// Bytes where a texel of the volume takes `texel_bytes`, a cell `cell_bytes` more than its homogeneous bits.
    pub(crate) fn bytes(&self, texel_bytes: u64, cell_bytes: u64) -> u64 {
        let cells = self.cells.as_ref().map_or(0, |c| {
            c.cells.ranges.len() as u64 * (cell_bytes + if c.homogeneous.is_some() { HOMOGENEOUS_BYTES } else { 0 })
        });
        self.texels.len() as u64 * texel_bytes + cells + self.flags.as_ref().map_or(0, |f| f.len() as u64)
    }
}

/// As [`region_texels`], flat where the ghost layer holds more regions than there are slots: then nothing leaps.
fn texels_of_regions(
    voxels: &BrickVoxels,
    regions: &BrickRegions,
    table: &RegionTable,
    guard: u32,
    radius: u8,
) -> Result<RegionTexels, RegionTexelsError> {
    let radius = u32::from(radius);
    match region_texels(voxels, regions, table, guard, radius) {
        Err(RegionTexelsError::Slots { .. }) => region_texels(voxels, regions, table, u32::from(MAX_DISTANCE), radius),
        texels => texels,
    }
}

/// A brick's voxels, those of regions with their regions' means: V' as plain codes. `regions` reach one voxel and
/// `radius` beyond them.
pub(crate) fn flattened(
    voxels: BrickVoxels,
    regions: &BrickRegions,
    table: &RegionTable,
    radius: u8,
) -> Result<BrickVoxels, RaycastError> {
    // A guard as wide as distances go: no voxel leaps.
    let mut codes = match texels_of_regions(&voxels, regions, table, u32::from(MAX_DISTANCE), radius)? {
        RegionTexels::Flat { codes } => codes,
        RegionTexels::Uniform { mean, .. } => vec![code_of_density(mean); voxels.codes.len()],
        RegionTexels::Plain | RegionTexels::Coded { .. } => return Ok(voxels),
    };
    if voxels.has_holes {
        keep_holes(&voxels.codes, &mut codes);
    }
    Ok(BrickVoxels { codes, ..voxels })
}

fn code_of_mean(mean: Density) -> f32 {
    f32::from(mean) / f32::from(MAX_DENSITY)
}

/// In V' the mean of a region may be the code of voxels without data, which are those of the volume and no others.
fn keep_holes(codes: &[u16], flat: &mut [u16]) {
    let data = codes.iter().zip(flat).filter(|(code, _)| **code != NO_DATA_CODE);
    data.for_each(|(_, flat)| *flat = (*flat).max(NO_DATA_CODE + 1));
}

enum Flags {
    NoVoxel,
    EveryVoxel,
    Some(Vec<u8>),
}

fn flags_of(stored: &brickcast_volume::StoredBox, regions: &BrickRegions) -> Flags {
    let covered = regions.covered;
    let dims = covered.dims().as_ivec3();
    let mut flags = Vec::with_capacity(stored.voxel_count() as usize);
    for z in stored.lo.z..stored.hi.z {
        for y in stored.lo.y..stored.hi.y {
            let at = IVec3::new(stored.lo.x, y, z) - covered.lo;
            let row = ((at.z * dims.y + at.y) * dims.x + at.x) as usize;
            let labels = &regions.labels[row..row + stored.dims().x as usize];
            flags.extend(labels.iter().map(|&label| u8::from(label != NO_REGION)));
        }
    }
    match (flags.contains(&0), flags.contains(&1)) {
        (_, false) => Flags::NoVoxel,
        (false, true) => Flags::EveryVoxel,
        (true, true) => Flags::Some(flags),
    }
}

fn cells_of(
    owned: &OwnedBox,
    input: &BrickInput<'_>,
    texels: &[u16],
    means: Option<&[f32]>,
    edge: u8,
) -> Result<BuiltCells, RaycastError> {
    if edge != 4 && edge != 8 {
        return Err(RaycastError::MacrocellEdge(edge));
    }
    let (stored, edge) = (input.voxels.stored, u32::from(edge));
    let cells = match means {
        None => {
            let no_data = input.voxels.has_holes.then_some(NO_DATA_CODE);
            Macrocells::over(owned, &stored, texels, edge, no_data)
        }
        Some(means) => {
            let code_of = |&texel: &u16| match CodedTexel::unpack(texel) {
                CodedTexel::Value { density, .. } => code_of_density(density),
                CodedTexel::Leap { slot, .. } => {
                    let mean = means.get(usize::from(slot)).copied().unwrap_or(0.0);
                    code_of_density((mean * f32::from(MAX_DENSITY)).round() as Density)
                }
            };
            let codes: Vec<u16> = texels.iter().map(code_of).collect();
            Macrocells::of(owned, &stored, &codes, edge).widened(CODED_SLACK.0, CODED_SLACK.1)
        }
    };
    // A cube that holds a voxel without data is not of one value.
    let width = input.recipe.homogeneous.filter(|_| !input.voxels.has_holes);
    let bits = |cube| MapTexel::from(cube).pack();
    let homogeneous = width.map(|width| cells.homogeneous(width).into_iter().map(bits).collect());
    Ok(BuiltCells { cells, homogeneous })
}

#[cfg(test)]
mod tests {
    use brickcast_volume::StoredBox;
    use brickcast_volume::regions::Region;
    use glam::UVec3;

    use super::*;
    use crate::kernel::Recipe;

    /// One hole in a region of the lowest value, whose mean has the code of no data.
    fn hole_in_a_region() -> (OwnedBox, BrickVoxels, BrickRegions, RegionTable, usize) {
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(8) };
        let stored = owned.stored(1);
        let covered = StoredBox { lo: stored.lo - 1, hi: stored.hi + 1 };
        let hole = |of: &StoredBox| {
            let (p, d) = ((IVec3::splat(2) - of.lo).as_uvec3(), of.dims());
            ((p.z * d.y + p.y) * d.x + p.x) as usize
        };
        let (mut codes, at) = (vec![NO_DATA_CODE + 1; stored.voxel_count() as usize], hole(&stored));
        codes[at] = NO_DATA_CODE;
        let mut labels = vec![1; covered.voxel_count() as usize];
        let mut distances = vec![9; labels.len()];
        (labels[hole(&covered)], distances[hole(&covered)]) = (NO_REGION, 0);
        let table = RegionTable(vec![Region { root: 0, voxels: 1, sum: 0, min: 0, max: 0 }]);
        let voxels = BrickVoxels { stored, codes, has_holes: true };
        (owned, voxels, BrickRegions { covered, labels, distances }, table, at)
    }

    #[test]
    fn a_flattened_brick_lacks_the_data_that_its_voxels_lack_and_no_other() {
        let (owned, mut voxels, regions, table, hole) = hole_in_a_region();
        let recipe = Recipe { guard: Some(2), ..Recipe::default() };
        let input = BrickInput { voxels: &voxels, regions: Some((&regions, &table)), recipe };
        let brick = BuiltBrick::new(&owned, &input).unwrap();
        // Coded texels have no room for holes.
        assert!(brick.means.is_none() && brick.uniform.holes == 1);
        let holes: Vec<usize> = (0..brick.texels.len()).filter(|&i| brick.texels[i] == NO_DATA_CODE).collect();
        assert_eq!(holes, [hole]);
        voxels.has_holes = false;
        let input = BrickInput { voxels: &voxels, regions: Some((&regions, &table)), recipe };
        assert!(BuiltBrick::new(&owned, &input).unwrap().means.is_some(), "the same without holes is coded");
    }

    #[test]
    fn macrocells_leave_holes_out_and_do_not_leap_over_them() {
        let (owned, mut voxels, ..) = hole_in_a_region();
        let recipe = Recipe { macrocell: Some(4), homogeneous: Some(9), ..Recipe::default() };
        let cells = |voxels: &BrickVoxels| {
            let input = BrickInput { voxels, regions: None, recipe };
            BuiltBrick::new(&owned, &input).unwrap().cells.unwrap()
        };
        let holed = cells(&voxels);
        assert!(holed.cells.ranges.iter().all(|range| *range == [NO_DATA_CODE + 1; 2]), "{:?}", holed.cells.ranges);
        assert!(holed.homogeneous.is_none());
        voxels.has_holes = false;
        assert!(cells(&voxels).homogeneous.is_some());
    }
}
