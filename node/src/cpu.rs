//! The raycaster on the processor: the kernel's CPU twin over screen tiles.

use std::any::Any;
use std::sync::Arc;

use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::twin::raycast::{Ray, pixel_ray, raycast_ray};
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::{PixelRect, Premul};
use glam::UVec2;
use rayon::prelude::*;

use crate::raycaster::{
    BackendInfo, Job, JobImage, KernelScene, RaycastError, Raycaster, ResidentBrick, check_brick, check_jobs,
    new_pixels,
};

/// Tile edge in pixels: small enough that threads stay busy to the end, large enough that a brick's voxels are reused.
const TILE: usize = 32;

/// Renders with rayon's global pool. Every pixel is computed alone, so pictures do not depend on the number of threads.
#[derive(Debug)]
pub struct CpuRaycaster {
    info: BackendInfo,
}

#[derive(Debug)]
struct CpuBrick {
    owned: OwnedBox,
    uniform: BrickUniform,
    codes: Vec<u16>,
}

impl ResidentBrick for CpuBrick {
    fn bytes(&self) -> u64 {
        (self.codes.len() * size_of::<u16>()) as u64
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// A screen tile: its rows borrow from the job's accumulator.
struct Tile<'a> {
    rect: PixelRect,
    rows: Vec<&'a mut [Premul]>,
}

impl CpuRaycaster {
    #[must_use]
    pub fn new() -> Self {
        let threads = rayon::current_num_threads() as u32;
        let adapter = format!("CPU ({}), {threads} threads", std::env::consts::ARCH);
        Self { info: BackendInfo { backend: "cpu", adapter, notes: Vec::new(), threads } }
    }

    /// With a note that says why the CPU renders.
    #[must_use]
    pub fn with_note(note: String) -> Self {
        let mut raycaster = Self::new();
        raycaster.info.notes.push(note);
        raycaster
    }
}

impl Default for CpuRaycaster {
    fn default() -> Self {
        Self::new()
    }
}

impl Raycaster for CpuRaycaster {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn brick_bytes(&self, stored_voxels: u64) -> u64 {
        stored_voxels * size_of::<u16>() as u64
    }

    fn upload(&self, owned: OwnedBox, voxels: &BrickVoxels) -> Result<Arc<dyn ResidentBrick>, RaycastError> {
        check_brick(&owned, voxels)?;
        let mut codes = Vec::new();
        if codes.try_reserve_exact(voxels.codes.len()).is_err() {
            let bytes = self.brick_bytes(voxels.codes.len() as u64);
            return Err(RaycastError::OutOfMemory { what: "a brick", bytes });
        }
        codes.extend_from_slice(&voxels.codes);
        Ok(Arc::new(CpuBrick { owned, uniform: BrickUniform::of_boxes(&owned, &voxels.stored), codes }))
    }

    fn warm_up(&self, _filter: Filter) -> Result<(), RaycastError> {
        Ok(())
    }

    fn render(&self, scene: &KernelScene, jobs: &[Job]) -> Result<Vec<JobImage>, RaycastError> {
        check_jobs(scene, jobs, u32::MAX)?;
        let frame = FrameUniform::new(&scene.view.kernel(), &scene.table, scene.early_termination);
        jobs.par_iter().map(|job| render_job(scene, &frame, job)).collect()
    }
}

fn render_job(scene: &KernelScene, frame: &FrameUniform, job: &Job) -> Result<JobImage, RaycastError> {
    let bricks: Vec<(&CpuBrick, PixelRect)> = job
        .bricks
        .iter()
        .map(|b| b.as_any().downcast_ref::<CpuBrick>().map(|b| (b, scene.view.project(&b.owned))))
        .collect::<Option<_>>()
        .ok_or(RaycastError::ForeignBrick { backend: "cpu" })?;
    let mut pixels = new_pixels(&job.rect)?;
    let samples = tiles_of(&job.rect, &mut pixels)
        .into_par_iter()
        .map(|tile| render_tile(frame, &scene.table.entries, &bricks, tile))
        .reduce(
            || vec![0; bricks.len()],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        );
    Ok(JobImage { rect: job.rect, pixels, samples })
}

/// Cuts a row-major accumulator into tiles.
fn tiles_of<'a>(rect: &PixelRect, pixels: &'a mut [Premul]) -> Vec<Tile<'a>> {
    let mut tiles = Vec::new();
    if rect.is_empty() {
        return tiles;
    }
    let width = rect.size().x as usize;
    for (band, rows) in pixels.chunks_mut(width * TILE).enumerate() {
        let first = tiles.len();
        let height = rows.len() / width;
        for x in (0..width).step_by(TILE) {
            let lo = rect.lo + UVec2::new(x as u32, (band * TILE) as u32);
            let hi = lo + UVec2::new((width - x).min(TILE) as u32, height as u32);
            tiles.push(Tile { rect: PixelRect { lo, hi }, rows: Vec::with_capacity(height) });
        }
        for row in rows.chunks_mut(width) {
            for (tile, part) in tiles[first..].iter_mut().zip(row.chunks_mut(TILE)) {
                tile.rows.push(part);
            }
        }
    }
    tiles
}

/// All bricks front to back into one tile; returns the samples of each.
fn render_tile(
    frame: &FrameUniform,
    table: &[[f32; 4]],
    bricks: &[(&CpuBrick, PixelRect)],
    mut tile: Tile<'_>,
) -> Vec<u64> {
    let lo = tile.rect.lo;
    let width = tile.rect.size().x;
    let rays: Vec<Ray> =
        (lo.y..tile.rect.hi.y).flat_map(|y| (lo.x..tile.rect.hi.x).map(move |x| pixel_ray(frame, x, y))).collect();
    let mut samples = vec![0; bricks.len()];
    for ((brick, projected), samples) in bricks.iter().zip(&mut samples) {
        let touched = tile.rect.intersect(projected);
        if touched.is_empty() {
            continue;
        }
        let mut finished = true;
        for y in touched.lo.y - lo.y..touched.hi.y - lo.y {
            let row = &mut tile.rows[y as usize];
            for x in touched.lo.x - lo.x..touched.hi.x - lo.x {
                let pixel = &mut row[x as usize];
                let ray = &rays[(y * width + x) as usize];
                let (sum, count) = raycast_ray(frame, &brick.uniform, &brick.codes, table, ray, *pixel);
                *pixel = sum;
                *samples += u64::from(count);
                finished &= sum.a >= frame.stop_alpha;
            }
        }
        // Only where the brick covers the tile does it see all pixels finished.
        if finished && touched == tile.rect {
            break;
        }
    }
    samples
}
