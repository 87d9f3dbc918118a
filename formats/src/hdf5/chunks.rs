//! Where the chunks of a dataset lie: its index, a window of it at a time.

use std::collections::HashMap;

use hdf5_reader::Hdf5File;
use hdf5_reader::btree_v1::{BTreeV1Key, collect_btree_v1_leaves_storage};
use hdf5_reader::chunk_index::{ChunkEntry, collect_v2_chunk_entries_storage};
use hdf5_reader::extensible_array::collect_extensible_array_chunk_entries_storage;
use hdf5_reader::fixed_array::collect_fixed_array_chunk_entries_storage;
use hdf5_reader::io::Cursor;
use hdf5_reader::messages::layout::ChunkIndexing;

use crate::wrong::Wrong;

/// Chunks whose places are known at a time. B-trees are walked from end to end for each window.
const WINDOW: u64 = 1 << 18;
/// In one layer of chunks, which is the least that a window has.
const MOST_IN_A_LAYER: u64 = 1 << 20;

/// Where a chunk lies as it is stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packed {
    pub(super) address: u64,
    pub(super) bytes: u64,
    pub(super) mask: u32,
}

/// A chunk's number along each axis of the dataset.
pub(super) type Place = Vec<u64>;

#[derive(Debug)]
pub(super) struct Index {
    pub(super) address: u64,
    pub(super) indexing: Option<ChunkIndexing>,
    pub(super) dims: Vec<u32>,
    pub(super) shape: Vec<u64>,
    pub(super) max_shape: Vec<u64>,
    /// Bytes of a chunk once it is decoded.
    pub(super) chunk_bytes: u64,
    /// The axis of layers, and where the volume lies along the axes that are none of its own.
    pub(super) layers: Option<usize>,
    pub(super) fixed: Vec<Option<u64>>,
    /// The layers that are known, and chunks in them.
    window: (u64, u64),
    known: HashMap<Place, Packed>,
}

impl Index {
    #[allow(clippy::too_many_arguments, reason = "what the header says")]
    pub(super) fn new(
        (address, indexing): (u64, Option<ChunkIndexing>),
        (dims, shape, max_shape): (Vec<u32>, Vec<u64>, Vec<u64>),
        chunk_bytes: u64,
        (layers, fixed): (Option<usize>, Vec<Option<u64>>),
    ) -> Result<Self, Wrong> {
        let new = Self {
            address,
            indexing,
            dims,
            shape,
            max_shape,
            chunk_bytes,
            layers,
            fixed,
            window: (0, 0),
            known: HashMap::new(),
        };
        match new.in_a_layer() {
            n if n > MOST_IN_A_LAYER => {
                let why = format!("{n} of {:?} in one layer, and at most {MOST_IN_A_LAYER} are read", new.dims);
                Err(Wrong::new("chunks", why, "save it with larger ones: h5repack -l CHUNK=1x1024x1024 IN OUT"))
            }
            _ => Ok(new),
        }
    }

    fn count(&self, axis: usize) -> u64 {
        self.shape[axis].div_ceil(u64::from(self.dims[axis]))
    }

    fn in_a_layer(&self) -> u64 {
        let axes = (0..self.shape.len()).filter(|axis| Some(*axis) != self.layers && self.fixed[*axis].is_none());
        axes.fold(1, |n, axis| n.saturating_mul(self.count(axis)))
    }

    /// The chunk at `place`; nothing where none was written.
    pub(super) fn get(&self, place: &[u64]) -> Option<Packed> {
        self.known.get(place).copied()
    }

    /// Makes the chunks of these layers known.
    pub(super) fn know(&mut self, file: &Hdf5File, first: u64, end: u64) -> Result<(), Wrong> {
        if self.window.0 <= first && end <= self.window.1 {
            return Ok(());
        }
        let all = self.layers.map_or(1, |axis| self.count(axis));
        let end = end.max(first.saturating_add(WINDOW / self.in_a_layer())).min(all);
        self.window = (0, 0);
        self.known.clear();
        let lo: Vec<u64> = (0..self.shape.len())
            .map(|axis| match self.fixed[axis] {
                Some(at) => at,
                None if Some(axis) == self.layers => first,
                None => 0,
            })
            .collect();
        let hi: Vec<u64> = (0..self.shape.len())
            .map(|axis| match self.fixed[axis] {
                Some(at) => at,
                None if Some(axis) == self.layers => end - 1,
                None => self.count(axis) - 1,
            })
            .collect();
        self.known = self.found(file, &lo, &hi)?;
        self.window = (first, end);
        Ok(())
    }

