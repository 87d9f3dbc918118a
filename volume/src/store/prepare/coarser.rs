//! The coarser levels' voxels and ranges, from the finest voxels as they pass by.
//!
//! A voxel of a level is the mean of the finest voxels with data under it, as stored numbers, rounded half up: of exact
//! sums, never of a finer level's rounded means. Without data is one that has none under it. The ranges of a level are
//! those of the finest voxels, so that no level hides a pore from whoever asks what a brick can show.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::spool::Spool;
use super::tables::{MeanPlane, Tables};
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::profile::gathered_file;
use crate::store::pyramid::{Pyramid, TILED, Under};
use crate::store::tiles::Tile;
use crate::store::voxel::{StoredType, Voxel};

/// Voxels whose means are taken at once.
const PART: usize = 1 << 15;

/// Finest voxels with data, as ordinals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Finest {
    /// At most 2^44 voxels of 16 bits: it fits.
    sum: u64,
    count: u64,
    /// Smallest and largest; the first above the second where there is none.
    low: u16,
    high: u16,
}

impl Under for Finest {
    const NOTHING: Self = Self { sum: 0, count: 0, low: u16::MAX, high: 0 };

    #[inline(always)]
    fn join(&mut self, other: &Self) {
        self.sum += other.sum;
        self.count += other.count;
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }
}

impl Finest {
    const BYTES: usize = 8 + 8 + 2 + 2;

    /// Little endian, in the order of the fields.
    fn to_bytes(self) -> [u8; Self::BYTES] {
        let (sum, count) = (self.sum.to_le_bytes(), self.count.to_le_bytes());
        let all = sum.into_iter().chain(count).chain(self.low.to_le_bytes()).chain(self.high.to_le_bytes());
        let mut bytes = [0; Self::BYTES];
        bytes.iter_mut().zip(all).for_each(|(byte, value)| *byte = value);
        bytes
    }

    fn of_bytes(bytes: &[u8; Self::BYTES]) -> Self {
        let number = |range: Range<usize>| bytes[range].iter().rev().fold(0, |n, byte| n << 8 | u64::from(*byte));
        Self { sum: number(0..8), count: number(8..16), low: number(16..18) as u16, high: number(18..20) as u16 }
    }

    #[inline(always)]
    fn take(&mut self, ordinal: u16) {
        self.join(&Self { sum: ordinal.into(), count: 1, low: ordinal, high: ordinal });
    }

    /// The mean, rounded half up. Never the ordinal of `no_data` where there are data: where it would be, there are
    /// data above it, and the mean is one more.
    #[inline(always)]
    fn mean(&self, no_data: Option<u16>) -> u16 {
        let mean = match self.count {
            0 => return no_data.unwrap_or_default(),
            count if count.is_power_of_two() => (self.sum + count / 2) >> count.trailing_zeros(),
            count => (2 * self.sum + count) / (2 * count),
        };
        let mean = mean as u16;
        if no_data == Some(mean) { mean + 1 } else { mean }
    }
}

/// A level whose voxels lie in scratch files, still to be written.
#[derive(Debug)]
pub(crate) struct RawLevel {
    pub(crate) level: u8,
    pub(crate) tables: Tables,
    /// Stands at its first voxel.
    pub(crate) voxels: Box<dyn VolumeSource>,
}

/// A level that is being gathered.
#[derive(Debug)]
struct Gathering {
    level: u8,
    tables: Tables,
    /// From `first` on.
    voxels: Spool,
    first: u32,
}

/// What a part has gathered of coarser levels, beside their voxels.
pub(crate) struct LevelsOfPart {
    /// Of each level that lies in one part.
    pub(crate) tables: Vec<(u8, Tables)>,
    /// The bytes of what is under its voxels of level 8, where there are coarser levels.
    pub(crate) seam: Option<Vec<u8>>,
}

/// The levels, from level 1 on, whose voxels lie in one part each.
pub(crate) const LEVELS_OF_PART: u8 = TILED as u8;

/// Gathers all coarser levels, tile by tile and slab by slab.
#[derive(Debug)]
pub(crate) struct Coarser {
    pyramid: Pyramid<Finest>,
    levels: Vec<Gathering>,
    /// The finest planes that come.
    finest: Range<u32>,
    /// The ordinal of voxels without data.
    no_data: Option<u16>,
    planes: Planes,
}

/// A plane of a level on its way to its file and its tables.
#[derive(Debug)]
struct Planes {
    stored_type: StoredType,
    /// Of voxels.
    bytes: Vec<u8>,
    /// Smallest and largest finest ordinal.
    low: Vec<u16>,
    high: Vec<u16>,
    /// The voxels' own, likewise.
    means: [Vec<u16>; 2],
}

