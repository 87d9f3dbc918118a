//! What leaping changed, and what is proved of it: the same view rendered with and without, and the interval of every
//! pixel (docs/adr/0016-intervals.md).

use brickcast_volume::scene::{Scene, Transport};
use serde::Serialize;

use super::interval::Intervals;
use crate::picture::Picture;

/// Of all pixels, each by its largest channel; premultiplied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    pub largest: f32,
    /// 99 of 100 pixels have no more.
    pub p99: f32,
    pub mean: f64,
}

impl Figures {
    fn of(mut pixels: Vec<f32>) -> Self {
        pixels.sort_by(f32::total_cmp);
        let rank = (pixels.len() * 99).div_ceil(100).max(1) - 1;
        let sum: f64 = pixels.iter().map(|&v| f64::from(v)).sum();
        Self {
            largest: pixels.last().copied().unwrap_or(0.0),
            p99: pixels.get(rank).copied().unwrap_or(0.0),
            mean: sum / pixels.len().max(1) as f64,
        }
    }
}

impl std::fmt::Display for Figures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { largest, p99, mean } = self;
        write!(f, "{largest:.4} (99 % of the pixels {p99:.4}, mean {mean:.6})")
    }
}

/// Two pictures compared, with each other and with the intervals of both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Audit {
    /// Between the pictures with and without leaping.
    pub difference: Figures,
    /// Of the intervals: whatever the volume is in its regions, no more can differ.
    pub width: Figures,
    /// Pixels of either picture that lie outside their interval by more than the slack: 0, or there is a bug.
    pub pixels_outside: u64,
    /// By how much a pixel may lie outside: see [`slack`].
    #[serde(skip)]
    pub slack: f32,
}

impl Audit {
    /// One line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Self { difference, width, pixels_outside, slack } = self;
        let inside = match pixels_outside {
            0 => {
                format!("every pixel of both pictures lies within (but for {slack:.4}: rounding, rays that stop early)")
            }
            n => format!("{n} pixels lie outside by more than {slack:.4}, which must not be"),
        };
        format!("audit: without leaping the picture differs by at most {difference}; proved is {width}; {inside}")
    }
}

/// How far a pixel may lie outside of its interval for what no interval holds, premultiplied: sums of a thousand steps
/// round by 1e-4; pictures are rounded in `transport`; a ray that stops at opacity e leaves out (1 - e) / e at most,
/// over all layers; and a GPU's samplers weigh in 1/256, which tables of slabs feel, too.
#[must_use]
pub fn slack(scene: &Scene, transport: Transport, on_gpu: bool) -> f32 {
    let rounding = match transport {
        Transport::F32 => 1e-4,
        Transport::F16 => 1e-3,
        Transport::U8 => 1.0 / 254.0,
    };
    let e = scene.quality.early_termination;
    rounding + (1.0 - e) / e + if on_gpu { 2.0 / 255.0 } else { 0.0 }
}

/// Compares the picture with leaping with the one without, both of one view, and both with its intervals.
#[must_use]
pub fn compare(with: &Picture, without: &Picture, intervals: &Intervals, slack: f32) -> Audit {
    let count = with.pixels().len();
    let (mut differences, mut widths, mut outside) = (Vec::with_capacity(count), Vec::with_capacity(count), 0);
    let bounds = intervals.lo().pixels().iter().zip(intervals.hi().pixels());
    for ((a, b), (lo, hi)) in with.pixels().iter().zip(without.pixels()).zip(bounds) {
        let [a, b, lo, hi] = [a, b, lo, hi].map(|pixel| pixel.to_array());
        let worst = |x: [f32; 4], y: [f32; 4]| (0..4).map(|c| (x[c] - y[c]).abs()).fold(0.0, f32::max);
        differences.push(worst(a, b));
        widths.push(worst(hi, lo));
        // No number is inside.
        let is_inside = |p: [f32; 4]| (0..4).all(|c| lo[c] - slack <= p[c] && p[c] <= hi[c] + slack);
        outside += u64::from(!(is_inside(a) && is_inside(b)));
    }
    Audit { difference: Figures::of(differences), width: Figures::of(widths), pixels_outside: outside, slack }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::scene::{Filter, Look, Quality, ViewSpec};
    use brickcast_volume::transfer_function::{Colormap, TransferFunction};
    use brickcast_volume::{Camera, Geometry, Orbit, PictureSize, Premul};

    use super::*;

    fn scene(early_termination: f32) -> Scene {
        let geometry = Geometry::new([8; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let look = Look::new(TransferFunction::window(0.0, 1.0, 0.5, Colormap::Grayscale).unwrap(), 1.0);
        let view = ViewSpec { camera, size: PictureSize::new(2, 1).unwrap() };
        Scene::new(look, view, Quality { early_termination, filter: Filter::Exact, ..Quality::default() }).unwrap()
    }

    /// A pixel outside is found, whatever its neighbour's interval allows, in any channel, of either picture.
    #[test]
    fn a_pixel_outside_its_interval_is_reported() {
        let scene = scene(1.0);
        let picture = |blue: [f32; 2], alpha: f32| {
            let pixels = blue.map(|b| Premul::from_array([0.1, 0.1, b, alpha]));
            Picture::new(scene.view.size, pixels.to_vec()).unwrap()
        };
        // Of blue, 0.20 to 0.25 and 0.2 to 0.7.
        let intervals = Intervals::new(&picture([0.2, 0.2], 0.9), &picture([0.25, 0.7], 0.9), &scene).unwrap();
        let audit = |a: [f32; 2], b: [f32; 2]| compare(&picture(a, 0.9), &picture(b, 0.9), &intervals, 1e-3);
        let good = audit([0.24, 0.6], [0.2, 0.2]);
        assert!(good.pixels_outside == 0 && good.in_words().contains("every pixel"), "{good:?}");
        assert!((good.difference.largest - 0.4).abs() < 1e-6 && (good.width.largest - 0.5).abs() < 1e-6, "{good:?}");
        assert!((good.difference.mean - 0.22).abs() < 1e-6, "{good:?}");
        for (with, without) in [([0.27, 0.3], [0.2, 0.2]), ([0.2, 0.2], [0.2, 0.75]), ([0.19, 0.3], [0.2, f32::NAN])] {
            let bad = audit(with, without);
            assert!(bad.pixels_outside >= 1 && bad.in_words().contains("lie outside"), "{bad:?}");
        }
        let opaque = compare(&picture([0.2, 0.2], 0.95), &picture([0.2, 0.2], 0.9), &intervals, 1e-3);
        assert_eq!(opaque.pixels_outside, 2);
    }

    #[test]
    fn figures_are_of_all_pixels() {
        let figures = Figures::of((0..200).map(|i| i as f32).rev().collect());
        assert_eq!((figures.largest, figures.p99, figures.mean), (199.0, 197.0, 99.5));
        assert_eq!(Figures::of(Vec::new()), Figures { largest: 0.0, p99: 0.0, mean: 0.0 });
        assert_eq!(Figures::of(vec![0.5]).p99, 0.5);
    }

    #[test]
    fn the_slack_says_what_early_termination_may_add() {
        assert!(slack(&scene(0.9), Transport::F32, false) > 0.1 && slack(&scene(1.0), Transport::F32, false) <= 1e-4);
        assert!(slack(&scene(1.0), Transport::U8, false) > slack(&scene(1.0), Transport::F16, false));
        assert!(slack(&scene(1.0), Transport::F32, true) > 1.0 / 255.0);
    }
}
