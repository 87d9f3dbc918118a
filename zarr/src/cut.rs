//! Boxes of voxels, cut from chunks.

use std::ops::Range;

use crate::array::Array;
use crate::axes::Axes;
use crate::chunks::Chunks;
use crate::error::OmeZarrError;

/// A place in the grid of chunks along x, y, z.
pub(crate) type Place = [u64; 3];

/// The chunks of an image, and how the volume lies in them.
#[derive(Debug)]
pub(crate) struct Cut {
    pub(crate) chunks: Chunks,
    pub(crate) axes: Axes,
}

impl Cut {
    pub(crate) fn array(&self) -> &Array {
        &self.chunks.array
    }

    /// Voxels of a chunk along x, y, z.
    pub(crate) fn chunk_size(&self) -> [u64; 3] {
        self.axes.space.map(|axis| axis.map_or(1, |axis| self.array().chunk[axis]))
    }

    /// Which chunks have voxels of the box `[lo, hi)`, along x, y, z.
    pub(crate) fn chunks_of(&self, lo: [u32; 3], hi: [u32; 3]) -> [Range<u64>; 3] {
        let chunk = self.chunk_size();
        std::array::from_fn(|a| u64::from(lo[a]) / chunk[a]..u64::from(hi[a]).div_ceil(chunk[a]))
    }

    /// Makes `out` a box `[lo, hi)` of zeros.
    pub(crate) fn clear(&self, lo: [u32; 3], hi: [u32; 3], out: &mut Vec<u8>) -> Result<(), OmeZarrError> {
        let voxel = self.array().voxel_type.bytes();
        let size: [usize; 3] = std::array::from_fn(|a| (hi[a] - lo[a]) as usize);
        let bytes = size.iter().try_fold(voxel, |bytes, n| bytes.checked_mul(*n)).unwrap_or(usize::MAX);
        out.clear();
        out.try_reserve_exact(bytes).map_err(|_| OmeZarrError::Memory { bytes: bytes as u64 })?;
        out.resize(bytes, 0);
        Ok(())
    }

    /// Where a chunk lies along every axis of the array.
    pub(crate) fn chunk_at(&self, place: &Place) -> Vec<u64> {
        let mut at: Vec<u64> = self.axes.at.iter().zip(&self.array().chunk).map(|(at, chunk)| at / chunk).collect();
        for (axis, place) in self.axes.space.iter().zip(place) {
            if let Some(axis) = axis {
                at[*axis] = *place;
            }
        }
        at
    }

    /// Copies what a chunk has of a box; a chunk that is not there has its fill value.
    pub(crate) fn copy(&self, place: Place, data: Option<&[u8]>, (lo, hi): ([u32; 3], [u32; 3]), out: &mut [u8]) {
        let array = self.array();
        let (voxel, chunk) = (array.voxel_type.bytes(), self.chunk_size());
        let own: [Range<u64>; 3] = std::array::from_fn(|a| {
            let start = place[a] * chunk[a];
            start.max(u64::from(lo[a]))..(start + chunk[a]).min(u64::from(hi[a]))
        });
        let stride = self.axes.space.map(|axis| axis.map_or(0, |axis| array.strides[axis]));
        // Where the volume lies within a chunk along the other axes.
        let others = self.axes.at.iter().zip(&array.chunk).zip(&array.strides);
        let base: usize = others.map(|((at, chunk), stride)| (at % chunk) as usize * stride).sum();
        let within = |a: usize, at: u64| (at - place[a] * chunk[a]) as usize * stride[a];
        let width = (hi[0] - lo[0]) as usize;
        let height = (hi[1] - lo[1]) as usize;
        let run = (own[0].end - own[0].start) as usize;
        for z in own[2].clone() {
            for y in own[1].clone() {
                let row = ((z - u64::from(lo[2])) as usize * height + (y - u64::from(lo[1])) as usize) * width;
                let start = row + (own[0].start - u64::from(lo[0])) as usize;
                let out = &mut out[start * voxel..][..run * voxel];
                let Some(data) = data else {
                    out.chunks_exact_mut(voxel).for_each(|out| out.copy_from_slice(&array.fill));
                    continue;
                };
                let first = base + within(0, own[0].start) + within(1, y) + within(2, z);
                let data = &data[first * voxel..];
                match stride[0] {
                    1 => out.copy_from_slice(&data[..run * voxel]),
                    stride => {
                        let voxels = data.chunks(voxel).step_by(stride);
                        out.chunks_exact_mut(voxel).zip(voxels).for_each(|(out, voxel)| out.copy_from_slice(voxel));
                    }
                }
                if array.is_big_endian {
                    out.chunks_exact_mut(voxel).for_each(<[u8]>::reverse);
                }
            }
        }
    }
}
