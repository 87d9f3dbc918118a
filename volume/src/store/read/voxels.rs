//! A store's voxels, or its labels, as an input: what was taken in is had out again.
//!
//! The invariant: *a voxel that the store holds exactly comes out with the number, in the type, that it came in with;
//! any other one with its value to within what the manifest says*.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::planes::Rows;
use super::store::Store;
use super::window::RowDecoder;
use crate::format::{Ahead, FactsBy, FormatError, Placement, Rescale, SaidBy, SourceHeader, VolumeSource, VoxelType};
use crate::store::error::StoreError;
use crate::store::manifest::Manifest;
use crate::store::profile::{CHUNK_EDGE, CHUNK_VOXELS};
use crate::store::regions::error::RegionsError;
use crate::store::shard::read::Shards;

/// Bytes of rows that are held, but a row at least.
const BAND_BYTES: u64 = 128 << 20;

/// What of a store is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredArray {
    Voxels,
    /// Regions as the store numbers them, 1, 2, ... in the order of their first voxels; 0 is none.
    Labels,
}

/// One level of a store, read in order or from anywhere.
#[derive(Debug)]
pub struct StoreSource {
    /// Of the level.
    store: Store,
    array: StoredArray,
    header: SourceHeader,
    out: Out,
    ahead: Ahead,
}

/// From the bits of a stored element to bytes.
#[derive(Debug)]
enum Out {
    /// The lowest bytes of what is stored.
    Same,
    /// Of each bit pattern.
    Four(Vec<[u8; 4]>),
    Eight(Vec<[u8; 8]>),
}

/// The first `N` bytes of elements of `stored` bytes each.
struct Lowest {
    stored: usize,
}

impl<const N: usize> RowDecoder<[u8; N]> for Lowest {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [[u8; N]]) {
        match bytes {
            None => out.fill([0; N]),
            Some(bytes) => {
                let elements = bytes[self.stored * first..].chunks_exact(self.stored);
                out.iter_mut().zip(elements).for_each(|(out, b)| out.copy_from_slice(&b[..N]));
            }
        }
    }
}

struct ByTable<'a, const N: usize>(&'a [[u8; N]]);

impl<const N: usize> RowDecoder<[u8; N]> for ByTable<'_, N> {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [[u8; N]]) {
        match bytes {
            None => out.fill(self.0[0]),
            Some(bytes) if self.0.len() == 256 => {
                out.iter_mut().zip(&bytes[first..]).for_each(|(out, b)| *out = self.0[usize::from(*b)]);
            }
            Some(bytes) => {
                let bits = bytes[2 * first..].as_chunks::<2>().0;
                out.iter_mut().zip(bits).for_each(|(out, b)| *out = self.0[usize::from(u16::from_le_bytes(*b))]);
            }
        }
    }
}

impl StoreSource {
    /// Of a level's array; level 0 is the store itself.
    ///
    /// # Errors
    /// No such level, a store without regions, voxels of a view that lie elsewhere.
    pub fn open(store: &Store, level: u8, array: StoredArray) -> Result<Self, StoreError> {
        let of_level = store.level(level).ok_or_else(|| StoreError::NoLevel { level, levels: store.level_count() })?;
        let (header, out) = match array {
            StoredArray::Voxels => of_voxels(of_level.manifest()),
            StoredArray::Labels => {
                let regions = of_level.manifest().regions.as_ref().ok_or(RegionsError::None)?;
                let voxel_type = match store.region_table().map_or(regions.count as usize, |table| table.0.len()) {
                    0..256 => VoxelType::U8,
                    256..65536 => VoxelType::U16,
                    _ => VoxelType::U32,
                };
                let notes =
                    vec!["regions as the store numbers them, 1, 2, ... by their first voxels; 0 is none".into()];
                (SourceHeader { notes, ..said_by(of_level.manifest(), voxel_type) }, Out::Same)
            }
        };
        let source = Self { store: of_level.clone(), array, header, out, ahead: Ahead::default() };
        source.shards()?;
        Ok(source)
    }

    fn shards(&self) -> Result<&Shards, StoreError> {
        match self.array {
            StoredArray::Voxels => Ok(self.store.shards()),
            StoredArray::Labels => Ok(&self.store.regions().ok_or(RegionsError::None)?.labels),
        }
    }

