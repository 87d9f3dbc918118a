//! Voxels in order out of a source that has boxes: a band of them is read ahead.

use super::voxel_type::VoxelType;
use crate::space::Geometry;

/// Where a reader is, and the band that was read last.
#[derive(Debug, Default)]
pub struct Ahead {
    /// The voxel that comes next, x fastest.
    next: u64,
    /// The first voxel of the band, and bytes from it on.
    first: u64,
    band: Vec<u8>,
}

impl Ahead {
    /// Makes `voxel` the next one.
    pub fn go_to(&mut self, voxel: u64) {
        self.next = voxel;
    }

    /// Replaces `out` by the next voxels of the volume, at most `want` of them (fewer only at its end). `read` fills a
    /// buffer with those of a box `[lo, hi)`: whole planes, or rows of one, up to where the chunks around end, if that
    /// is within `band_bytes`.
    ///
    /// # Errors
    /// Those of `read`; what it left is given to nobody.
    pub fn read<E>(
        &mut self,
        (geometry, voxel_type): (Geometry, VoxelType),
        (chunk_size, band_bytes): (Option<[u64; 3]>, u64),
        want: u64,
        out: &mut Vec<u8>,
        mut read: impl FnMut([u32; 3], [u32; 3], &mut Vec<u8>) -> Result<(), E>,
    ) -> Result<(), E> {
        out.clear();
        let voxel = voxel_type.bytes() as u64;
        let d = geometry.dims().as_u64vec3();
        let end = geometry.voxel_count().min(self.next.saturating_add(want));
        while self.next < end {
            let there = self.first..self.first + self.band.len() as u64 / voxel;
            if !there.contains(&self.next) {
                let (lo, hi) = band_around(d.to_array(), voxel, self.next, chunk_size, band_bytes);
                if let Err(error) = read(lo, hi, &mut self.band) {
                    self.band.clear();
                    return Err(error);
                }
                self.first = d.x * (u64::from(lo[1]) + d.y * u64::from(lo[2]));
                let held = self.first..self.first + self.band.len() as u64 / voxel;
                if !held.contains(&self.next) {
                    // A reader that gives too little: whoever asked sees that voxels are missing.
                    return Ok(());
                }
                continue;
            }
            let stop = end.min(there.end);
            let [from, to] = [self.next, stop].map(|at| ((at - there.start) * voxel) as usize);
            out.extend_from_slice(&self.band[from..to]);
            self.next = stop;
        }
        Ok(())
    }
}

/// From the row of a voxel on.
fn band_around(
    dims: [u64; 3],
    voxel_bytes: u64,
    at: u64,
    chunk_size: Option<[u64; 3]>,
    band_bytes: u64,
) -> ([u32; 3], [u32; 3]) {
    let row = dims[0] * voxel_bytes;
    let plane = row * dims[1];
    let (y, z) = (at / dims[0] % dims[1], at / dims[0] / dims[1]);
    // To where chunks end, if that is not too far; of what is in none, as much as goes.
    let to_end = |at: u64, axis: usize, most: u64| {
        let most = most.max(1);
        let size = chunk_size.map_or(most, |size| size[axis]);
        ((at / size + 1) * size).min(at + most).min(dims[axis])
    };
    let (lo, hi) = match plane <= band_bytes {
        true => ([0, 0, z], [dims[0], dims[1], to_end(z, 2, band_bytes / plane)]),
        false => ([0, y, z], [dims[0], to_end(y, 1, band_bytes / row), z + 1]),
    };
    // No axis has more than 2^20 voxels.
    (lo.map(|n| n as u32), hi.map(|n| n as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_comes_once_whatever_the_bands() {
        let dims = [5, 4, 7];
        let geometry = Geometry::new(dims, [1.0; 3], [0.0; 3]).unwrap();
        let volume = (geometry, VoxelType::U16);
        let number = |x: u32, y: u32, z: u32| (((z * 4 + y) * 5 + x) as u16).to_le_bytes();
        let want: Vec<u8> = (0..140u16).flat_map(u16::to_le_bytes).collect();
        for (chunk, bytes) in
            [(Some([2, 3, 3]), 90), (Some([2, 3, 3]), 1000), (Some([9; 3]), 12), (None, 85), (None, 1)]
        {
            for step in [1, 7, 33, 140, 1000] {
                let (mut ahead, mut all, mut piece) = (Ahead::default(), Vec::new(), Vec::new());
                while all.len() < want.len() {
                    let read = |lo: [u32; 3], hi: [u32; 3], out: &mut Vec<u8>| {
                        out.clear();
                        for z in lo[2]..hi[2] {
                            (lo[1]..hi[1]).for_each(|y| out.extend((lo[0]..hi[0]).flat_map(|x| number(x, y, z))));
                        }
                        assert!(out.len() as u64 <= bytes.max(10), "{lo:?} to {hi:?} within {bytes}");
                        Ok::<(), ()>(())
                    };
                    ahead.read(volume, (chunk, bytes), step, &mut piece, read).unwrap();
                    assert!(!piece.is_empty(), "{chunk:?} {bytes} {step}: nothing after {} bytes", all.len());
                    all.append(&mut piece);
                }
                assert_eq!(all, want, "{chunk:?} {bytes} {step}");
                ahead.go_to(139);
                ahead.read(volume, (chunk, bytes), 9, &mut piece, |_, _, _| Err(())).unwrap();
                assert_eq!(piece, want[278..], "the last band is there");
                // What a read that failed has left is nobody's.
                ahead.go_to(0);
                let failed = ahead.read(volume, (chunk, bytes), 1, &mut piece, |_, _, out| {
                    out.splice(.., [1; 500]);
                    Err(())
                });
                assert!(failed.is_err() && piece.is_empty());
                let again = ahead.read(volume, (chunk, bytes), 1, &mut piece, |_, _, out| {
                    out.splice(.., [7, 0]);
                    Ok::<(), ()>(())
                });
                assert!(again.is_ok() && piece == [7, 0]);
            }
        }
    }
}
