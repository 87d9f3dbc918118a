//! How much is rendered at a time.
//!
//! Between two slices others get their turn, so a slice should take as long as others may be kept waiting, and no
//! shorter: each ends with threads that wait for the last. What a slice will take is guessed by the samples that its
//! rays may have at most, which is far off where they end early; so the next one is made longer or shorter by what the
//! last one took.

use std::time::{Duration, Instant};

use brickcast_volume::PixelRect;
use glam::UVec2;

use crate::kernel::BackendInfo;

/// What a slice should take while nobody else wants the turn, and while somebody does.
const ALONE: Duration = Duration::from_millis(400);
const BESIDE_OTHERS: Duration = Duration::from_millis(100);
/// For so long after somebody else had the turn, somebody else is expected to want it again.
const EXPECTED: Duration = Duration::from_secs(2);
/// Samples that a thread of the processor takes in the worst of a second, and a GPU.
const PER_THREAD: f64 = 8e6;
const PER_GPU: f64 = 1e9;
/// In places that look alike to the guess one may take that many times as long as another.
const CHANGE: std::ops::RangeInclusive<f64> = 0.25..=4.0;
/// Edge of the blocks that pictures are cut into where rows are long: of a whole number of the kernels' tiles ...
const BLOCK: u32 = 32;
/// ... and where single pixels are.
const SMALLEST_BLOCK: u32 = 4;

/// How many samples the next slice should have.
#[derive(Debug)]
pub(super) struct SliceSize {
    /// Samples of about a second at least.
    second: f64,
    samples: f64,
    others_until: Option<Instant>,
}

impl SliceSize {
    pub(super) fn new(info: &BackendInfo) -> Self {
        let second = if info.is_on_processor { PER_THREAD * f64::from(info.threads.max(1)) } else { PER_GPU };
        Self { second, samples: 2.0 * second, others_until: None }
    }

    /// Samples of a piece whose tiles are sent together, where nothing else asks for larger ones.
    pub(super) fn of_piece(info: &BackendInfo) -> f64 {
        4.0 * Self::new(info).second
    }

    /// Whatever they take.
    #[cfg(test)]
    pub(super) fn always(samples: f64) -> Self {
        Self { second: samples / 8.0, samples, others_until: None }
    }

    pub(super) fn samples(&self) -> f64 {
        self.samples
    }

    /// Somebody else had the turn at `now`.
    pub(super) fn others_had_the_turn(&mut self, now: Instant) {
        if self.others_until.is_none_or(|until| until <= now) {
            self.samples = self.samples.min(self.second);
        }
        self.others_until = Some(now + EXPECTED);
    }

    /// A slice that was guessed to have `samples` took `time`, until `now`.
    pub(super) fn took(&mut self, samples: f64, time: Duration, now: Instant) {
        let beside_others = self.others_until.is_some_and(|until| now < until);
        let (target, most) = if beside_others { (BESIDE_OTHERS, 1.0) } else { (ALONE, 8.0) };
        let change = target.as_secs_f64() / time.as_secs_f64().max(1e-6);
        self.samples = (samples * change.clamp(*CHANGE.start(), *CHANGE.end())).clamp(1.0, most * self.second);
    }
}

/// What is left of a rectangle that is cut into slices, from the top, every pixel once.
#[derive(Debug)]
pub(super) struct Rest {
    rect: PixelRect,
    /// The top row of what is left.
    y: u32,
    /// From here on the `height` rows below `y` are left, and all of those below them.
    x: u32,
    height: u32,
}

impl Rest {
    pub(super) fn new(rect: PixelRect) -> Self {
        Self { rect, y: rect.lo.y, x: rect.lo.x, height: 0 }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rect.is_empty() || self.y >= self.rect.hi.y
    }

