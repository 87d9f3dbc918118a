//! Boxes of a dataset's numbers.
//!
//! The invariant: *a box costs its own bytes, the chunks that are being decoded, and [`KEPT_BYTES`] of those that reach
//! into the next box; never more, whatever the file says.*

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;

use brickcast_volume::format::Endian;
use hdf5_reader::Hdf5File;
use hdf5_reader::messages::filter_pipeline::FilterDescription;
use rayon::prelude::*;

use super::chunks::{Index, Packed, Place};
use super::dataset::{Dataset, Stored};
use super::filters;
use crate::ordered::{single, swap};
use crate::wrong::Wrong;

/// The largest chunk: it is decoded as a whole.
const MOST_CHUNK: u64 = 256 << 20;
/// Chunks that are decoded at a time.
const AT_ONCE_BYTES: u64 = 64 << 20;
/// Decoded chunks that are kept for the box that follows.
const KEPT_BYTES: usize = 256 << 20;
const PIECE: u64 = 4 << 20;
/// A plane may have so many times the file's bytes: as far as deflate goes, and some room for what was never written.
const MOST_EXPANSION: u64 = 1100;
const NEXT_TO_NOTHING: u64 = 8 << 20;

type Filters = Vec<FilterDescription>;

/// Of the numbers in the file along x, y, z, in numbers.
type Strides = [u64; 3];

pub(super) struct Blocks {
    file: Hdf5File,
    dataset: Dataset,
    dims: [u32; 3],
    chunks: Option<(Index, Filters)>,
    kept: HashMap<Place, Vec<u8>>,
}

impl std::fmt::Debug for Blocks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Blocks").field("dataset", &self.dataset).finish_non_exhaustive()
    }
}

fn bytes_of(shape: impl IntoIterator<Item = u64>, element: usize) -> Option<u64> {
    shape.into_iter().try_fold(element as u64, u64::checked_mul)
}

impl Blocks {
    pub(super) fn new(file: Hdf5File, mut dataset: Dataset, file_bytes: u64) -> Result<Self, Wrong> {
        let dims = dataset.dims()?;
        let element = dataset.kind.bytes;
        let plane = bytes_of([dims[0], dims[1]].map(u64::from), element);
        let most = file_bytes.saturating_mul(MOST_EXPANSION).saturating_add(NEXT_TO_NOTHING);
        if plane.is_none_or(|plane| plane > most) {
            let why = format!("a plane of {} x {} numbers cannot come out of {file_bytes} bytes", dims[0], dims[1]);
            return Err(Wrong::broken("dataspace", why));
        }
        let whole = bytes_of(dataset.shape.iter().copied(), element);
        let mut chunks = None;
        match std::mem::replace(&mut dataset.stored, Stored::Nowhere) {
            Stored::Chunks { index, dims, indexing, filters } => {
                let chunk_bytes = bytes_of(dims.iter().map(|n| u64::from(*n)), element).unwrap_or(u64::MAX);
                if chunk_bytes > MOST_CHUNK {
                    let why = format!("{dims:?} of {element} bytes each, and a chunk of at most 256 MiB is read");
                    let remedy = "save it with smaller ones: h5repack -l CHUNK=1x1024x1024 IN OUT";
                    return Err(Wrong::new("chunks", why, remedy));
                }
                let own: Vec<usize> = dataset.axes.iter().flatten().copied().collect();
                let fixed = (0..dims.len())
                    .map(|axis| (!own.contains(&axis)).then(|| dataset.at[axis] / u64::from(dims[axis])));
                let (layers, fixed) = (dataset.axes[2], fixed.collect());
                let shapes = (dims, dataset.shape.clone(), dataset.max_shape.clone());
                chunks = Some((Index::new((index, indexing), shapes, chunk_bytes, (layers, fixed))?, filters));
            }
            Stored::InARow(start) => {
                let (has, whole) = (file.storage().len(), whole.unwrap_or(u64::MAX));
                if start.checked_add(whole).is_none_or(|end| end > has) {
                    let why = format!("{whole} bytes from byte {start} on, and the file has {has}");
                    return Err(Wrong::broken("dataset", why));
                }
                dataset.stored = Stored::InARow(start);
            }
            Stored::Here(data) => {
                if whole != Some(data.len() as u64) {
                    return Err(Wrong::broken("layout", format!("{} bytes of numbers in the header", data.len())));
                }
                dataset.stored = Stored::Here(data);
            }
            Stored::Nowhere => {}
        }
        Ok(Self { file, dataset, dims, chunks, kept: HashMap::new() })
    }

    pub(super) fn is_in_chunks(&self) -> bool {
        self.chunks.is_some()
    }

    /// Of a chunk along x, y, z; of what is in none, one plane.
    pub(super) fn chunk_size(&self) -> [u64; 3] {
        self.chunks.as_ref().map_or([1; 3], |(index, _)| self.size_in(index))
    }

