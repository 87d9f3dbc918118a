//! What a call dispatches, worked out before anything is recorded: bands that fit the accumulator buffer, and
//! dispatches that end before a driver's watchdog does.

use brickcast_shaders::layout::BrickUniform;
use brickcast_volume::{OwnedBox, PixelRect, View};
use glam::UVec2;

use crate::kernel::{KernelKey, Placed};

/// Bytes of an accumulator's pixel: four f32.
pub(super) const PIXEL_BYTES: u64 = 16;
/// A row of the widest picture must fit.
pub(super) const MIN_ACCUMULATOR_BYTES: u64 = brickcast_volume::visibility::MAX_SIDE as u64 * PIXEL_BYTES;
/// The most samples of a dispatch and of a submission: about 0.01 s on a GPU, and a 32-bit counter holds them ...
pub(super) const DISPATCH_SAMPLES: f64 = 67_108_864.0;
/// ... and where the processor plays GPU: some 0.1 s, after which a frame that nobody wants ends.
pub(super) const DISPATCH_SAMPLES_IN_SOFTWARE: f64 = 4_194_304.0;

/// Rows of a job's rectangle that are rendered and read back together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Band {
    pub(super) job: usize,
    pub(super) rect: PixelRect,
    /// Index of its first pixel in the accumulator buffer.
    pub(super) base: u32,
}

/// One brick over some rows of a band.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dispatch {
    pub(super) job: usize,
    /// Of its brick in the job's list.
    pub(super) position: usize,
    pub(super) uniform: BrickUniform,
    pub(super) key: KernelKey,
    /// Upper bound.
    pub(super) samples: f64,
}

/// What fits the accumulator buffer at a time.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Batch {
    pub(super) bands: Vec<Band>,
    pub(super) pixels: u32,
}

/// Cuts the jobs' rectangles into batches of at most `capacity` pixels. `capacity` holds a row of any rectangle.
pub(super) fn batches(rects: &[PixelRect], capacity: u32) -> Vec<Batch> {
    let mut batches = vec![Batch::default()];
    for (job, rect) in rects.iter().enumerate().filter(|(_, rect)| !rect.is_empty()) {
        let width = rect.size().x;
        let rows = (capacity / width).max(1);
        for y in (rect.lo.y..rect.hi.y).step_by(rows as usize) {
            let band = PixelRect {
                lo: UVec2::new(rect.lo.x, y),
                hi: UVec2::new(rect.hi.x, y.saturating_add(rows).min(rect.hi.y)),
            };
            let pixels = band.pixel_count() as u32;
            if batches.last().is_some_and(|b| b.pixels > 0 && pixels > capacity - b.pixels) {
                batches.push(Batch::default());
            }
            if let Some(batch) = batches.last_mut() {
                batch.bands.push(Band { job, rect: band, base: batch.pixels });
                batch.pixels += pixels;
            }
        }
    }
    batches.retain(|b| b.pixels > 0);
    batches
}

/// The dispatches of one brick over a band: the projection of what shows of it, cut where the samples could be too
/// many.
pub(super) fn dispatches(view: &View, band: &Band, (position, most): (usize, f64), placed: Placed) -> Vec<Dispatch> {
    let Placed { uniform: boxes, shown, key } = placed;
    let owned = &boxes.owned();
    let rect = view.project(&shown).intersect(&band.rect);
    if rect.is_empty() || owned.voxel_count() == 0 {
        return Vec::new();
    }
    let per_pixel = most_samples(view, owned);
    let columns = ((most / per_pixel) as u32).clamp(1, rect.size().x);
    let rows = ((most / (per_pixel * f64::from(columns))) as u32).clamp(1, rect.size().y);
    let stride = band.rect.size().x;
    let mut pieces = Vec::new();
    for y in (rect.lo.y..rect.hi.y).step_by(rows as usize) {
        for x in (rect.lo.x..rect.hi.x).step_by(columns as usize) {
            let size = UVec2::new(columns.min(rect.hi.x - x), rows.min(rect.hi.y - y));
            let uniform = BrickUniform {
                accumulator_base: band.base + (y - band.rect.lo.y) * stride + (x - band.rect.lo.x),
                accumulator_stride: stride,
                rect_lo: [x, y],
                rect_size: size.into(),
                ..boxes
            };
            let samples = per_pixel * f64::from(size.x) * f64::from(size.y);
            pieces.push(Dispatch { job: band.job, position, uniform, key, samples });
        }
    }
    pieces
}

