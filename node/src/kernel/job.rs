//! What a backend is asked to render, and what it answers.

use std::sync::Arc;

use brickcast_shaders::twin::bindings::RayCounts;
use brickcast_volume::lod::Sides;
use brickcast_volume::{PixelKind, PixelRect, Pixels, RawPixel};

use super::brick::ResidentBrick;
use super::error::RaycastError;
use super::scene::KernelScene;

/// One accumulator: bricks front to back, into the pixels of `rect`.
#[derive(Debug, Clone)]
pub struct Job {
    pub bricks: Vec<Arc<dyn ResidentBrick>>,
    /// Of each brick, where it meets other levels; of bricks beyond the last one: nowhere.
    pub sides: Vec<Sides>,
    /// Of each brick, by which of the call's scenes it is seen; of bricks beyond the last one: by the first.
    pub scenes: Vec<usize>,
    pub rect: PixelRect,
    /// What lies in front of them: the pixels of a job that ended there. None: nothing.
    pub front: Option<Pixels>,
}

impl Job {
    /// With nothing in front, of bricks of one scene that meet no other level.
    #[must_use]
    pub fn new(bricks: Vec<Arc<dyn ResidentBrick>>, rect: PixelRect) -> Self {
        Self { bricks, sides: Vec::new(), scenes: Vec::new(), rect, front: None }
    }

    pub(crate) fn sides_of(&self, position: usize) -> Sides {
        self.sides.get(position).copied().unwrap_or_default()
    }

    pub(crate) fn scene_of(&self, position: usize) -> usize {
        self.scenes.get(position).copied().unwrap_or_default()
    }

    /// The accumulator as it starts, in a scene of this kind of pixels.
    pub(crate) fn started(&self, kind: PixelKind) -> Result<Pixels, RaycastError> {
        match &self.front {
            Some(front) if front.kind() == kind && front.len() == self.rect.pixel_count() => Ok(front.clone()),
            Some(front) => Err(RaycastError::Front { got: front.len(), want: self.rect.pixel_count(), kind }),
            None => new_pixels(kind, &self.rect),
        }
    }
}

/// A finished accumulator.
#[derive(Debug, Clone)]
pub struct JobImage {
    pub rect: PixelRect,
    /// Row-major within `rect`, of the scene's kind.
    pub pixels: Pixels,
    /// What each brick of the job took, in the job's order.
    pub counts: Vec<BrickCounts>,
}

impl JobImage {
    /// Of all bricks.
    #[must_use]
    pub fn total(&self) -> BrickCounts {
        self.counts.iter().copied().fold(BrickCounts::default(), BrickCounts::plus)
    }
}

/// What the rays of a job did in one brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrickCounts {
    /// Reads of texels, probes and region flags included.
    pub samples: u64,
    /// Sample positions integrated; a leap counts all of its.
    pub positions: u64,
    /// Positions that leaps covered.
    pub leapt: u64,
    /// Jumps by macrocells alone: turns of a ray's loop that read no texel.
    pub skips: u64,
}

impl BrickCounts {
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            samples: self.samples.saturating_add(more.samples),
            positions: self.positions.saturating_add(more.positions),
            leapt: self.leapt.saturating_add(more.leapt),
            skips: self.skips.saturating_add(more.skips),
        }
    }
}

impl From<RayCounts> for BrickCounts {
    fn from(counts: RayCounts) -> Self {
        let RayCounts { samples, positions, leapt, skips } = counts;
        let [samples, positions, leapt, skips] = [samples, positions, leapt, skips].map(u64::from);
        Self { samples, positions, leapt, skips }
    }
}

/// What both backends demand of a call.
pub(crate) fn check_jobs(scene: &KernelScene, jobs: &[Job], max_entries: u32) -> Result<(), RaycastError> {
    for table in [Some(&scene.table), scene.region_table.as_ref()].into_iter().flatten() {
        let entries = table.entries.len();
        if entries < 2 || entries > max_entries as usize {
            return Err(RaycastError::TableSize { entries, max: max_entries });
        }
    }
    let size = scene.view.size();
    let full = size.full_rect();
    match jobs.iter().find(|job| !job.rect.is_empty() && job.rect.intersect(&full) != job.rect) {
        Some(job) => {
            let (width, height) = (size.width(), size.height());
            Err(RaycastError::RectOutsidePicture { rect: job.rect, width, height })
        }
        None => Ok(()),
    }
}

/// A cleared accumulator.
pub(crate) fn new_pixels(kind: PixelKind, rect: &PixelRect) -> Result<Pixels, RaycastError> {
    let count = rect.pixel_count();
    let mut pixels = Vec::new();
    if pixels.try_reserve_exact(count).is_err() {
        let bytes = (count * size_of::<RawPixel>()) as u64;
        return Err(RaycastError::OutOfMemory { what: "an accumulator", bytes });
    }
    pixels.resize(count, [0.0; 4]);
    Ok(Pixels::from_raw(kind, pixels))
}
