//! Regions of a volume that was just written: its distances, its regions, and the files that say so.
//!
//! Passes over the voxels, each in slabs of whole planes read back from the shards. Of value windows there are two:
//! from the last planes to the first, components and what planes above each know of distances ([`super::descent`]);
//! from the first to the last, distances, labels, and what is written. Given labels have distances swept forward, then
//! backward (scratch file only), are counted, and written. What one pass must tell the next lies in scratch files;
//! memory holds slabs, the nodes of their components, and the regions.

use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;

use super::error::RegionsError;
use super::label_planes::LabelPlanes;
use super::near::NearPlanes;
use super::scratch::Scratch;
use crate::format::Placement;
use crate::regions::block::{CodeTables, Part, Slab};
use crate::regions::components::{RecordLayout, SLAB_PLANES, resolve};
use crate::regions::distance::{FlatPlanes, PlaneSweep, spread};
use crate::regions::given::{GivenParts, TooManyParts};
use crate::regions::{MAX_FLOOD_VOXELS, MAX_REGIONS, NO_REGION, Windows, density_of_code, flood, window_width};
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::manifest::regions::SegmentationMethod;
use crate::store::no_data::{NO_DATA_CODE, clear_holes};
use crate::store::prepare::options::{RegionOptions, Segmentation};
use crate::store::progress::{Phase, Progress};
use crate::store::read::planes::CodePlanes;

/// The most labels of a label volume.
const MAX_GIVEN_LABELS: usize = 1 << 24;

/// Stands for the density of a voxel without data: further from all others than the widest window.
const HOLE: u16 = u16::MAX;

/// A volume whose voxels are written, and what is to be found in it.
pub(crate) struct Segmenter<'a> {
    pub(crate) options: &'a RegionOptions,
    pub(crate) geometry: Geometry,
    /// What of the geometry the volume's file says.
    pub(crate) placement: Placement,
    /// Where scratch files go.
    pub(crate) scratch: &'a Path,
    pub(crate) voxels: CodePlanes<'a>,
    /// Given labels of a coarser level, in place of those of the file that the options name.
    pub(crate) labels: Option<LabelPlanes>,
    /// Voxels of [`NO_DATA_CODE`] hold no data: they belong to no region.
    pub(crate) has_holes: bool,
    pub(crate) progress: &'a mut dyn FnMut(Progress),
}

/// Components or given labels with leap voxels, and what is needed to find them again voxel by voxel.
pub(crate) struct Found {
    pub(crate) kept: Vec<Part>,
    pub(crate) tables: CodeTables,
    pub(crate) distances: NearPlanes,
    pub(crate) finder: Finder,
}

/// How the kept part of a voxel is found.
pub(crate) enum Finder {
    /// Through the record of its slab; slabs from the first planes to the last, each of which has the answers for the
    /// next one.
    Records { file: Scratch, slabs: Vec<SlabRecord> },
    /// By its label.
    Given { planes: LabelPlanes, kept_of_label: HashMap<u32, usize> },
}

/// Where a slab's record lies in the scratch file.
pub(crate) struct SlabRecord {
    pub(crate) offset: u64,
    pub(crate) fates: usize,
    pub(crate) layout: RecordLayout,
}

impl Finder {
    /// The fates of all nodes of a slab, from the answers of the one below, which become its own; none before the
    /// first.
    pub(crate) fn read_fates(
        file: &mut Scratch,
        record: &SlabRecord,
        answers: &mut Vec<u32>,
    ) -> Result<Vec<u32>, StoreError> {
        let mut fates = vec![0; record.fates];
        file.read(record.offset, bytemuck::cast_slice_mut(&mut fates))?;
        resolve(&mut fates, answers);
        answers.clear();
        answers.extend_from_slice(&fates[..record.layout.carried]);
        Ok(fates)
    }
}

/// The method, and what may differ within a region, that options ask for.
pub(crate) fn checked(options: &RegionOptions) -> Result<(SegmentationMethod, Option<f64>), RegionsError> {
    let (method, range) = match options.segmentation {
        Segmentation::Windows { range } => (SegmentationMethod::Windows, Some(range)),
        Segmentation::Flood { range } => (SegmentationMethod::Flood, Some(range)),
        Segmentation::Labels { .. } => (SegmentationMethod::Labels, None),
    };
    match range {
        Some(w) if !(w > 0.0 && w <= 1.0) => Err(RegionsError::SegmentationRange(w)),
        _ => Ok((method, range)),
    }
}

