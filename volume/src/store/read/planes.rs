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

    /// Replaces `codes` by those of the planes `z0..z1`, x fastest. Memory beside them: for each thread the inner
    /// chunks of a row as they lie in their shards, and a decoded one.
    pub(crate) fn read(&self, z0: u32, z1: u32, codes: &mut Vec<u16>) -> Result<(), StoreError> {
        let (plane, edge) = (self.plane(), CHUNK_EDGE as usize);
        let nx = self.volume_dims.x as usize;
        let [cx, cy] = [self.volume_dims.x, self.volume_dims.y].map(|n| n.div_ceil(CHUNK_EDGE));
        codes.resize(plane * (z1 - z0) as usize, 0);
        for cz in z0 / CHUNK_EDGE..z1.div_ceil(CHUNK_EDGE) {
            let (first, last) = ((cz * CHUNK_EDGE).max(z0), ((cz + 1) * CHUNK_EDGE).min(z1));
            let within = (first - cz * CHUNK_EDGE) as usize;
            // Rows of inner chunks share no voxels: each gets its rows of every plane.
            let mut rows_of_chunks: Vec<Vec<&mut [u16]>> = (0..cy).map(|_| Vec::new()).collect();
            let planes = &mut codes[(first - z0) as usize * plane..(last - z0) as usize * plane];
            for plane in planes.chunks_exact_mut(plane) {
                plane.chunks_mut(edge * nx).zip(&mut rows_of_chunks).for_each(|(part, rows)| rows.push(part));
            }
            rows_of_chunks.into_par_iter().zip(0..cy).try_for_each(|(mut planes, y)| {
                let chunks: Vec<InnerChunk> = (0..cx).map(|x| InnerChunk([x, y, cz])).collect();
                for (x, bytes) in (0..nx).step_by(edge).zip(self.shards.read_chunks(&chunks)?) {
                    let (bytes, width) = (bytes?, edge.min(nx - x));
                    for (z, plane) in (within..).zip(&mut planes) {
                        for (y, row) in plane.chunks_exact_mut(nx).enumerate() {
                            let voxel = (z * edge + y) * edge;
                            ToCodes(self.code_of_bits).row(bytes.as_deref(), voxel, &mut row[x..x + width]);
                        }
                    }
                }
                Ok::<(), StoreError>(())
            })?;
        }
        Ok(())
    }
}
