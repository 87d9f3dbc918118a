//! A record of a brick's halo of labels and distances.
//!
//! A halo meets few regions, so labels are numbers of a palette, in as few bytes as the palette needs: with labels of
//! 32 bits bricks of 16^3 would decode 1.8 times what they own.
//!
//! Bytes: number of labels n (u32); the labels, ascending (u32 each); per voxel the place of its label, in no byte
//! where n = 1, in one up to 256, two up to 65,536, else four; per voxel its distance (u8). All little endian, voxels
//! in the order of the shell.

use super::bound::RecordBound;
use crate::regions::NO_REGION;
use crate::store::error::HaloFault;

/// Bytes of a palette's place.
fn width(labels: usize) -> usize {
    match labels {
        0..=1 => 0,
        2..=0x100 => 1,
        0x101..=0x1_0000 => 2,
        _ => 4,
    }
}

/// All labels differ: each has a place in the palette of its own.
pub(crate) const BOUND: RecordBound = RecordBound { head: 4, per_voxel: 4 + 4 + 1 };

/// Nothing where no voxel is in a region (distances are 0 there), or where there is none.
pub(crate) fn encode(labels: &[u32], distances: &[u8]) -> Option<Vec<u8>> {
    // Runs first: there are far fewer of them than voxels.
    let mut palette: Vec<u32> = labels.chunk_by(|a, b| a == b).map(|run| run[0]).collect();
    palette.sort_unstable();
    palette.dedup();
    if matches!(palette.as_slice(), [] | [NO_REGION]) && distances.iter().all(|d| *d == 0) {
        return None;
    }
    let width = width(palette.len());
    let mut bytes = Vec::with_capacity(4 + 4 * palette.len() + (width + 1) * labels.len());
    bytes.extend((palette.len() as u32).to_le_bytes());
    bytes.extend(palette.iter().flat_map(|l| l.to_le_bytes()));
    let runs = labels.chunk_by(|a, b| a == b).take(if width == 0 { 0 } else { labels.len() });
    for run in runs {
        let place = palette.partition_point(|l| *l < run[0]) as u32;
        match (width, place.to_le_bytes()) {
            (1, [place, ..]) => bytes.resize(bytes.len() + run.len(), place),
            (_, place) => run.iter().for_each(|_| bytes.extend_from_slice(&place[..width])),
        }
    }
    bytes.extend_from_slice(distances);
    Some(bytes)
}

/// A decoded record.
#[derive(Debug)]
pub(crate) struct RegionHalo {
    palette: Vec<u32>,
    places: Vec<u8>,
    distances: Vec<u8>,
}

impl RegionHalo {
    /// Nothing but voxels of no region.
    pub(crate) const NONE: Self = Self { palette: Vec::new(), places: Vec::new(), distances: Vec::new() };

    /// Of a shell of `voxels` voxels.
    pub(crate) fn parse(bytes: &[u8], voxels: usize) -> Result<Self, HaloFault> {
        let got = bytes.len();
        let wrong = |want: usize| HaloFault::RecordLength { got, want };
        let (count, rest) = bytes.split_first_chunk::<4>().ok_or(wrong(4))?;
        let count = u32::from_le_bytes(*count) as usize;
        if count == 0 || count > voxels {
            return Err(HaloFault::Palette { labels: count, voxels });
        }
        let width = width(count);
        let want = 4 + 4 * count + (width + 1) * voxels;
        if got != want {
            return Err(wrong(want));
        }
        let (palette, rest) = rest.split_at(4 * count);
        let (places, distances) = rest.split_at(width * voxels);
        let palette: Vec<u32> = palette.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let halo = Self { palette, places: places.to_vec(), distances: distances.to_vec() };
        match (0..voxels).map(|i| halo.place(i)).find(|place| *place >= count) {
            Some(place) => Err(HaloFault::Place { place, labels: count }),
            None => Ok(halo),
        }
    }

    fn place(&self, voxel: usize) -> usize {
        let width = width(self.palette.len());
        self.places[voxel * width..][..width].iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte))
    }

    /// The labels of the shell's voxels from `first` on.
    pub(crate) fn labels(&self, first: usize, out: &mut [u32]) {
        match self.palette.as_slice() {
            [] => out.fill(NO_REGION),
            [label] => out.fill(*label),
            palette => (first..).zip(out).for_each(|(voxel, label)| *label = palette[self.place(voxel)]),
        }
    }

    /// The same of distances.
    pub(crate) fn distances(&self, first: usize, out: &mut [u8]) {
        match self.palette.as_slice() {
            [] => out.fill(0),
            _ => out.copy_from_slice(&self.distances[first..][..out.len()]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One label, and both sides of each width: a place cut to too few bytes would give another region's label.
    #[test]
    fn labels_survive_palettes_of_every_width() {
        for (count, bytes) in [(1, 0), (2, 1), (256, 1), (257, 2), (65_536, 2), (65_537, 4)] {
            let labels: Vec<u32> = (0..count).chain((0..count).rev()).map(|i| i * 7 + 3).collect();
            let distances: Vec<u8> = labels.iter().map(|l| (l % 251) as u8).collect();
            let record = encode(&labels, &distances).unwrap();
            assert_eq!(record.len(), 4 + 4 * count as usize + labels.len() * (bytes + 1), "{count} labels");
            assert!(record.len() as u64 <= BOUND.bytes(labels.len() as u64));
            let halo = RegionHalo::parse(&record, labels.len()).unwrap();
            let (mut got, mut near) = (vec![0; labels.len() - 1], vec![0; labels.len() - 1]);
            halo.labels(1, &mut got);
            halo.distances(1, &mut near);
            assert_eq!((&got[..], &near[..]), (&labels[1..], &distances[1..]), "{count} labels");
        }
    }

    #[test]
    fn nothing_is_stored_where_there_is_no_region() {
        assert_eq!(encode(&[0; 5], &[0; 5]), None);
        assert_eq!(encode(&[], &[]), None);
        assert!(encode(&[0, 0, 1], &[0, 0, 1]).is_some());
        let (mut labels, mut distances) = ([9; 3], [9; 3]);
        RegionHalo::NONE.labels(7, &mut labels);
        RegionHalo::NONE.distances(7, &mut distances);
        assert_eq!((labels, distances), ([0; 3], [0; 3]));
    }

    /// Records whose checksum is right, as a forger would make them.
    #[test]
    fn records_that_contradict_themselves_are_refused() {
        let good = encode(&[3, 5, 5], &[1, 2, 3]).unwrap();
        assert!(RegionHalo::parse(&good, 3).is_ok());
        for cut in 0..good.len() {
            assert!(RegionHalo::parse(&good[..cut], 3).is_err(), "{cut}");
        }
        assert!(matches!(RegionHalo::parse(&good, 4), Err(HaloFault::RecordLength { .. })));
        for (at, value) in [(0, 0), (0, 4), (3, 255)] {
            let mut bad = good.clone();
            bad[at] = value;
            assert!(matches!(RegionHalo::parse(&bad, 3), Err(HaloFault::Palette { .. })), "{at}");
        }
        let mut bad = good.clone();
        bad[4 + 8 + 1] = 2;
        assert!(matches!(RegionHalo::parse(&bad, 3), Err(HaloFault::Place { place: 2, labels: 2 })));
    }
}
