//! Given labels on coarser levels: of the finest voxels with data under one of a level's, the most frequent label; the
//! smallest of those that are.
//!
//! Counted exactly, from the finest labels, in one pass over the label volume. Memory: a plane of counts for each
//! level, about 20 bytes for each voxel of the finest plane, and 16 for each further label that lies under one of
//! theirs: no more than [`MOST_OTHERS`] of them in a plane, and while one is gathered, in two.

use std::cmp::Reverse;

use super::error::RegionsError;
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

/// Further labels under the voxels of one plane of a level, at most: 128 MiB of them. Where labels are parts of
/// something there are a few under a voxel.
const MOST_OTHERS: usize = 1 << 23;

impl Under for Counts {
    const NOTHING: Self = Self { label: NO_REGION, count: 0, others: Vec::new() };

    /// In a time that goes with the number of labels.
    fn join(&mut self, other: &Self) {
        if other.others.is_empty() {
            return self.meet(other.label, other.count);
        }
        if self.count == 0 {
            return self.clone_from(other);
        }
        let (mine, theirs) = (std::mem::take(self).sorted(), other.clone().sorted());
        *self = Self::of_sorted(merged(&mine, &theirs));
    }
}

impl Default for Counts {
    fn default() -> Self {
        Self::NOTHING
    }
}

impl Counts {
    fn meet(&mut self, label: u32, count: u64) {
        if count == 0 {
            return;
        }
        if self.count == 0 {
            (self.label, self.count) = (label, count);
        } else if self.label == label {
            self.count += count;
        } else {
            match self.others.binary_search_by_key(&label, |(other, _)| *other) {
                Ok(at) => self.others[at].1 += count,
                Err(at) => self.others.insert(at, (label, count)),
            }
        }
    }

    /// All labels, ascending.
    fn sorted(self) -> Vec<(u32, u64)> {
        let Self { label, count, mut others } = self;
        if count > 0 {
            let at = others.partition_point(|(other, _)| *other < label);
            others.insert(at, (label, count));
        }
        others
    }

    fn of_sorted(mut all: Vec<(u32, u64)>) -> Self {
        let Some((label, count)) = all.pop() else { return Self::NOTHING };
        Self { label, count, others: all }
    }

    /// No region where no voxel with data was met.
    fn most_frequent(&self) -> u32 {
        let all = self.others.iter().copied().chain([(self.label, self.count)]);
        all.max_by_key(|(label, count)| (*count, Reverse(*label))).map_or(NO_REGION, |(label, _)| label)
    }
}

/// Of two ascending lists one; counts of the same label are added.
fn merged(a: &[(u32, u64)], b: &[(u32, u64)]) -> Vec<(u32, u64)> {
    let mut all = Vec::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().copied().peekable(), b.iter().copied().peekable());
    loop {
        let next = match (a.peek().copied(), b.peek().copied()) {
            (None, None) => return all,
            (Some((x, count)), Some((y, more))) if x == y => {
                a.next();
                b.next();
                Some((x, count + more))
            }
            (Some((x, _)), Some((y, _))) if y < x => b.next(),
            (None, Some(_)) => b.next(),
            _ => a.next(),
        };
        all.extend(next);
    }
}

impl Segmenter<'_> {
    /// The labels of each of `levels`, from level 1 on, where labels are given; else none. This must be the finest.
    pub(crate) fn labels_of_levels(&mut self, levels: &[Geometry]) -> Result<Vec<Spool>, StoreError> {
        let Segmentation::Labels { path, hints, opener } = &self.options.segmentation else { return Ok(Vec::new()) };
        if levels.is_empty() {
            return Ok(Vec::new());
        }
        let mut planes = LabelPlanes::open((path, hints, *opener), (&self.geometry, self.placement))?;
        planes.rewind()?;
        let spool = |(level, geometry): (u32, &Geometry)| {
            let header = SourceHeader::new("labels", *geometry, VoxelType::U32);
            Spool::create(header, self.scratch, &format!("labels-{level}"))
        };
        let mut spools: Vec<Spool> = (1..).zip(levels).map(spool).collect::<Result<_, _>>()?;
        let mut pyramid = Pyramid::<Counts>::new(levels.iter().map(Geometry::dims), false);
        let mut bytes = Vec::new();
        let mut take = |at: usize, tile: &Tile, z: u32, plane: &[Counts]| {
            check_others(at + 1, plane, MOST_OTHERS)?;
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

/// Refuses a plane of `level` under whose voxels more than `most` labels beyond the first lie.
fn check_others(level: usize, plane: &[Counts], most: usize) -> Result<(), RegionsError> {
    let others: usize = plane.iter().map(|counts| counts.others.len()).sum();
    if others > most { Err(RegionsError::ScatteredLabels { level, others, most }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

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

    /// As many labels as voxels under a deep one: a list that is searched from its start takes minutes.
    #[test]
    fn many_labels_are_counted_in_a_time_that_goes_with_their_number() {
        const EACH: u32 = 50_000;
        let child = |i: u32| Counts::of_sorted((0..EACH).map(|k| (8 * k + i, 1)).collect());
        let started = Instant::now();
        let mut all = Counts::NOTHING;
        (0..8).for_each(|i| all.join(&child(i)));
        all.join(&Counts::of_sorted(vec![(7, 5), (8 * EACH, 2)]));
        assert!(started.elapsed().as_secs() < 20);
        assert_eq!(all.others.len(), 8 * EACH as usize);
        assert!(all.others.is_sorted_by_key(|(label, _)| *label));
        assert_eq!(all.most_frequent(), 7);
    }

    #[test]
    fn labels_without_order_are_refused_before_they_fill_the_memory() {
        let plane = [of(&[1, 2, 3]), Counts::NOTHING, of(&[4, 4, 5])];
        assert_eq!(check_others(3, &plane, 3), Ok(()));
        let refused = check_others(3, &plane, 2);
        assert_eq!(refused, Err(RegionsError::ScatteredLabels { level: 3, others: 3, most: 2 }));
        let words = refused.unwrap_err().to_string();
        assert!(words.contains("level 3") && words.contains("--levels 2"), "{words}");
    }

    /// Whatever was met first.
    #[test]
    fn counts_do_not_depend_on_the_order_of_labels() {
        let lists = [[9, 3, 3, 9, 5], [3, 9, 5, 9, 3], [5, 9, 9, 3, 3]];
        let sorted: Vec<_> = lists.iter().map(|labels| of(labels).sorted()).collect();
        assert!(sorted.iter().all(|counts| *counts == [(3, 2), (5, 1), (9, 2)]), "{sorted:?}");
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
