//! A stored box being filled from decoded inner chunks, of any of a store's arrays.

use glam::{IVec3, UVec3};

use crate::brick::StoredBox;
use crate::store::halo::shell::Shell;
use crate::store::profile::{CHUNK_EDGE, InnerChunk};

/// Elements of an inner chunk as stored, from `first` on, into a row; no bytes where all are the fill value 0.
pub(crate) trait RowDecoder<T> {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [T]);
}

/// Voxels to stretched codes: the code of every bit pattern of the stored type, 256 or 65,536 of them.
pub(crate) struct ToCodes<'a>(pub(crate) &'a [u16]);

impl RowDecoder<u16> for ToCodes<'_> {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [u16]) {
        let codes = self.0;
        match bytes {
            None => out.fill(codes[0]),
            Some(bytes) if codes.len() == 256 => {
                let bits = &bytes[first..][..out.len()];
                out.iter_mut().zip(bits).for_each(|(code, b)| *code = codes[usize::from(*b)]);
            }
            Some(bytes) => {
                let bits = bytes[2 * first..][..2 * out.len()].as_chunks::<2>().0;
                out.iter_mut().zip(bits).for_each(|(code, b)| *code = codes[usize::from(u16::from_le_bytes(*b))]);
            }
        }
    }
}

/// Labels as they are.
pub(crate) struct ToLabels;

impl RowDecoder<u32> for ToLabels {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [u32]) {
        match bytes {
            None => out.fill(0),
            Some(bytes) => {
                let labels = bytes[4 * first..][..4 * out.len()].as_chunks::<4>().0;
                out.iter_mut().zip(labels).for_each(|(label, b)| *label = u32::from_le_bytes(*b));
            }
        }
    }
}

/// Distances as they are.
pub(crate) struct ToDistances;

impl RowDecoder<u8> for ToDistances {
    fn row(&self, bytes: Option<&[u8]>, first: usize, out: &mut [u8]) {
        match bytes {
            None => out.fill(0),
            Some(bytes) => out.copy_from_slice(&bytes[first..][..out.len()]),
        }
    }
}

pub(crate) struct Window<T> {
    stored: StoredBox,
    /// Size of the stored box.
    dims: [usize; 3],
    /// The part of the stored box inside the volume, half-open.
    lo: UVec3,
    hi: UVec3,
    elements: Vec<T>,
}

impl<T: Copy + Default> Window<T> {
    pub(crate) fn new(stored: StoredBox, volume_dims: UVec3) -> Self {
        let lo = stored.lo.max(IVec3::ZERO).as_uvec3();
        let hi = stored.hi.min(volume_dims.as_ivec3()).as_uvec3();
        let dims = stored.dims().to_array().map(|n| n as usize);
        Self { stored, dims, lo, hi, elements: vec![T::default(); dims.iter().product()] }
    }

    /// First and last inner chunk that the window meets.
    pub(crate) fn chunks(&self) -> (UVec3, UVec3) {
        (self.lo / CHUNK_EDGE, (self.hi - 1) / CHUNK_EDGE)
    }

    /// Copies the elements of an inner chunk that are inside, row by row.
    pub(crate) fn fill(&mut self, chunk: InnerChunk, bytes: Option<&[u8]>, decoder: &impl RowDecoder<T>) {
        let origin = chunk.lo();
        let (lo, hi) = (self.lo.max(origin), self.hi.min(origin + CHUNK_EDGE));
        let from = (lo - origin).to_array().map(|v| v as usize);
        let to = (lo.as_ivec3() - self.stored.lo).to_array().map(|v| v as usize);
        let [width, height, depth] = (hi - lo).to_array().map(|v| v as usize);
        let edge = CHUNK_EDGE as usize;
        for z in 0..depth {
            for y in 0..height {
                let start = ((to[2] + z) * self.dims[1] + to[1] + y) * self.dims[0] + to[0];
                let first = ((from[2] + z) * edge + from[1] + y) * edge + from[0];
                decoder.row(bytes, first, &mut self.elements[start..][..width]);
            }
        }
    }

    /// Copies the voxels of a shell that are inside: `row` gives those from a position of the shell on.
    pub(crate) fn fill_shell(&mut self, shell: Shell, mut row: impl FnMut(usize, &mut [T])) {
        let mut first = 0;
        for z in shell.planes() {
            for (y, xs) in shell.runs(z) {
                let cut = xs.start.max(self.lo.x)..xs.end.min(self.hi.x);
                let inside = (self.lo.z..self.hi.z).contains(&z) && (self.lo.y..self.hi.y).contains(&y);
                if inside && !cut.is_empty() {
                    let [x, y, z] = (IVec3::new(cut.start as i32, y as i32, z as i32) - self.stored.lo).to_array();
                    let start = (z as usize * self.dims[1] + y as usize) * self.dims[0] + x as usize;
                    row(first + (cut.start - xs.start) as usize, &mut self.elements[start..][..cut.len()]);
                }
                first += xs.len();
            }
        }
    }

    /// Beyond the volume every voxel is the nearest one inside: along x, then whole rows, then whole planes.
    pub(crate) fn clamped_to_edge(mut self) -> Vec<T> {
        let inside = |a: usize| {
            let lo = (self.lo[a] as i32 - self.stored.lo[a]) as usize;
            lo..(self.hi[a] as i32 - self.stored.lo[a]) as usize
        };
        let (xs, ys, zs) = (inside(0), inside(1), inside(2));
        let [width, height, depth] = self.dims;
        for z in zs.clone() {
            for y in ys.clone() {
                let row = &mut self.elements[(z * height + y) * width..][..width];
                let (first, last) = (row[xs.start], row[xs.end - 1]);
                row[..xs.start].fill(first);
                row[xs.end..].fill(last);
            }
            let plane = &mut self.elements[z * height * width..][..height * width];
            for y in (0..height).filter(|y| !ys.contains(y)) {
                let from = y.clamp(ys.start, ys.end - 1) * width;
                plane.copy_within(from..from + width, y * width);
            }
        }
        let plane = height * width;
        for z in (0..depth).filter(|z| !zs.contains(z)) {
            let from = z.clamp(zs.start, zs.end - 1) * plane;
            self.elements.copy_within(from..from + plane, z * plane);
        }
        self.elements
    }
}
