//! What planning must know of each brick in V', gathered slab by slab.

use std::ops::Range;

use rayon::prelude::*;

use crate::brick::BrickGrid;
use crate::regions::block::LEAP_DISTANCE;
use crate::regions::code::{MAX_SLOTS, code_of_density, density_of_code};
use crate::regions::{BrickFacts, NO_REGION, RegionTable};
use crate::store::brick_ranges::grown;
use crate::store::no_data::NO_DATA_CODE;

/// Bricks below this size cannot have too many regions: leap voxels of two regions are at least five apart, so a stored
/// box of 16 + 2 * 2 voxels holds those of 4^3 regions at most.
const SMALLEST_CROWDED_BRICK: u32 = 32;

#[derive(Debug, Clone, Default)]
struct Gathered {
    met: bool,
    /// Smallest and largest own code.
    raw: [u16; 2],
    /// Smallest and largest code of V', and the largest deviation from it.
    flat: [u16; 2],
    deviation: u16,
    has_leaps: bool,
    has_regions: bool,
    only_region: u32,
    /// Regions with leap voxels, ascending; not gathered for bricks that are too small to be crowded.
    leaping: Vec<u32>,
}

impl Gathered {
    fn meet(&mut self, label: u32, raw: [u16; 2], flat: [u16; 2], deviation: u16) {
        if self.met {
            self.raw = [self.raw[0].min(raw[0]), self.raw[1].max(raw[1])];
            self.flat = [self.flat[0].min(flat[0]), self.flat[1].max(flat[1])];
            if self.only_region != label {
                self.only_region = NO_REGION;
            }
        } else {
            (self.met, self.raw, self.flat, self.only_region) = (true, raw, flat, label);
        }
        self.deviation = self.deviation.max(deviation);
        self.has_regions |= label != NO_REGION;
    }

    fn facts(&self) -> BrickFacts {
        let [min, max] = if self.has_regions { self.flat } else { self.raw };
        BrickFacts {
            min,
            max,
            deviation: if self.has_regions { self.deviation } else { 0 },
            has_regions: self.has_regions,
            has_leaps: self.has_leaps,
            only_region: self.only_region,
        }
    }
}

/// Planes of everything that is known of their voxels, x fastest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FinalSlab<'a> {
    pub(crate) z0: u32,
    pub(crate) codes: &'a [u16],
    pub(crate) labels: &'a [u32],
    /// 0 where there is no region.
    pub(crate) distances: &'a [u8],
}

#[derive(Debug)]
pub(crate) struct FactsBuilder {
    grid: BrickGrid,
    /// Code in V' of each label's voxels.
    means: Vec<u16>,
    /// Code in V' of every code outside regions, and the largest deviation from it.
    requantised: Vec<u16>,
    deviates: u16,
    bricks: Vec<Gathered>,
    /// Voxels of [`NO_DATA_CODE`] hold no data: they have no code in V' either.
    has_holes: bool,
}

impl FactsBuilder {
    pub(crate) fn new(grid: BrickGrid, regions: &RegionTable, has_holes: bool) -> Self {
        let means = std::iter::once(0).chain(regions.0.iter().map(|r| code_of_density(r.mean()))).collect();
        let requantised: Vec<_> = (0..=u16::MAX).map(|code| code_of_density(density_of_code(code))).collect();
        let deviates = (0..=u16::MAX).zip(&requantised).map(|(code, to)| to.abs_diff(code)).max().unwrap_or(0);
        let bricks = vec![Gathered::default(); grid.brick_count() as usize];
        Self { grid, means, requantised, deviates, bricks, has_holes }
    }

