//! An image as an input volume: boxes of voxels, cut from the chunks that lie there.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use brickcast_volume::format::{Ahead, FormatError, RawHints, SourceHeader, VolumeSource};
use brickcast_volume::memory::available;
use brickcast_volume::store::Objects;
use bytes::Bytes;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::array::Array;
use crate::axes::Axes;
use crate::chunks::Chunks;
use crate::cut::{Cut, Place};
use crate::error::{OmeZarrError, failed};
use crate::image;
use crate::space::Space;

/// What is read in order comes in bands of rows, bytes.
const BAND_BYTES: u64 = 64 << 20;
/// Chunks are decoded at the same time up to so many bytes, but one at least.
const AT_ONCE_BYTES: usize = 256 << 20;
/// Decoded chunks that reach into the next planes are kept up to so many bytes, and a quarter of the memory that is
/// left.
const KEPT_BYTES: usize = 512 << 20;
/// Chunks behind a network are waited for, not computed: so many at a time.
const FAR_THREADS: usize = 32;

/// Memory: a band of 64 MiB where voxels are read in order; a chunk, or as many as are 256 MiB, being decoded; 512 MiB
/// of decoded chunks, or a quarter of what is left of the memory. A chunk has at most [`crate::MAX_CHUNK_BYTES`].
#[derive(Debug)]
pub struct OmeZarrSource {
    header: SourceHeader,
    files: Vec<PathBuf>,
    cut: Cut,
    /// Of chunks that are waited for; others are decoded by the threads that all share.
    pool: Option<ThreadPool>,
    /// The most bytes of chunks that are kept, and those that are.
    most_kept: usize,
    kept: HashMap<Place, Option<Bytes>>,
    has_found_any: bool,
    ahead: Ahead,
}

/// The chunks of the image, and what is said of its voxels.
pub(crate) fn found(objects: Arc<dyn Objects>, hints: &RawHints) -> Result<(Cut, SourceHeader), OmeZarrError> {
    let image = image::find(objects.as_ref())?;
    let array = Array::of(&image.node, &image.array)?;
    let axes = Axes::of(&image, &array, hints)?;
    let space = Space::of(&image, &array, &axes)?;
    let mut notes = [&image.notes[..], &axes.notes, &space.notes].concat();
    if !hints.is_empty() {
        notes.push("--dims, --type, --endian, --skip are for raw files; the image's own were used".into());
    }
    let header = SourceHeader {
        placement: space.placement,
        space_unit: space.unit,
        no_data: hints.no_data.into_iter().collect(),
        notes,
        ..SourceHeader::new(image.format(), space.geometry, array.voxel_type)
    };
    Ok((Cut { chunks: Chunks::new(objects, array), axes }, header))
}

pub(crate) fn open(objects: Arc<dyn Objects>, hints: &RawHints) -> Result<OmeZarrSource, OmeZarrError> {
    let (cut, header) = found(objects.clone(), hints)?;
    // What lies behind a network is no file; of a folder, all that is in it counts.
    let files = match objects.is_far() {
        true => Vec::new(),
        false => vec![objects.place().to_path_buf()],
    };
    let pool = objects.is_far().then(|| rayon::ThreadPoolBuilder::new().num_threads(FAR_THREADS).build());
    let no_threads = |reason| cut.array().json.problem(format!("no threads to read it: {reason}"));
    let pool = pool.transpose().map_err(no_threads)?;
    let left = available().map_or(u64::MAX, |limit| limit.bytes / 4);
    Ok(OmeZarrSource {
        header,
        files,
        cut,
        pool,
        most_kept: KEPT_BYTES.min(usize::try_from(left).unwrap_or(usize::MAX)),
        kept: HashMap::new(),
        has_found_any: false,
        ahead: Ahead::default(),
    })
}

impl OmeZarrSource {
    fn array(&self) -> &Array {
        self.cut.array()
    }

    /// Replaces `out` by a box of voxels `[lo, hi)`, x fastest.
    fn fill_box(&mut self, lo: [u32; 3], hi: [u32; 3], out: &mut Vec<u8>) -> Result<(), OmeZarrError> {
        self.cut.clear(lo, hi, out)?;
        let chunk = self.cut.chunk_size();
        let [xs, ys, zs] = self.cut.chunks_of(lo, hi);
        self.kept.retain(|[x, y, z], _| xs.contains(x) && ys.contains(y) && zs.contains(z));
        let (mut kept, mut kept_bytes) = (HashMap::new(), 0);
        let chunk_bytes = self.array().chunk_bytes();
        let at_once = (AT_ONCE_BYTES / chunk_bytes).clamp(1, 4096);
        let mut places = zs.flat_map(|z| {
            let xs = xs.clone();
            ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
        });
        loop {
            let batch: Vec<Place> = places.by_ref().take(at_once).collect();
            if batch.is_empty() {
                break;
            }
            let (cut, before) = (&self.cut, &self.kept);
            let load = |place: &Place| match before.get(place) {
                Some(kept) => Ok(kept.clone()),
                None => cut.chunks.load(&cut.chunk_at(place)),
            };
            let all = || batch.par_iter().map(load).collect::<Result<Vec<_>, OmeZarrError>>();
            let loaded = self.pool.as_ref().map_or_else(all, |pool| pool.install(all))?;
            for (place, data) in batch.into_iter().zip(loaded) {
                self.has_found_any |= data.is_some();
                self.cut.copy(place, data.as_deref(), (lo, hi), out);
                let held = data.as_ref().map_or(0, Bytes::len);
                if (place[2] + 1) * chunk[2] > u64::from(hi[2]) && kept_bytes + held <= self.most_kept {
                    kept_bytes += held;
                    kept.insert(place, data);
                }
            }
        }
        self.kept = kept;
        match hi == self.header.geometry.dims().to_array() && !self.has_found_any {
            true => Err(OmeZarrError::NoChunks {
                array: self.array().json.file.clone(),
                example: self.array().key(&vec![0; self.array().shape.len()]),
            }),
            false => Ok(()),
        }
    }

    fn read(&mut self, most: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let volume = (self.header.geometry, self.header.voxel_type);
        let bands = (Some(self.cut.chunk_size()), BAND_BYTES);
        let mut ahead = std::mem::take(&mut self.ahead);
        let read = ahead.read(volume, bands, most, out, |lo, hi, voxels| self.fill_box(lo, hi, voxels));
        self.ahead = ahead;
        read.map_err(|reason| self.failed(reason))
    }

    fn failed(&self, reason: OmeZarrError) -> FormatError {
        failed(self.cut.chunks.objects.as_ref(), reason)
    }
}

impl VolumeSource for OmeZarrSource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.ahead.go_to(0);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        self.read(u64::from(d.x) * u64::from(d.y) * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read((most / self.header.voxel_type.bytes()).max(1) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.ahead.go_to(voxel);
        Ok(true)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        self.fill_box(lo, hi, voxels).map(|()| true).map_err(|reason| self.failed(reason))
    }
}