    /// The chunks between `lo` and `hi`, both of them included.
    fn found(&self, file: &Hdf5File, lo: &[u64], hi: &[u64]) -> Result<HashMap<Place, Packed>, Wrong> {
        let (storage, superblock) = (file.storage(), file.superblock());
        let (offset, length) = (superblock.offset_size, superblock.length_size);
        let (address, dims, bounds) = (self.address, &self.dims[..], Some((lo, hi)));
        let axes = dims.len();
        // Where an array counts chunks, it counts those that there may be one day.
        let max = || -> Vec<u64> {
            self.shape.iter().zip(&self.max_shape).map(|(n, max)| if *max == u64::MAX { *n } else { *max }).collect()
        };
        let entries = match &self.indexing {
            None => {
                let tree =
                    collect_btree_v1_leaves_storage(storage, address, offset, length, Some(axes as u32), dims, bounds);
                tree.map(|leaves| {
                    let entry = |(key, address)| match key {
                        BTreeV1Key::RawData { chunk_size, filter_mask, offsets } => {
                            Some(ChunkEntry { address, size: chunk_size.into(), filter_mask, offsets })
                        }
                        BTreeV1Key::Group { .. } => None,
                    };
                    leaves.into_iter().filter_map(entry).collect()
                })
            }
            Some(ChunkIndexing::SingleChunk { filtered_size, filters }) => {
                Ok(vec![ChunkEntry { address, size: *filtered_size, filter_mask: *filters, offsets: vec![0; axes] }])
            }
            Some(ChunkIndexing::Implicit) => return Ok(self.implicit(lo, hi, &max())),
            Some(ChunkIndexing::FixedArray { .. }) => {
                collect_fixed_array_chunk_entries_storage(storage, address, offset, length, &max(), dims, bounds)
            }
            Some(ChunkIndexing::ExtensibleArray { .. }) => collect_extensible_array_chunk_entries_storage(
                storage,
                address,
                offset,
                length,
                &self.shape,
                Some(&self.max_shape),
                dims,
                bounds,
            ),
            Some(ChunkIndexing::BTreeV2) => {
                collect_v2_chunk_entries_storage(storage, address, offset, length, axes as u32, dims, bounds)
            }
        };
        let entries = entries.map_err(|e| Wrong::broken("index of chunks", e))?;
        let mut known = HashMap::with_capacity(entries.len());
        for entry in entries.into_iter().filter(|entry| !Cursor::is_undefined_offset(entry.address, offset)) {
            let place: Option<Place> =
                entry.offsets.get(..axes).map(|at| at.iter().zip(dims).map(|(at, n)| at / u64::from(*n)).collect());
            let place = place.ok_or_else(|| Wrong::broken("index of chunks", "a chunk has too few numbers"))?;
            let bytes = if entry.size == 0 { self.chunk_bytes } else { entry.size };
            known.insert(place, Packed { address: entry.address, bytes, mask: entry.filter_mask });
        }
        Ok(known)
    }

    /// Chunks one after the other, all of them there.
    fn implicit(&self, lo: &[u64], hi: &[u64], max: &[u64]) -> HashMap<Place, Packed> {
        let mut known = HashMap::new();
        let mut place = lo.to_vec();
        loop {
            let counts = max.iter().zip(&self.dims).map(|(n, dim)| n.div_ceil(u64::from(*dim)));
            let number =
                place.iter().zip(counts).fold(0, |n: u64, (at, count)| n.wrapping_mul(count).wrapping_add(*at));
            let address = number.checked_mul(self.chunk_bytes).and_then(|at| at.checked_add(self.address));
            // Past the end of any file.
            let address = address.unwrap_or(u64::MAX / 2);
            known.insert(place.clone(), Packed { address, bytes: self.chunk_bytes, mask: 0 });
            let Some(axis) = (0..place.len()).rev().find(|axis| place[*axis] < hi[*axis]) else { return known };
            place[axis] += 1;
            place[axis + 1..].copy_from_slice(&lo[axis + 1..]);
        }
    }
}
