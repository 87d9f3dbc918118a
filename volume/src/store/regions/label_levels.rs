//! Given labels on coarser levels: of the finest voxels with data under one of a level's, the most frequent label; the
//! smallest of those that are.
//!
//! Counted exactly, from the finest labels, in one pass over the label volume. Memory: a plane of counts for each
//! level, about 20 bytes for each voxel of the finest plane, and 16 for each further label that lies under one of
//! theirs.

use std::cmp::Reverse;

use super::label_planes::LabelPlanes;
use super::segment::Segmenter;
use crate::format::{SourceHeader, VoxelType};
use crate::regions::NO_REGION;
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::no_data::NO_DATA_CODE;
use crate::store::prepare::options::Segmentation;
use crate::store::prepare::spool::Spool;
use crate::store::progress::Phase;
use crate::store::pyramid::{Pyramid, Under};
use crate::store::tiles::Tile;

/// How often each label occurs under a voxel.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Counts {
    /// One label; nothing was met where it occurs never.
    label: u32,
    count: u64,
    /// Under most voxels there is no other.
    others: Vec<(u32, u64)>,
}

impl Under for Counts {
    const NOTHING: Self = Self { label: NO_REGION, count: 0, others: Vec::new() };

    fn join(&mut self, other: &Self) {
        self.meet(other.label, other.count);
        other.others.iter().for_each(|(label, count)| self.meet(*label, *count));
    }
}

impl Counts {
    fn meet(&mut self, label: u32, count: u64) {
        match self.others.iter_mut().find(|(other, _)| *other == label) {
            _ if count == 0 => {}
            _ if self.count == 0 => (self.label, self.count) = (label, count),
            _ if self.label == label => self.count += count,
            Some((_, sum)) => *sum += count,
            None => self.others.push((label, count)),
        }
    }

    /// No region where no voxel with data was met.
    fn most_frequent(&self) -> u32 {
        let all = self.others.iter().copied().chain([(self.label, self.count)]);
        all.max_by_key(|(label, count)| (*count, Reverse(*label))).map_or(NO_REGION, |(label, _)| label)
    }
}

impl Segmenter<'_> {
    /// The labels of each of `levels`, from level 1 on, where labels are given; else none. This must be the finest.
    pub(crate) fn labels_of_levels(&mut self, levels: &[Geometry]) -> Result<Vec<Spool>, StoreError> {
        let Segmentation::Labels { path, hints } = &self.options.segmentation else { return Ok(Vec::new()) };
        if levels.is_empty() {
            return Ok(Vec::new());
        }
        let mut planes = LabelPlanes::open(path, hints, (&self.geometry, self.placement))?;
        planes.rewind()?;
        let spool = |(level, geometry): (u32, &Geometry)| {
            let header = SourceHeader::new("labels", *geometry, VoxelType::U32);
            Spool::create(header, self.scratch, &format!("labels-{level}"))
        };
        let mut spools: Vec<Spool> = (1..).zip(levels).map(spool).collect::<Result<_, _>>()?;
        let mut pyramid = Pyramid::<Counts>::new(levels.iter().map(Geometry::dims), false);
        let mut bytes = Vec::new();
        let mut take = |at: usize, tile: &Tile, z: u32, plane: &[Counts]| {
            bytes.clear();
            bytes.extend(plane.iter().flat_map(|counts| counts.most_frequent().to_le_bytes()));
            spools[at].put(tile, z, &bytes)
        };
        let (whole, plane) = (Tile::whole(self.geometry.dims()), self.voxels.plane());
        let (mut labels, mut codes) = (Vec::new(), Vec::new());
        for (z0, z1) in self.slabs() {
            self.report(Phase::Labels, z0);
            planes.read(z0, z1, plane, &mut labels)?;
            let mut slab: Vec<Option<u32>> = labels.iter().copied().map(Some).collect();
            if self.has_holes {
                self.voxels.read(z0, z1, &mut codes)?;
                slab.iter_mut().zip(&codes).filter(|(_, c)| **c == NO_DATA_CODE).for_each(|(label, _)| *label = None);
            }
            let gather = |row: &[Option<u32>], out: &mut [Counts]| {
                for (pair, counts) in row.chunks(2).zip(out) {
                    pair.iter().flatten().for_each(|label| counts.meet(*label, 1));
                }
            };
            pyramid.add(&whole, z0, &slab, gather, &mut take)?;
        }
        pyramid.finish(&mut take)?;
        spools.iter_mut().try_for_each(Spool::start_over)?;
        Ok(spools)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(labels: &[u32]) -> Counts {
        let mut counts = Counts::NOTHING;
        labels.iter().for_each(|label| counts.meet(*label, 1));
        counts
    }

    #[test]
    fn the_most_frequent_label_wins_and_of_equals_the_smallest() {
        for (labels, want) in [
            (&[][..], NO_REGION),
            (&[7], 7),
            (&[7, 0], 0),
            (&[7, 0, 7], 7),
            (&[9, 3, 3, 9, 5], 3),
            (&[1, 2, 3, 3, 2, 1, 0], 1),
        ] {
            assert_eq!(of(labels).most_frequent(), want, "{labels:?}");
        }
    }

    /// Of the finest labels, not of the winners among them.
    #[test]
    fn counts_are_joined_and_not_their_winners() {
        let mut all = of(&[1, 1, 1, 2, 2]);
        all.join(&of(&[3, 3, 3, 2, 2]));
        all.join(&Counts::NOTHING);
        assert_eq!(all.most_frequent(), 2);
        let mut onto = Counts::NOTHING;
        onto.join(&all);
        assert_eq!(onto.most_frequent(), 2);
    }
}
