//! The pass that finds value windows' components, from the last planes to the first: each inner chunk is decoded once
//! for labels, borders, leap voxels and components.
//!
//! Whether a voxel is a leap voxel is known two planes further down; a slab waits for the next one's first two. Of
//! distances the pass leaves what planes above each know: whoever goes up from the first plane knows the rest.

use rayon::prelude::*;

use super::near::NearPlanes;
use super::scratch::Scratch;
use super::segment::{Finder, Segmenter, SlabRecord, check_count};
use crate::regions::block::{CodeTables, Part, Slab};
use crate::regions::components::Components;
use crate::regions::distance::{FlatPlanes, LeapPlanes, PlaneSweep};
use crate::store::error::StoreError;
use crate::store::no_data::clear_holes;
use crate::store::progress::Phase;

/// Codes whose windows are told without a look at other threads.
const PART: usize = 1 << 14;

/// A slab's codes, and as much of its leap voxels as is known: not 0 where there is one.
#[derive(Default)]
struct Planes {
    z0: u32,
    codes: Vec<u16>,
    leaps: Vec<u8>,
}

/// What the pass has found so far.
struct Descent<'a> {
    dims: [usize; 3],
    tables: &'a CodeTables,
    has_holes: bool,
    flat: FlatPlanes<u16>,
    leaps: LeapPlanes,
    sweep: PlaneSweep,
    /// Work space: the windows and the bounds of a plane.
    windows: Vec<u16>,
    bounds: Vec<u8>,
    near: Scratch,
    components: Components,
    records: Scratch,
    slabs: Vec<SlabRecord>,
    offset: u64,
}

impl Segmenter<'_> {
    /// Finds components of the windows of `tables`: distances, those that are kept, and how to find them again.
    pub(super) fn descend(
        &mut self,
        tables: &CodeTables,
        min_region: u64,
    ) -> Result<(NearPlanes, Vec<Part>, Finder), StoreError> {
        let (dims, plane) = (self.dims(), self.voxels.plane());
        let mut descent = Descent {
            dims,
            tables,
            has_holes: self.has_holes,
            flat: FlatPlanes::new(dims[0]),
            leaps: LeapPlanes::new(dims[0]),
            sweep: PlaneSweep::new(dims[0]),
            windows: Vec::new(),
            bounds: Vec::new(),
            near: Scratch::create(self.scratch, "distances")?,
            components: Components::new(dims, min_region),
            records: Scratch::create(self.scratch, "records")?,
            slabs: Vec::new(),
            offset: 0,
        };
        let slabs: Vec<_> = self.slabs().collect();
        let mut slabs = slabs.into_iter().rev().peekable();
        let (mut waiting, mut here, mut next) = (Planes::default(), Planes::default(), Planes::default());
        if let Some((z0, z1)) = slabs.peek() {
            self.voxels.read(*z0, *z1, &mut next.codes)?;
        }
        while let Some((z0, z1)) = slabs.next() {
            // The buffers of the one that has left wait for the next.
            std::mem::swap(&mut waiting, &mut here);
            std::mem::swap(&mut here, &mut next);
            here.z0 = z0;
            here.leaps.resize(here.codes.len(), 0);
            self.report(Phase::Regions, self.depth() - z1);
            let voxels = &self.voxels;
            // Components are joined by one thread: meanwhile the next slab is read.
            let (read, found) = rayon::join(
                || slabs.peek().map_or(Ok(()), |(z0, z1)| voxels.read(*z0, *z1, &mut next.codes)),
                || (z0..z1).rev().try_for_each(|z| descent.push(z, &mut here, &mut waiting)),
            );
            found.and(read)?;
        }
        descent.finish(&mut here)?;
        let Descent { near, components, records, mut slabs, .. } = descent;
        slabs.reverse();
        let near = NearPlanes::from_above(near, plane, dims[0]);
        Ok((near, components.finish(), Finder::Records { file: records, slabs }))
    }
}

impl Descent<'_> {
    /// Goes on with the plane `z` of the slab `here`; the slab above has its components found as soon as it can.
    fn push(&mut self, z: u32, here: &mut Planes, above: &mut Planes) -> Result<(), StoreError> {
        let plane = self.dims[0] * self.dims[1];
        let codes = &here.codes[(z - here.z0) as usize * plane..][..plane];
        self.windows.resize(plane, 0);
        let parts = self.windows.par_chunks_mut(PART).zip(codes.par_chunks(PART));
        parts.for_each(|(windows, codes)| self.tables.windows(codes, windows));
        let Some(flat) = self.flat.push(&self.windows) else { return Ok(()) };
        self.sweep.push_flat(flat, &mut self.bounds);
        self.near.write(u64::from(z + 1) * plane as u64, &self.bounds)?;
        let Some(leaps) = self.leaps.push(flat) else { return Ok(()) };
        let z = z + 2;
        let slab = if (z - here.z0) as usize * plane < here.codes.len() { here } else { above };
        slab.leaps[(z - slab.z0) as usize * plane..][..plane].copy_from_slice(leaps);
        if z == slab.z0 { self.complete(slab) } else { Ok(()) }
    }

    /// Once all planes were pushed: those of the first ones that wait, which are all of the slab `first`.
    fn finish(&mut self, first: &mut Planes) -> Result<(), StoreError> {
        let plane = self.dims[0] * self.dims[1];
        if let Some(flat) = self.flat.finish() {
            self.sweep.push_flat(flat, &mut self.bounds);
            self.near.write(0, &self.bounds)?;
            if let Some(leaps) = self.leaps.push(flat) {
                first.leaps[plane..2 * plane].copy_from_slice(leaps);
            }
            if let Some(leaps) = self.leaps.finish() {
                first.leaps[..plane].copy_from_slice(leaps);
            }
        }
        self.complete(first)
    }

    fn complete(&mut self, Planes { z0, codes, leaps }: &mut Planes) -> Result<(), StoreError> {
        if self.has_holes {
            // Nobody leaps in them, so no part of them is kept.
            clear_holes(codes, leaps);
        }
        let slab = Slab { dims: self.dims, z0: *z0 as usize, codes, distances: leaps };
        let record = self.components.add(&slab, self.tables);
        let bytes = bytemuck::cast_slice::<u32, u8>(&record.fates);
        self.records.write(self.offset, bytes)?;
        self.slabs.push(SlabRecord { offset: self.offset, fates: record.fates.len(), layout: record.layout });
        self.offset += bytes.len() as u64;
        Ok(check_count(self.components.kept())?)
    }
}