    /// Replaces `voxels` by those of whole rows.
    fn read_rows(&self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<(), StoreError> {
        let rows = Rows { shards: self.shards()?, volume_dims: self.header.geometry.dims() };
        let stored = rows.shards.chunk_bytes() / CHUNK_VOXELS;
        let (at, lowest) = ((lo[1]..hi[1], lo[2]..hi[2]), Lowest { stored });
        match (&self.out, self.header.voxel_type.bytes()) {
            (Out::Four(table), _) => read_as::<4>(&rows, at, &ByTable(table), voxels),
            (Out::Eight(table), _) => read_as::<8>(&rows, at, &ByTable(table), voxels),
            (Out::Same, 1) => read_as::<1>(&rows, at, &lowest, voxels),
            (Out::Same, 2) => read_as::<2>(&rows, at, &lowest, voxels),
            (Out::Same, _) => read_as::<4>(&rows, at, &lowest, voxels),
        }
    }

    fn read(&mut self, want: u64, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let mut ahead = std::mem::take(&mut self.ahead);
        let bands = (Some([u64::from(CHUNK_EDGE); 3]), BAND_BYTES);
        let read = ahead.read((self.header.geometry, self.header.voxel_type), bands, want, out, |lo, hi, voxels| {
            self.read_rows(lo, hi, voxels)
        });
        self.ahead = ahead;
        read.map_err(|error| of_store(&self.store.path(), error))
    }
}

fn read_as<const N: usize>(
    rows: &Rows<'_>,
    at: (Range<u32>, Range<u32>),
    decoder: &(impl RowDecoder<[u8; N]> + Sync),
    bytes: &mut Vec<u8>,
) -> Result<(), StoreError>
where
    [u8; N]: Default,
{
    let mut elements = Vec::new();
    rows.read(at, decoder, &mut elements)?;
    *bytes = elements.into_flattened();
    Ok(())
}

fn said_by(m: &Manifest, voxel_type: VoxelType) -> SourceHeader {
    SourceHeader {
        placement: Placement { spacing: true, origin: true, directions: true },
        facts_by: FactsBy::all(SaidBy::Store),
        space_unit: m.space_unit.clone(),
        ..SourceHeader::new("brick store", m.geometry, voxel_type)
    }
}

/// As which type voxels come out, and how.
fn of_voxels(m: &Manifest) -> (SourceHeader, Out) {
    let (source, missing) = (m.source.voxel_type, m.no_data.as_ref());
    if m.stored_type.voxel_type() == source
        && let Some(rescale) = Rescale::new(m.scale, m.offset)
    {
        let no_data = missing.map(|missing| f64::from(missing.stored)).into_iter().collect();
        return (SourceHeader { rescale, no_data, ..said_by(m, source) }, Out::Same);
    }
    // Whole numbers that were only shifted, unless the file has others for its values.
    let fill = missing.and_then(|missing| missing.fill.first().copied());
    let is_whole = |v: f64| v.fract() == 0.0 && v.abs() <= 9_007_199_254_740_992.0;
    let is_shifted = m.lossless && m.scale == 1.0 && is_whole(m.offset) && fill.is_none_or(is_whole);
    let reach = m.min.abs().max(m.max.abs());
    // A value of 32 bits errs by less than a quarter of what is between two stored ones.
    let fits_f32 = reach * f64::from(f32::EPSILON) * 0.5 <= m.scale.abs() * 0.25;
    let voxel_type = match source {
        VoxelType::U32 | VoxelType::I32 | VoxelType::U64 | VoxelType::I64 if is_shifted => source,
        VoxelType::F64 if is_shifted => source,
        _ if fits_f32 || (is_shifted && source == VoxelType::F32) => VoxelType::F32,
        _ => VoxelType::F64,
    };
    let is_float = matches!(voxel_type, VoxelType::F32 | VoxelType::F64);
    let missing_value = fill.filter(|_| !is_float).unwrap_or(f64::NAN);
    let values = (0..m.stored_type.values()).map(|bits| {
        let number = m.stored_type.ordinal_of_bits(bits as u16);
        let stored = i32::from(number) + m.stored_type.min();
        match missing {
            Some(missing) if missing.stored == stored => missing_value,
            _ => m.value_of_stored(stored),
        }
    });
    let out = match voxel_type {
        VoxelType::U32 => Out::Four(values.map(|v| (v as u32).to_le_bytes()).collect()),
        VoxelType::I32 => Out::Four(values.map(|v| (v as i32).to_le_bytes()).collect()),
        VoxelType::U64 => Out::Eight(values.map(|v| (v as u64).to_le_bytes()).collect()),
        VoxelType::I64 => Out::Eight(values.map(|v| (v as i64).to_le_bytes()).collect()),
        VoxelType::F64 => Out::Eight(values.map(f64::to_le_bytes).collect()),
        _ => Out::Four(values.map(|v| (v as f32).to_le_bytes()).collect()),
    };
    let mut notes = Vec::new();
    if !m.lossless {
        notes.push(format!(
            "values within {:e} of those that were taken in, which the store holds in 16 bits",
            m.scale * 0.5
        ));
    }
    let no_data = if is_float { None } else { missing.map(|_| missing_value) }.into_iter().collect();
    (SourceHeader { no_data, notes, ..said_by(m, voxel_type) }, out)
}

/// A store's errors name its files already.
fn of_store(place: &Path, error: StoreError) -> FormatError {
    match error {
        StoreError::Source(error) => error,
        error => FormatError::Header { path: place.into(), reason: Box::new(error) },
    }
}

impl VolumeSource for StoreSource {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &[]
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.ahead.go_to(0);
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims().as_u64vec3();
        self.read(d.x * d.y * u64::from(count), planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.read((most / self.header.voxel_type.bytes()).max(1) as u64, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.ahead.go_to(voxel);
        Ok(true)
    }
}
