//! Whole planes of a volume that was just written, as stretched codes: later passes read the store, not the input
//! again.

use glam::UVec3;
use rayon::prelude::*;

use super::window::{RowDecoder, ToCodes};
use crate::store::error::StoreError;
use crate::store::profile::{CHUNK_EDGE, InnerChunk};
use crate::store::shard::read::Shards;

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

    /// Replaces `codes` by those of the planes `z0..z1`, x fastest. Memory beside them: one layer of decoded inner
    /// chunks.
    pub(crate) fn read(&self, z0: u32, z1: u32, codes: &mut Vec<u16>) -> Result<(), StoreError> {
        let (plane, edge) = (self.plane(), CHUNK_EDGE as usize);
        let nx = self.volume_dims.x as usize;
        let [cx, cy] = [self.volume_dims.x, self.volume_dims.y].map(|n| n.div_ceil(CHUNK_EDGE));
        codes.resize(plane * (z1 - z0) as usize, 0);
        for cz in z0 / CHUNK_EDGE..z1.div_ceil(CHUNK_EDGE) {
            let chunks: Vec<InnerChunk> = (0..cy).flat_map(|y| (0..cx).map(move |x| InnerChunk([x, y, cz]))).collect();
            let decoded: Vec<_> =
                chunks.par_iter().map(|c| self.shards.read_chunk(*c)).collect::<Result<_, StoreError>>()?;
            let (first, last) = ((cz * CHUNK_EDGE).max(z0), ((cz + 1) * CHUNK_EDGE).min(z1));
            let part = &mut codes[(first - z0) as usize * plane..(last - z0) as usize * plane];
            part.par_chunks_mut(plane).enumerate().for_each(|(i, out)| {
                let within = first as usize + i - cz as usize * edge;
                for (y, row) in out.chunks_exact_mut(nx).enumerate() {
                    let chunk_row = &decoded[y / edge * cx as usize..][..cx as usize];
                    for (part, bytes) in row.chunks_mut(edge).zip(chunk_row) {
                        let voxel = (within * edge + y % edge) * edge;
                        ToCodes(self.code_of_bits).row(bytes.as_deref(), voxel, part);
                    }
                }
            });
        }
        Ok(())
    }
}