impl Coarser {
    /// Of a volume of `header` in the stored type; `levels` from level 1 on, whose scratch files go into `scratch`.
    pub(crate) fn new(
        header: &SourceHeader,
        levels: &[Geometry],
        (brick_size, has_several_tiles): (u32, bool),
        no_data: Option<u16>,
        scratch: &Path,
    ) -> Result<Self, StoreError> {
        let dims = levels.iter().map(Geometry::dims);
        let pyramid = Pyramid::new(dims, has_several_tiles);
        let of_levels = (1, levels, 0..header.geometry.dims().z);
        Self::with(pyramid, header, of_levels, brick_size, no_data, scratch)
    }

    /// Of one part of it, `finest` planes; what it gathers stays in `folder`.
    pub(crate) fn of_part(
        header: &SourceHeader,
        levels: &[Geometry],
        brick_size: u32,
        no_data: Option<u16>,
        (folder, finest): (&Path, &Range<u32>),
    ) -> Result<Self, StoreError> {
        let pyramid = Pyramid::new(levels.iter().map(Geometry::dims), true);
        let own = &levels[..levels.len().min(TILED)];
        Self::with(pyramid, header, (1, own, finest.clone()), brick_size, no_data, folder)
    }

    /// `levels` from level `first` on, as far as they lie above `finest` planes.
    fn with(
        pyramid: Pyramid<Finest>,
        header: &SourceHeader,
        (first, levels, finest): (u8, &[Geometry], Range<u32>),
        brick_size: u32,
        no_data: Option<u16>,
        folder: &Path,
    ) -> Result<Self, StoreError> {
        let stored_type = StoredType::of(header.voxel_type);
        let gathering = |(level, geometry): (u8, &Geometry)| {
            let planes = finest.start >> level..finest.end.div_ceil(1 << level);
            let held = geometry.cut_to(planes.len() as u32);
            let header = SourceHeader::new(header.format, held, stored_type.voxel_type());
            let voxels = Spool::create(header, folder, &gathered_file(level))?;
            let tables = Tables::new(BrickGrid::new(geometry.dims(), brick_size)?, level, None);
            Ok(Gathering { level, tables, voxels, first: planes.start })
        };
        let levels = (first..).zip(levels).map(gathering).collect::<Result<_, StoreError>>()?;
        let planes =
            Planes { stored_type, bytes: Vec::new(), low: Vec::new(), high: Vec::new(), means: Default::default() };
        Ok(Self { pyramid, levels, finest, no_data, planes })
    }

    /// Takes a slab of a tile, from `z0` on.
    pub(crate) fn add<T: Voxel>(&mut self, tile: &Tile, z0: u32, slab: &[T]) -> Result<(), StoreError> {
        if self.pyramid.is_empty() {
            return Ok(());
        }
        let Self { pyramid, levels, no_data, planes, .. } = self;
        let mut take =
            |at: usize, tile: &Tile, z: u32, plane: &[Finest]| planes.take(&mut levels[at], tile, z, plane, *no_data);
        match no_data.map(T::at) {
            None => pyramid.add(tile, z0, slab, |row, out| gather(row, out, |_| true), &mut take),
            Some(none) => pyramid.add(tile, z0, slab, |row, out| gather(row, out, |v| v != none), &mut take),
        }
    }

    /// All levels, once every tile has passed.
    pub(crate) fn finish(self) -> Result<Vec<RawLevel>, StoreError> {
        self.finish_from(0)
    }

    /// The first level that is gathered is that at `from`.
    fn finish_from(self, from: usize) -> Result<Vec<RawLevel>, StoreError> {
        let Self { pyramid, mut levels, no_data, mut planes, .. } = self;
        pyramid.finish(&mut |at: usize, tile: &Tile, z: u32, plane: &[Finest]| {
            planes.take(&mut levels[at - from], tile, z, plane, no_data)
        })?;
        let raw = |Gathering { level, tables, mut voxels, .. }| {
            voxels.start_over()?;
            Ok(RawLevel { level, tables, voxels: Box::new(voxels) })
        };
        levels.into_iter().map(raw).collect()
    }

    /// What a part has gathered; the voxels of its levels are on the disk then.
    pub(crate) fn finish_part(self) -> Result<LevelsOfPart, StoreError> {
        let Self { pyramid, levels, finest, .. } = self;
        let settled = |Gathering { level, tables, voxels, .. }| voxels.settle().map(|()| (level, tables));
        let tables = levels.into_iter().map(settled).collect::<Result<_, StoreError>>()?;
        let seam = pyramid.into_seam(finest.start >> TILED..finest.end.div_ceil(1 << TILED));
        Ok(LevelsOfPart { tables, seam: seam.map(|seam| seam.into_iter().flat_map(Finest::to_bytes).collect()) })
    }
}

/// The levels that lie above several parts, from the bytes of what is under all voxels of level 8; nothing where these
/// are not so many.
pub(crate) fn above_parts(
    header: &SourceHeader,
    levels: &[Geometry],
    brick_size: u32,
    no_data: Option<u16>,
    (scratch, seam): (&Path, &[u8]),
) -> Result<Option<Vec<RawLevel>>, StoreError> {
    let seam = seam.as_chunks::<{ Finest::BYTES }>().0.iter().map(Finest::of_bytes).collect();
    let Some(pyramid) = Pyramid::above(levels.iter().map(Geometry::dims), seam) else { return Ok(None) };
    let of_levels = (LEVELS_OF_PART + 1, &levels[TILED..], 0..header.geometry.dims().z);
    Coarser::with(pyramid, header, of_levels, brick_size, no_data, scratch)?.finish_from(TILED).map(Some)
}