    /// The next slice: about `samples`, where a pixel has `per_pixel`; whole rows where they are short, else a block.
    pub(super) fn cut(&mut self, per_pixel: f64, samples: f64) -> PixelRect {
        let (lo, hi) = (self.rect.lo, self.rect.hi);
        let left = hi.y - self.y;
        let pixels = (samples / per_pixel.max(1e-9)).max(1.0);
        if self.x == lo.x {
            let rows = (pixels / f64::from(hi.x - lo.x)) as u32;
            if rows >= left.min(BLOCK) {
                let rows = if rows >= left { left } else { rows / BLOCK * BLOCK };
                let slice = PixelRect { lo: UVec2::new(lo.x, self.y), hi: UVec2::new(hi.x, self.y + rows) };
                self.y += rows;
                return slice;
            }
            self.height = (pixels.sqrt() as u32).clamp(SMALLEST_BLOCK, BLOCK).min(left);
        }
        let columns = ((pixels / f64::from(self.height)) as u32).max(SMALLEST_BLOCK);
        let end = self.x.saturating_add(columns).min(hi.x);
        let slice = PixelRect { lo: UVec2::new(self.x, self.y), hi: UVec2::new(end, self.y + self.height) };
        if end == hi.x {
            self.y += self.height;
            self.x = lo.x;
        } else {
            self.x = end;
        }
        slice
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_cover_every_pixel_once_whatever_their_size() {
        let (lo, hi) = (UVec2::new(3, 5), UVec2::new(3 + 131, 5 + 97));
        for samples in [1.0, 10.0, 500.0, 3_000.0, 10_000.0, 1e9] {
            for per_pixel in [0.0, 0.5, 10.0, 200.0] {
                let mut rest = Rest::new(PixelRect { lo, hi });
                let mut seen = vec![0_u8; 131 * 97];
                let mut size = samples;
                while !rest.is_empty() {
                    let slice = rest.cut(per_pixel, size);
                    assert!(!slice.is_empty());
                    // As it changes while a picture is made.
                    size = if size > samples { samples } else { samples * 3.0 };
                    for y in slice.lo.y..slice.hi.y {
                        for x in slice.lo.x..slice.hi.x {
                            seen[((y - lo.y) * 131 + x - lo.x) as usize] += 1;
                        }
                    }
                }
                assert!(seen.iter().all(|&n| n == 1), "{samples} {per_pixel}");
            }
        }
        assert!(Rest::new(PixelRect { lo, hi: lo }).is_empty());
    }

    #[test]
    fn slices_are_as_large_as_asked_for() {
        for (per_pixel, samples) in [(1.0, 4000.0), (500.0, 1e6), (1e5, 1e6), (30.0, 1e4)] {
            let mut rest = Rest::new(PixelRect { lo: UVec2::ZERO, hi: UVec2::splat(1000) });
            while !rest.is_empty() {
                let slice = rest.cut(per_pixel, samples);
                let least = f64::from(SMALLEST_BLOCK * SMALLEST_BLOCK) * per_pixel;
                let got = slice.pixel_count() as f64 * per_pixel;
                assert!(got <= samples.max(least) * 1.3, "{got} of {samples}, {slice:?}");
            }
        }
    }

    fn info(threads: u32, is_on_processor: bool) -> BackendInfo {
        BackendInfo {
            backend: "cpu",
            adapter: String::new(),
            notes: Vec::new(),
            threads,
            is_on_processor,
            limits: Vec::new(),
        }
    }

    /// Whatever a sample costs, slices come to take what they should within a few; and none has more than the worst
    /// allows.
    #[test]
    fn slices_come_to_take_as_long_as_they_should() {
        for per_second in [1e5, 1e6, 3e7, 2e8] {
            for others in [false, true] {
                let mut size = SliceSize::new(&info(2, true));
                let mut now = Instant::now();
                let mut time = Duration::ZERO;
                for _ in 0..20 {
                    if others {
                        size.others_had_the_turn(now);
                    }
                    time = Duration::from_secs_f64(size.samples() / per_second);
                    now += time;
                    size.took(size.samples(), time, now);
                }
                let (want, most) = if others { (0.1, 1.0) } else { (0.4, 8.0) };
                let want = f64::min(want, most * 2.0 * PER_THREAD / per_second);
                let got = time.as_secs_f64();
                assert!((got / want - 1.0).abs() < 0.01, "{per_second} {others}: {got} s, not {want}");
            }
        }
        assert!(SliceSize::new(&info(1, false)).samples() >= 1e9, "a GPU's first slice is a whole picture");
    }
}
