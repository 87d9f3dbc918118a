//! A phantom as an input volume: its voxels are made when they are asked for.
//!
//! A voxel is the same however it is asked for: in a row from its start, from the middle of it, in a box, by any number
//! of threads. So a store that is made of this is the store of the file.

use rayon::prelude::*;

use super::grey::Grey;
use super::part::Part;
use super::pores::Pore;
use crate::format::{FormatError, Placement, SourceHeader, VolumeSource, VoxelType};
use crate::space::Geometry;

/// Of spacing and origin.
pub(super) const UNIT: &str = "mm";
/// Bytes of a voxel.
const BYTES: usize = 2;

/// Seekable by computing; there is no file.
#[derive(Debug)]
pub struct PhantomSource<'a> {
    header: SourceHeader,
    grey: Grey<'a>,
    /// The voxel that comes next, x fastest.
    next: u64,
}

impl<'a> PhantomSource<'a> {
    /// `noise`: standard deviation in material, percent of its grey value.
    pub(super) fn new(geometry: Geometry, part: Part, pores: &'a [Pore], (seed, noise): (u64, f64)) -> Self {
        // As the header of the file says it.
        let header = SourceHeader {
            placement: Placement { spacing: true, origin: true, directions: true },
            space_unit: Some(UNIT.to_owned()),
            ..SourceHeader::new("phantom", geometry, VoxelType::U16)
        };
        Self { header, grey: Grey::new(part, pores, seed, noise), next: 0 }
    }

    fn voxels(&self) -> u64 {
        self.header.geometry.voxel_count()
    }

    /// Makes `out` as large as the voxels of `planes` planes need.
    fn resize(&self, out: &mut Vec<u8>, voxels: u64, planes: u32) -> Result<(), FormatError> {
        let bytes = voxels.saturating_mul(BYTES as u64);
        let wanted = usize::try_from(bytes).unwrap_or(usize::MAX);
        out.try_reserve_exact(wanted.saturating_sub(out.len())).map_err(|_| FormatError::Memory {
            path: "the phantom".into(),
            bytes,
            planes,
            dims: self.header.geometry.dims().to_array(),
        })?;
        out.resize(wanted, 0);
        Ok(())
    }

    /// Fills part of a row, from `x` on.
    fn fill(&self, [x, y, z]: [u32; 3], row: &mut Vec<u16>, out: &mut [u8]) {
        row.resize(out.len() / BYTES, 0);
        self.grey.fill_row([x, y, z], row);
        let (voxels, _) = out.as_chunks_mut::<BYTES>();
        voxels.iter_mut().zip(row).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
    }

    /// Fills `out` with the voxels from `first` on, x fastest.
    fn fill_from(&self, first: u64, out: &mut [u8]) {
        let d = self.header.geometry.dims();
        let (nx, ny) = (u64::from(d.x), u64::from(d.y));
        let row_at = |row: u64| ((row % ny) as u32, (row / ny) as u32);
        let (row, x) = (first / nx, first % nx);
        let (head, rows) = out.split_at_mut(out.len().min((nx - x) as usize * BYTES));
        let (y, z) = row_at(row);
        self.fill([x as u32, y, z], &mut Vec::new(), head);
        rows.par_chunks_mut(d.x as usize * BYTES).enumerate().for_each_init(Vec::new, |made, (i, out)| {
            let (y, z) = row_at(row + 1 + i as u64);
            self.fill([0, y, z], made, out);
        });
    }
}

impl VolumeSource for PhantomSource<'_> {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        let d = self.header.geometry.dims();
        let plane = u64::from(d.x) * u64::from(d.y);
        let voxels = (plane * u64::from(count)).min(self.voxels() - self.next);
        self.resize(planes, voxels, count)?;
        self.fill_from(self.next, planes);
        self.next += voxels;
        Ok(())
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let voxels = (most / BYTES).max(1) as u64;
        let voxels = voxels.min(self.voxels() - self.next);
        self.resize(piece, voxels, 1)?;
        self.fill_from(self.next, piece);
        self.next += voxels;
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.next = voxel.min(self.voxels());
        Ok(true)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        let d = self.header.geometry.dims().to_array();
        let hi: [u32; 3] = std::array::from_fn(|a| hi[a].min(d[a]));
        let [width, height, depth] = std::array::from_fn(|a| hi[a].saturating_sub(lo[a]));
        self.resize(voxels, u64::from(width) * u64::from(height) * u64::from(depth), depth)?;
        let rows = voxels.par_chunks_mut((width as usize * BYTES).max(BYTES)).enumerate();
        rows.for_each_init(Vec::new, |made, (i, out)| {
            let (y, z) = (lo[1] + i as u32 % height, lo[2] + i as u32 / height);
            self.fill([lo[0], y, z], made, out);
        });
        Ok(true)
    }
}