/// The samples of a ray along the box's diagonal; no ray has more than the 16 M that a view admits.
fn most_samples(view: &View, owned: &OwnedBox) -> f64 {
    let units = owned.dims().as_dvec3() / view.kernel().voxels_per_unit.as_dvec3();
    (units.length() / view.step() + 1.0).min(1.6e7)
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickcast_volume::{Camera, Geometry, Orbit, PictureSize};
    use glam::UVec3;

    fn rect(lo: [u32; 2], hi: [u32; 2]) -> PixelRect {
        PixelRect { lo: lo.into(), hi: hi.into() }
    }

    /// Every pixel of every job has exactly one place, inside the capacity.
    #[test]
    fn bands_cover_every_job_once() {
        let rects = [
            rect([0, 0], [100, 37]),
            rect([5, 5], [5, 9]),
            rect([3, 2], [20, 90]),
            rect([0, 0], [1, 1]),
            rect([7, 0], [107, 100]),
        ];
        for capacity in [100, 101, 1000, 5000, 1 << 20] {
            let mut rows = vec![0; rects.len()];
            for batch in batches(&rects, capacity) {
                assert!(batch.pixels <= capacity && batch.pixels > 0);
                let mut next = 0;
                for band in batch.bands {
                    assert_eq!(band.base, next);
                    next += band.rect.pixel_count() as u32;
                    assert_eq!(band.rect.lo.y, rects[band.job].lo.y + rows[band.job]);
                    assert_eq!(band.rect.size().x, rects[band.job].size().x);
                    rows[band.job] += band.rect.size().y;
                }
                assert_eq!(next, batch.pixels);
            }
            for (rect, rows) in rects.iter().zip(rows) {
                assert_eq!(rows, if rect.is_empty() { 0 } else { rect.size().y });
            }
        }
    }

    /// A picture of 64 Mi pixels at the smallest step must neither overflow a counter nor leave rows out.
    #[test]
    fn huge_frames_are_cut_into_short_dispatches() {
        let geometry = Geometry::new([512; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let view = View::new(&geometry, &camera, PictureSize::new(8192, 8192).unwrap(), 0.05).unwrap();
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(512) };
        let band = Band { job: 0, rect: rect([0, 1000], [8192, 1900]), base: 77 };
        let uniform = BrickUniform::of_boxes(&owned, &owned.stored(1));
        let placed = Placed { uniform, shown: owned, key: KernelKey::PLAIN };
        let pieces = dispatches(&view, &band, (3, DISPATCH_SAMPLES), placed);
        assert!(pieces.len() > 10);
        let covered = view.project(&owned).intersect(&band.rect);
        let mut pixels = 0;
        let mut corner = covered.lo;
        for piece in pieces {
            let u = piece.uniform;
            assert!(piece.samples <= DISPATCH_SAMPLES && piece.position == 3);
            assert_eq!(u.rect_lo, corner.to_array());
            assert_eq!(u.accumulator_base, 77 + (corner.y - 1000) * 8192 + corner.x);
            pixels += u.rect_size[0] as usize * u.rect_size[1] as usize;
            corner.x += u.rect_size[0];
            if corner.x == covered.hi.x {
                corner = UVec2::new(covered.lo.x, corner.y + u.rect_size[1]);
            }
        }
        assert_eq!((pixels, corner.y), (covered.pixel_count(), covered.hi.y));
    }
}
