//! Distances in a scratch file, a byte a voxel: all that there is to them, or what planes above each know.

use rayon::prelude::*;

use super::scratch::Scratch;
use crate::regions::distance::{PlaneSweep, spread};
use crate::store::error::StoreError;

pub(crate) struct NearPlanes {
    file: Scratch,
    /// Voxels of a plane.
    plane: usize,
    /// What planes below each know, where the file has only what those above do.
    sweep: Option<PlaneSweep>,
}

impl NearPlanes {
    /// Of distances.
    pub(crate) fn whole(file: Scratch, plane: usize) -> Self {
        Self { file, plane, sweep: None }
    }

    /// Of what a sweep from the last plane to the first has left, in rows of `width` voxels.
    pub(crate) fn from_above(file: Scratch, plane: usize, width: usize) -> Self {
        Self { file, plane, sweep: Some(PlaneSweep::new(width)) }
    }

    /// Starts over at the first plane.
    pub(crate) fn start_over(&mut self) {
        self.sweep.iter_mut().for_each(PlaneSweep::start_over);
    }

    /// Fills `near` with the distances of whole planes from `z0` on, which must be the next.
    pub(crate) fn read(&mut self, z0: u32, near: &mut [u8]) -> Result<(), StoreError> {
        self.file.read(u64::from(z0) * self.plane as u64, near)?;
        if let Some(sweep) = &mut self.sweep {
            near.chunks_exact_mut(self.plane).for_each(|plane| sweep.push(plane));
            let width = sweep.width();
            near.par_chunks_exact_mut(self.plane).for_each(|plane| spread(plane, width));
        }
        Ok(())
    }
}