    fn size_in(&self, index: &Index) -> [u64; 3] {
        self.dataset.axes.map(|axis| axis.map_or(1, |axis| u64::from(index.dims[axis])))
    }

    /// Replaces `out` by the voxels of `[lo, hi)`, little endian, x fastest.
    pub(super) fn read(&mut self, lo: [u32; 3], hi: [u32; 3], out: &mut Vec<u8>) -> Result<(), Wrong> {
        let (lo, hi) = (lo.map(u64::from), hi.map(u64::from));
        let kind = self.dataset.kind;
        let count = [0, 1, 2].map(|a| hi[a] - lo[a]);
        let bytes = bytes_of(count, kind.bytes).and_then(|bytes| usize::try_from(bytes).ok());
        let reserved = bytes.map(|bytes| {
            out.clear();
            out.try_reserve_exact(bytes).map(|()| bytes)
        });
        let Some(Ok(bytes)) = reserved else {
            return Err(Wrong::broken("dataspace", "there is no memory for a box of it"));
        };
        match self.dataset.fill.iter().all(|byte| *byte == 0) {
            true => out.resize(bytes, 0),
            false => out.extend(self.dataset.fill.iter().cycle().take(bytes)),
        }
        if self.chunks.is_some() {
            self.read_chunks(lo, hi, out)?;
        } else {
            self.read_rows(lo, hi, out)?;
        }
        if kind.endian == Endian::Big {
            swap(out, kind.bytes);
        }
        if kind.is_half {
            *out = out.as_chunks::<2>().0.iter().flat_map(|h| single(u16::from_le_bytes(*h)).to_le_bytes()).collect();
        }
        Ok(())
    }

    /// Of an array of this shape, and where the volume's first number lies in it along the axes `at`.
    fn strides(&self, shape: &[u64], at: &[u64]) -> (Strides, u64) {
        let mut all = vec![1_u64; shape.len()];
        for axis in (1..shape.len()).rev() {
            all[axis - 1] = all[axis].saturating_mul(shape[axis]);
        }
        let first = at.iter().zip(&all).map(|(at, stride)| at * stride).sum();
        (self.dataset.axes.map(|axis| axis.map_or(0, |axis| all[axis])), first)
    }