/// Regions beyond what a manifest may speak of, before all of them are in memory.
pub(super) fn check_count(kept: usize) -> Result<(), RegionsError> {
    if kept > MAX_REGIONS as usize { Err(RegionsError::TooManyRegions) } else { Ok(()) }
}

impl Segmenter<'_> {
    pub(crate) fn depth(&self) -> u32 {
        self.geometry.dims().z
    }

    pub(crate) fn dims(&self) -> [usize; 3] {
        self.geometry.dims().to_array().map(|n| n as usize)
    }

    pub(crate) fn report(&mut self, phase: Phase, done: u32) {
        let total = self.depth().into();
        (self.progress)(Progress { phase, done: done.into(), total });
    }

    /// First and past-the-end plane of every slab.
    pub(crate) fn slabs(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let depth = self.depth();
        (0..depth).step_by(SLAB_PLANES as usize).map(move |z| (z, (z + SLAB_PLANES).min(depth)))
    }

    /// Finds all regions; `histogram` counts the voxels of each 14-bit density.
    pub(crate) fn find(&mut self, histogram: &[u64]) -> Result<Found, StoreError> {
        let density: Vec<_> = (0..=u16::MAX).map(density_of_code).collect();
        let min_region = self.options.min_region;
        let mut planes = match &self.options.segmentation {
            Segmentation::Windows { range } => {
                let windows = Windows::new(histogram, window_width(*range));
                let mut window = windows.of_codes();
                if self.has_holes {
                    // A label of their own, so that distances end at them.
                    window[usize::from(NO_DATA_CODE)] = windows.count();
                }
                let tables = CodeTables::new(window);
                let (distances, kept, finder) = self.descend(&tables, min_region)?;
                return Ok(Found { kept, tables, distances, finder });
            }
            Segmentation::Flood { range } => LabelPlanes::Memory(self.flood(*range, &density)?),
            Segmentation::Labels { path, hints, opener } => match self.labels.take() {
                Some(labels) => labels,
                None => LabelPlanes::open((path, hints, *opener), (&self.geometry, self.placement))?,
            },
        };
        let tables = CodeTables::new(Vec::new());
        let mut distances = self.given_distances(&mut planes)?;
        let (labels, kept) = self.given(&mut planes, &mut distances)?.finish(min_region);
        let kept_of_label = labels.into_iter().zip(0..).collect();
        Ok(Found { kept, tables, distances, finder: Finder::Given { planes, kept_of_label } })
    }

    fn given_distances(&mut self, planes: &mut LabelPlanes) -> Result<NearPlanes, StoreError> {
        let (mut labels, mut codes, plane) = (Vec::new(), Vec::new(), self.voxels.plane());
        let (mut flat_planes, mut sweep) = (FlatPlanes::new(self.dims()[0]), PlaneSweep::new(self.dims()[0]));
        let mut file = Scratch::create(self.scratch, "distances")?;
        let (mut bounds, mut offset) = (Vec::new(), 0);
        let mut put = |flat: &[u8]| {
            sweep.push_flat(flat, &mut bounds);
            let at = offset;
            offset += plane as u64;
            file.write(at, &bounds)
        };
        planes.rewind()?;
        for (z0, z1) in self.slabs() {
            self.report(Phase::Distances, z0 / 2);
            planes.read(z0, z1, plane, &mut labels)?;
            if self.has_holes {
                self.voxels.read(z0, z1, &mut codes)?;
                clear_holes(&codes, &mut labels);
            }
            labels.chunks_exact(plane).try_for_each(|labels| flat_planes.push(labels).map_or(Ok(()), &mut put))?;
        }
        flat_planes.finish().map_or(Ok(()), put)?;
        self.backward(file)
    }

    /// The backward sweep, in place, and what is left to do within planes.
    fn backward(&mut self, mut file: Scratch) -> Result<NearPlanes, StoreError> {
        let (plane, width) = (self.voxels.plane(), self.dims()[0]);
        let (mut sweep, mut near) = (PlaneSweep::new(width), Vec::new());
        let slabs: Vec<_> = self.slabs().collect();
        for (z0, z1) in slabs.into_iter().rev() {
            self.report(Phase::Distances, self.depth() - z0 / 2 - 1);
            near.resize(plane * (z1 - z0) as usize, 0);
            let offset = u64::from(z0) * plane as u64;
            file.read(offset, &mut near)?;
            near.chunks_exact_mut(plane).rev().for_each(|plane| sweep.push(plane));
            near.par_chunks_exact_mut(plane).for_each(|plane| spread(plane, width));
            file.write(offset, &near)?;
        }
        Ok(NearPlanes::whole(file, plane))
    }

    /// Calls `take` with every slab: its number, its planes, their codes and distances. Meanwhile the next slab's codes
    /// are read.
    pub(crate) fn each_slab(
        &mut self,
        phase: Phase,
        distances: &mut NearPlanes,
        mut take: impl FnMut(usize, (u32, u32), &[u16], &mut [u8]) -> Result<(), StoreError> + Send,
    ) -> Result<(), StoreError> {
        let (mut codes, mut next, mut near) = (Vec::new(), Vec::new(), Vec::new());
        let mut slabs = self.slabs().enumerate().peekable();
        distances.start_over();
        if let Some((_, (z0, z1))) = slabs.peek() {
            self.voxels.read(*z0, *z1, &mut codes)?;
        }
        while let Some((i, (z0, z1))) = slabs.next() {
            self.report(phase, z0);
            let (voxels, has_holes) = (&self.voxels, self.has_holes);
            let (read, taken) = rayon::join(
                || slabs.peek().map_or(Ok(()), |(_, (z0, z1))| voxels.read(*z0, *z1, &mut next)),
                || {
                    near.resize(codes.len(), 0);
                    distances.read(z0, &mut near)?;
                    if has_holes {
                        // Nobody leaps in them, so no part of them is kept.
                        clear_holes(&codes, &mut near);
                    }
                    take(i, (z0, z1), &codes, &mut near)
                },
            );
            taken.and(read)?;
            std::mem::swap(&mut codes, &mut next);
        }
        Ok(())
    }

    fn given(&mut self, planes: &mut LabelPlanes, distances: &mut NearPlanes) -> Result<GivenParts, StoreError> {
        let (mut parts, mut labels) = (GivenParts::new(MAX_GIVEN_LABELS), Vec::new());
        planes.rewind()?;
        let (dims, plane, has_holes) = (self.dims(), self.voxels.plane(), self.has_holes);
        self.each_slab(Phase::Regions, distances, |_, (z0, z1), codes, near| {
            planes.read(z0, z1, plane, &mut labels)?;
            if has_holes {
                clear_holes(codes, &mut labels);
            }
            let slab = Slab { dims, z0: z0 as usize, codes, distances: near };
            parts.add(&slab, &labels).map_err(|TooManyParts| planes.too_many(MAX_GIVEN_LABELS).into())
        })?;
        Ok(parts)
    }

    fn flood(&mut self, range: f64, density: &[u16]) -> Result<Vec<u32>, StoreError> {
        let voxels = self.geometry.voxel_count();
        if voxels > MAX_FLOOD_VOXELS {
            return Err(RegionsError::FloodTooLarge { voxels }.into());
        }
        let (mut all, mut codes) = (Vec::new(), Vec::new());
        let memory = |_| RegionsError::FloodMemory { voxels };
        all.try_reserve_exact(voxels as usize).map_err(memory)?;
        for (z0, z1) in self.slabs() {
            self.report(Phase::Flood, z0);
            self.voxels.read(z0, z1, &mut codes)?;
            let is_hole = |code: u16| self.has_holes && code == NO_DATA_CODE;
            all.extend(codes.iter().map(|c| if is_hole(*c) { HOLE } else { density[usize::from(*c)] }));
        }
        let mut labels = flood::flood(&all, self.dims(), window_width(range)).map_err(memory)?;
        labels.iter_mut().zip(&all).filter(|(_, d)| **d == HOLE).for_each(|(label, _)| *label = NO_REGION);
        Ok(labels)
    }
}

// Slabs are written as whole layers of inner chunks.
const _: () = assert!(SLAB_PLANES.is_multiple_of(crate::store::profile::CHUNK_EDGE));

#[cfg(test)]
mod tests {
    use super::*;

    /// No test makes so many regions; that the limit is the manifest's own is what counts.
    #[test]
    fn as_many_regions_as_a_manifest_may_speak_of_and_no_more() {
        assert_eq!(check_count(MAX_REGIONS as usize), Ok(()));
        assert_eq!(check_count(MAX_REGIONS as usize + 1), Err(RegionsError::TooManyRegions));
    }
}