/// Adds a row of the finest voxels to a row of half the length.
#[inline(always)]
fn gather<T: Voxel>(row: &[T], out: &mut [Finest], holds_data: impl Fn(T) -> bool) {
    let (pairs, rest) = row.as_chunks::<2>();
    let pairs = pairs.iter().map(|pair| &pair[..]).chain(std::iter::once(rest).filter(|rest| !rest.is_empty()));
    for (under, pair) in out.iter_mut().zip(pairs) {
        match *pair {
            [a, b] if holds_data(a) && holds_data(b) => {
                let (a, b) = (a.ordinal(), b.ordinal());
                under.join(&Finest { sum: u64::from(a) + u64::from(b), count: 2, low: a.min(b), high: a.max(b) });
            }
            _ => pair.iter().filter(|v| holds_data(**v)).for_each(|v| under.take(v.ordinal())),
        }
    }
}

impl Planes {
    fn take(
        &mut self,
        raw: &mut Gathering,
        tile: &Tile,
        z: u32,
        plane: &[Finest],
        no_data: Option<u16>,
    ) -> Result<(), StoreError> {
        let (stored_type, bytes) = (self.stored_type, self.stored_type.bytes());
        self.bytes.resize(plane.len() * bytes, 0);
        let [least, most] = &mut self.means;
        for ordinals in [&mut self.low, &mut self.high, least, most] {
            ordinals.resize(plane.len(), 0);
        }
        let all = self.bytes.par_chunks_mut(PART * bytes).zip(plane.par_chunks(PART));
        let all = all.zip(self.low.par_chunks_mut(PART).zip(self.high.par_chunks_mut(PART)));
        let all = all.zip(least.par_chunks_mut(PART).zip(most.par_chunks_mut(PART)));
        all.for_each(|(((out, plane), (low, high)), (least, most))| {
            let means = least.iter_mut().zip(most);
            for ((out, under), (least, most)) in out.chunks_exact_mut(bytes).zip(plane).zip(means) {
                let mean = under.mean(no_data);
                out.copy_from_slice(&stored_type.bits_of_ordinal(mean).to_le_bytes()[..bytes]);
                (*least, *most) = if under.count > 0 { (mean, mean) } else { (u16::MAX, 0) };
            }
            for ((low, high), under) in low.iter_mut().zip(high).zip(plane) {
                (*low, *high) = (under.low, under.high);
            }
        });
        raw.voxels.put(tile, z - raw.first, &self.bytes)?;
        let means = self.means.each_ref().map(|of| &of[..]);
        raw.tables.add_means(tile, z, MeanPlane { low: &self.low, high: &self.high, means });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(ordinals: &[u16]) -> Finest {
        let mut finest = Finest::NOTHING;
        ordinals.iter().for_each(|o| finest.take(*o));
        finest
    }

    #[test]
    fn means_are_rounded_half_up_whatever_their_number() {
        for (ordinals, want) in [
            (&[3_u16][..], 3),
            (&[3, 4], 4),
            (&[1, 1, 2], 1),
            (&[1, 2, 2], 2),
            (&[0, 0, 0, 1], 0),
            (&[0, 0, 1, 1], 1),
            (&[1, 2, 4, 4, 4], 3),
            (&[u16::MAX; 9], u16::MAX),
        ] {
            assert_eq!(of(ordinals).mean(None), want, "{ordinals:?}");
        }
        let huge = Finest { sum: 65535 << 44, count: 1 << 44, low: 65535, high: 65535 };
        assert_eq!(huge.mean(None), 65535);
        let odd = Finest { sum: 65535 * ((1 << 44) - 1), count: (1 << 44) - 1, ..huge };
        assert_eq!(odd.mean(None), 65535);
    }

    /// Data on both sides of a fill value: their mean is no datum's number, and neither is it no data.
    #[test]
    fn no_mean_of_data_passes_for_no_data() {
        assert_eq!(of(&[6, 8]).mean(Some(7)), 8);
        assert_eq!(of(&[6, 7]).mean(Some(9)), 7);
        assert_eq!(of(&[]).mean(Some(7)), 7);
        assert_eq!(of(&[65533, 65535]).mean(Some(65534)), 65535);
    }

    /// A signed type's half goes up, not away from zero.
    #[test]
    fn halves_of_negative_numbers_go_up() {
        let mean = |voxels: &[i8]| i8::at(of(&voxels.iter().map(|v| v.ordinal()).collect::<Vec<_>>()).mean(None));
        assert_eq!((mean(&[-3, -4]), mean(&[-1, 0]), mean(&[-1, -1, -2]), mean(&[3, 4])), (-3, 0, -1, 4));
    }
}