    /// Takes whole planes, in any pieces; those on a margin count for both bricks that they touch.
    pub(crate) fn add(&mut self, slab: &FinalSlab<'_>) {
        let (n, bricks, size) = (self.grid.volume_dims(), self.grid.dims(), self.grid.brick_size());
        let (nx, ny) = (n.x as usize, n.y as usize);
        let z1 = slab.z0 + (slab.codes.len() / (nx * ny)) as u32;
        let x_boxes: Vec<Range<usize>> =
            (0..bricks.x).map(|bx| grown(bx, size, n.x)).map(|r| r.start as usize..r.end as usize).collect();
        let layer = (bricks.x * bricks.y) as usize;
        let tables = Tables {
            means: &self.means,
            requantised: &self.requantised,
            deviates: self.deviates,
            may_be_crowded: size >= SMALLEST_CROWDED_BRICK,
            has_holes: self.has_holes,
        };
        for bz in 0..bricks.z {
            let zs = grown(bz, size, n.z);
            let zs = zs.start.max(slab.z0)..zs.end.min(z1);
            if zs.is_empty() {
                continue;
            }
            let rows = &mut self.bricks[bz as usize * layer..][..layer];
            rows.par_chunks_mut(bricks.x as usize).enumerate().for_each(|(by, row)| {
                for z in zs.clone() {
                    for y in grown(by as u32, size, n.y) {
                        let start = ((z - slab.z0) as usize * ny + y as usize) * nx;
                        for (brick, xs) in row.iter_mut().zip(&x_boxes) {
                            let voxels = start + xs.start..start + xs.end;
                            take_row(brick, slab, voxels, &tables);
                        }
                    }
                }
            });
        }
    }

    pub(crate) fn facts(&self) -> Vec<BrickFacts> {
        self.bricks.iter().map(Gathered::facts).collect()
    }

    /// The smallest number of voxels that regions must have for every brick to have slots for all of its regions with
    /// leap voxels; nothing where that is so already.
    pub(crate) fn needed_min_region(&self, regions: &RegionTable) -> Option<u64> {
        let crowded = self.bricks.iter().filter(|b| b.leaping.len() > MAX_SLOTS);
        let needed = crowded.map(|brick| {
            let size = |label: &u32| regions.get(*label).map_or(0, |r| r.voxels);
            let mut sizes: Vec<u64> = brick.leaping.iter().map(size).collect();
            sizes.sort_unstable_by(|a, b| b.cmp(a));
            sizes[MAX_SLOTS] + 1
        });
        needed.max()
    }
}

/// What all rows are read by.
struct Tables<'a> {
    means: &'a [u16],
    requantised: &'a [u16],
    deviates: u16,
    may_be_crowded: bool,
    has_holes: bool,
}

fn take_row(brick: &mut Gathered, slab: &FinalSlab<'_>, voxels: Range<usize>, tables: &Tables<'_>) {
    let Tables { means, requantised, deviates, may_be_crowded, has_holes } = *tables;
    let mut rest = voxels;
    while !rest.is_empty() {
        let (label, start) = (slab.labels[rest.start], rest.start);
        let here = start..start + first_run(&slab.labels[rest.clone()]);
        rest.start = here.end;
        let codes = &slab.codes[here.clone()];
        let data = || codes.iter().copied().filter(|code| !has_holes || *code != NO_DATA_CODE);
        // None at all: bounds that change nothing when joined.
        let raw = if has_holes { bounds(data()) } else { bounds(codes.iter().copied()) };
        if label == NO_REGION {
            // Most bricks soon have all that there can be.
            let deviation = match brick.deviation < deviates {
                true => data().map(|c| requantised[usize::from(c)].abs_diff(c)).max().unwrap_or(0),
                false => 0,
            };
            // Requantising keeps the order.
            brick.meet(label, raw, raw.map(|c| requantised[usize::from(c)]), deviation);
            continue;
        }
        let mean = means[label as usize];
        brick.meet(label, raw, [mean; 2], mean.abs_diff(raw[0]).max(mean.abs_diff(raw[1])));
        let at = if may_be_crowded { brick.leaping.binary_search(&label).err() } else { None };
        if (at.is_some() || !brick.has_leaps) && slab.distances[here].iter().any(|d| *d >= LEAP_DISTANCE) {
            brick.has_leaps = true;
            at.into_iter().for_each(|at| brick.leaping.insert(at, label));
        }
    }
}

fn bounds(codes: impl Iterator<Item = u16>) -> [u16; 2] {
    let (low, high) = codes.fold((u16::MAX, 0), |(low, high), c| (c.min(low), c.max(high)));
    [low, high]
}

/// How many labels are the first one before another comes; there is one.
fn first_run(labels: &[u32]) -> usize {
    let (first, (at_once, rest)) = (labels[0], labels.as_chunks::<8>());
    let whole = at_once.iter().take_while(|labels| labels.iter().fold(0, |any, l| any | (l ^ first)) == 0).count();
    let tail = at_once.get(whole).map_or(rest, |labels| &labels[..]);
    whole * 8 + tail.iter().position(|label| *label != first).unwrap_or(tail.len())
}
