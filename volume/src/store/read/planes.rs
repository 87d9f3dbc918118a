//! Whole rows of a volume that was written, x fastest, from all of its inner chunks at once: later passes over an input
//! read its store, and a store is written out as a file.

use std::ops::Range;

use glam::UVec3;
use rayon::prelude::*;

use super::window::{RowDecoder, ToCodes};
use crate::store::error::StoreError;
use crate::store::profile::{CHUNK_EDGE, InnerChunk};
use crate::store::shard::read::Shards;

/// The rows of one of a level's arrays.
pub(crate) struct Rows<'a> {
    pub(crate) shards: &'a Shards,
    pub(crate) volume_dims: UVec3,
}

impl Rows<'_> {
    /// Replaces `out` by the rows `ys` of each of the planes `zs`. Memory beside them: for each thread the inner chunks
    /// of a row as they lie in their shards, and a decoded one.
    pub(crate) fn read<T: Copy + Default + Send>(
        &self,
        (ys, zs): (Range<u32>, Range<u32>),
        decoder: &(impl RowDecoder<T> + Sync),
        out: &mut Vec<T>,
    ) -> Result<(), StoreError> {
        let (nx, edge) = (self.volume_dims.x as usize, CHUNK_EDGE as usize);
        let plane = nx * ys.len();
        out.resize(plane * zs.len(), T::default());
        let first_y = ys.start / CHUNK_EDGE;
        for cz in zs.start / CHUNK_EDGE..zs.end.div_ceil(CHUNK_EDGE) {
            let (first, last) = ((cz * CHUNK_EDGE).max(zs.start), ((cz + 1) * CHUNK_EDGE).min(zs.end));
            // Rows of inner chunks share no voxels: each gets its rows of every plane.
            let mut rows_of_chunks: Vec<(Range<u32>, Vec<&mut [T]>)> = (first_y..ys.end.div_ceil(CHUNK_EDGE))
                .map(|cy| ((cy * CHUNK_EDGE).max(ys.start)..((cy + 1) * CHUNK_EDGE).min(ys.end), Vec::new()))
                .collect();
            let planes = &mut out[(first - zs.start) as usize * plane..(last - zs.start) as usize * plane];
            for mut plane in planes.chunks_exact_mut(plane) {
                for (rows, parts) in &mut rows_of_chunks {
                    let (part, behind) = plane.split_at_mut(rows.len() * nx);
                    parts.push(part);
                    plane = behind;
                }
            }
            rows_of_chunks.into_par_iter().try_for_each(|(rows, mut planes)| {
                let (cy, cx) = (rows.start / CHUNK_EDGE, self.volume_dims.x.div_ceil(CHUNK_EDGE));
                let chunks: Vec<InnerChunk> = (0..cx).map(|x| InnerChunk([x, cy, cz])).collect();
                for (x, bytes) in (0..nx).step_by(edge).zip(self.shards.read_chunks(&chunks)?) {
                    let (bytes, width) = (bytes?, edge.min(nx - x));
                    for (z, plane) in ((first % CHUNK_EDGE) as usize..).zip(&mut planes) {
                        let ys = (rows.start % CHUNK_EDGE) as usize..;
                        for (y, row) in ys.zip(plane.chunks_exact_mut(nx)) {
                            let voxel = (z * edge + y) * edge;
                            decoder.row(bytes.as_deref(), voxel, &mut row[x..x + width]);
                        }
                    }
                }
                Ok::<(), StoreError>(())
            })?;
        }
        Ok(())
    }
}

/// Whole planes as stretched codes.
pub(crate) struct CodePlanes<'a> {
    pub(crate) shards: &'a Shards,
    pub(crate) volume_dims: UVec3,
    /// See [`ToCodes`].
    pub(crate) code_of_bits: &'a [u16],
}

impl CodePlanes<'_> {
    /// Voxels of a plane.
    pub(crate) fn plane(&self) -> usize {
        self.volume_dims.x as usize * self.volume_dims.y as usize
    }

    /// Replaces `codes` by those of the planes `z0..z1`, x fastest.
    pub(crate) fn read(&self, z0: u32, z1: u32, codes: &mut Vec<u16>) -> Result<(), StoreError> {
        let rows = Rows { shards: self.shards, volume_dims: self.volume_dims };
        rows.read((0..self.volume_dims.y, z0..z1), &ToCodes(self.code_of_bits), codes)
    }
}