    fn read_rows(&self, lo: [u64; 3], hi: [u64; 3], out: &mut [u8]) -> Result<(), Wrong> {
        let element = self.dataset.kind.bytes as u64;
        let ([sx, sy, sz], first) = self.strides(&self.dataset.shape, &self.dataset.at);
        let numbers = |at: u64, count: u64| -> Result<Cow<'_, [u8]>, Wrong> {
            match &self.dataset.stored {
                Stored::Here(data) => {
                    let part = data.get((at * element) as usize..((at + count) * element) as usize);
                    part.map(Cow::Borrowed).ok_or_else(|| Wrong::broken("layout", "too few numbers in the header"))
                }
                Stored::InARow(start) => self.bytes(start + at * element, count * element).map(Cow::Owned),
                Stored::Nowhere | Stored::Chunks { .. } => Ok(Cow::Borrowed(&[])),
            }
        };
        if matches!(self.dataset.stored, Stored::Nowhere) {
            return Ok(());
        }
        let width = hi[0] - lo[0];
        let is_whole = sx == 1 && width == u64::from(self.dims[0]) && sy == width;
        let rows = if is_whole { hi[1] - lo[1] } else { 1 };
        let run = width * rows;
        let starts = (lo[2]..hi[2]).flat_map(|z| (lo[1]..hi[1]).step_by(rows as usize).map(move |y| (y, z)));
        for ((y, z), out) in starts.zip(out.chunks_exact_mut((run * element) as usize)) {
            let start = first + z * sz + y * sy + lo[0] * sx;
            let at_once = (PIECE / (sx * element)).max(1);
            for (i, out) in out.chunks_mut((at_once * element) as usize).enumerate() {
                let count = out.len() as u64 / element;
                let from = start + i as u64 * at_once * sx;
                let data = numbers(from, (count - 1) * sx + 1)?;
                strided(&data, sx as usize, element as usize, out);
            }
        }
        Ok(())
    }

    /// Bytes of the file as they lie there.
    fn bytes(&self, start: u64, count: u64) -> Result<Vec<u8>, Wrong> {
        let storage = self.file.storage();
        let has = storage.len();
        if start.checked_add(count).is_none_or(|end| end > has) {
            return Err(Wrong::broken("chunk", format!("{count} bytes at byte {start}, and the file has {has}")));
        }
        let mut all = Vec::with_capacity(count as usize);
        for at in (0..count).step_by(PIECE as usize) {
            let piece = storage.read_range(start + at, PIECE.min(count - at) as usize);
            all.extend_from_slice(&piece.map_err(|e| Wrong::broken("chunk", e))?);
        }
        Ok(all)
    }

    fn load(&self, packed: Packed, chunk_bytes: u64, filters: &Filters) -> Result<Vec<u8>, Wrong> {
        if packed.bytes > chunk_bytes.saturating_mul(2).saturating_add(1 << 20) {
            return Err(Wrong::broken("chunk", format!("{} bytes are stored of one of {chunk_bytes}", packed.bytes)));
        }
        let stored = self.bytes(packed.address, packed.bytes)?;
        filters::decoded(stored, filters, packed.mask, self.dataset.kind.bytes, chunk_bytes as usize)
    }

    fn read_chunks(&mut self, lo: [u64; 3], hi: [u64; 3], out: &mut [u8]) -> Result<(), Wrong> {
        let size = self.chunk_size();
        let [xs, ys, zs] = [0, 1, 2].map(|a| lo[a] / size[a]..hi[a].div_ceil(size[a]));
        let Some((mut index, filters)) = self.chunks.take() else { return Ok(()) };
        let known = index.know(&self.file, zs.start, zs.end);
        let done = known.and_then(|()| {
            let places = zs.flat_map(|z| {
                let xs = xs.clone();
                ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
            });
            self.copy_chunks((&index, &filters), places, (lo, hi), out)
        });
        self.chunks = Some((index, filters));
        done
    }

    fn copy_chunks(
        &mut self,
        (index, filters): (&Index, &Filters),
        mut places: impl Iterator<Item = [u64; 3]>,
        (lo, hi): ([u64; 3], [u64; 3]),
        out: &mut [u8],
    ) -> Result<(), Wrong> {
        let size = self.size_in(index);
        let at_once = (AT_ONCE_BYTES / index.chunk_bytes).clamp(1, 1024) as usize;
        let shape: Vec<u64> = index.dims.iter().map(|n| u64::from(*n)).collect();
        let within: Vec<u64> = self.dataset.at.iter().zip(&shape).map(|(at, n)| at % n).collect();
        let (strides, first) = self.strides(&shape, &within);
        let mut before = std::mem::take(&mut self.kept);
        let (mut kept, mut kept_bytes) = (HashMap::new(), 0);
        loop {
            let batch: Vec<[u64; 3]> = places.by_ref().take(at_once).collect();
            if batch.is_empty() {
                break;
            }
            let batch = batch.into_iter().filter_map(|place| {
                let mut full: Place = index.fixed.iter().map(|at| at.unwrap_or(0)).collect();
                self.dataset.axes.iter().zip(place).for_each(|(axis, at)| {
                    if let Some(axis) = axis {
                        full[*axis] = at;
                    }
                });
                let old = before.remove(&full);
                index.get(&full).map(|packed| (place, full, packed, old))
            });
            let batch: Vec<_> = batch.collect();
            let load = |(place, full, packed, old): ([u64; 3], Place, Packed, Option<Vec<u8>>)| {
                let data = old.map_or_else(|| self.load(packed, index.chunk_bytes, filters), Ok)?;
                Ok((place, full, data))
            };
            let loaded: Result<Vec<_>, Wrong> = batch.into_par_iter().map(load).collect();
            for (place, full, data) in loaded? {
                let part = [0, 1, 2].map(|a| {
                    let start = place[a] * size[a];
                    start.max(lo[a])..(start + size[a]).min(hi[a])
                });
                let offset = [0, 1, 2].map(|a| place[a] * size[a]);
                self.copy((&data, strides, first), offset, &part, (lo, hi), out);
                if (place[2] + 1) * size[2] > hi[2] && kept_bytes + data.len() <= KEPT_BYTES {
                    kept_bytes += data.len();
                    kept.insert(full, data);
                }
            }
        }
        self.kept = kept;
        Ok(())
    }

    /// The part of a chunk, which begins at `offset`, that lies in the box.
    fn copy(
        &self,
        (data, [sx, sy, sz], first): (&[u8], Strides, u64),
        offset: [u64; 3],
        part: &[Range<u64>; 3],
        (lo, hi): ([u64; 3], [u64; 3]),
        out: &mut [u8],
    ) {
        let element = self.dataset.kind.bytes;
        let count = part[0].end - part[0].start;
        for z in part[2].clone() {
            for y in part[1].clone() {
                let to = part[0].start - lo[0] + (hi[0] - lo[0]) * (y - lo[1] + (hi[1] - lo[1]) * (z - lo[2]));
                let from = first + (part[0].start - offset[0]) * sx + (y - offset[1]) * sy + (z - offset[2]) * sz;
                let out = &mut out[to as usize * element..(to + count) as usize * element];
                strided(&data[from as usize * element..], sx as usize, element, out);
            }
        }
    }
}

/// Every `stride`th number of `data`.
fn strided(data: &[u8], stride: usize, element: usize, out: &mut [u8]) {
    if stride <= 1 {
        out.copy_from_slice(&data[..out.len()]);
        return;
    }
    for (number, out) in data.chunks(stride * element).zip(out.chunks_exact_mut(element)) {
        out.copy_from_slice(&number[..element]);
    }
}
