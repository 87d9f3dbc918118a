//! What the samples of a ray may be, and what they may become together.

use brickcast_volume::Premul;
use brickcast_volume::transfer_function::Shown;
use brickcast_volume::transfer_function::extremes::Span;

use crate::twin::jump::opacity_of;

/// Where so little still shines through, whatever it is, nothing more is looked at: it counts as unknown.
const LITTLE: f32 = 2e-5;

/// What one position, slab, leap or brick may add: any opacity and any colour of these, together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub alpha: Span,
    /// Straight r, g, b.
    pub color: [Span; 3],
    /// Premultiplied, where more is known of it than what follows from the others.
    pub premul: [Span; 3],
}

impl Sample {
    /// `None` where it has no opacity.
    #[must_use]
    pub fn of(Shown { color, alpha }: Shown) -> Option<Self> {
        (alpha[1] > 0.0).then(|| Self { alpha, color, premul: color.map(|c| [alpha[0] * c[0], alpha[1] * c[1]]) })
    }

    /// What is known for certain.
    #[must_use]
    pub fn known(pixel: Premul) -> Option<Self> {
        let [r, g, b, a] = pixel.to_array();
        let premul = [r, g, b].map(|c| [c, c]);
        (a > 0.0).then(|| Self { alpha: [a, a], color: premul.map(|c| c.map(|c| c / a)), premul })
    }

    /// `n` of them, one after the other, each for itself: their opacities join as those of equal ones at the ends do,
    /// and their colour is a mean of theirs.
    #[must_use]
    pub fn repeated(self, n: f32) -> Self {
        if n == 1.0 {
            return self;
        }
        let alpha = self.alpha.map(|a| opacity_of(a, n));
        Self { alpha, premul: self.color.map(|c| [alpha[0] * c[0], alpha[1] * c[1]]), ..self }
    }
}

/// Between which values a pixel lies, premultiplied r, g, b, a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    pub lo: [f32; 4],
    pub hi: [f32; 4],
}

impl Interval {
    const CLEAR: Self = Self { lo: [0.0; 4], hi: [0.0; 4] };
    const UNKNOWN: Self = Self { lo: [0.0; 4], hi: [1.0; 4] };

    /// With a sample in front. What it becomes is `a c + (1 - a) C`, linear in each of the three: its extremes lie at
    /// corners of the box of them. Where less is known of `c` than of `a c`, that serves.
    fn behind(self, sample: &Sample) -> Self {
        let [a_lo, a_hi] = sample.alpha;
        let mix = |a: f32, color: f32, behind: f32| a * color + (1.0 - a) * behind;
        let mut joined = self;
        for c in 0..3 {
            let ([c_lo, c_hi], [p_lo, p_hi]) = (sample.color[c], sample.premul[c]);
            let (lo, hi) = (self.lo[c], self.hi[c]);
            joined.lo[c] = mix(a_lo, c_lo, lo).min(mix(a_hi, c_lo, lo)).max(p_lo + (1.0 - a_hi) * lo);
            joined.hi[c] = mix(a_lo, c_hi, hi).max(mix(a_hi, c_hi, hi)).min(p_hi + (1.0 - a_lo) * hi);
        }
        joined.lo[3] = mix(a_lo, 1.0, self.lo[3]);
        joined.hi[3] = mix(a_hi, 1.0, self.hi[3]);
        joined
    }
}

/// The samples of one ray, front to back.
#[derive(Debug, Clone)]
pub struct RaySamples {
    samples: Vec<Sample>,
    /// What shines through all of them, at most.
    through: f32,
}

impl Default for RaySamples {
    fn default() -> Self {
        Self { samples: Vec::new(), through: 1.0 }
    }
}

impl RaySamples {
    /// For another ray.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.through = 1.0;
    }

    /// Takes the next one.
    pub fn push(&mut self, sample: Option<Sample>) {
        if let Some(sample) = sample {
            self.through *= 1.0 - sample.alpha[0];
            self.samples.push(sample);
        }
    }

    /// True where hardly anything shines through: what follows need not be looked at.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.through < LITTLE
    }

    /// Folded from the back to the front.
    #[must_use]
    pub fn interval(&self) -> Interval {
        let behind = if self.is_done() { Interval::UNKNOWN } else { Interval::CLEAR };
        self.samples.iter().rev().fold(behind, Interval::behind)
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::over;
    use proptest::prelude::*;

    use super::*;

    fn span() -> impl Strategy<Value = Span> {
        (0.0..1.0_f32, prop_oneof![Just(0.0_f32), 0.0..0.2_f32, 0.0..1.0_f32])
            .prop_map(|(lo, width)| [lo, (lo + width).min(1.0)])
    }

    fn samples() -> impl Strategy<Value = Vec<(Sample, f32)>> {
        let sample = (span(), proptest::array::uniform3(span()), 1..6_u32)
            .prop_map(|(alpha, color, n)| (Sample::of(Shown { alpha, color }).unwrap_or(NONE), n as f32));
        proptest::collection::vec(sample, 1..20)
    }

    const NONE: Sample = Sample { alpha: [0.0; 2], color: [[0.0; 2]; 3], premul: [[0.0; 2]; 3] };

    fn within([lo, hi]: Span, t: f32) -> f32 {
        lo + (hi - lo) * t
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        /// Any ray of samples from the boxes, repeated ones each for itself, ends in the interval.
        #[test]
        fn any_ray_lies_within(all in samples(), seeds in proptest::collection::vec(0..u32::MAX, 30)) {
            let mut ray = RaySamples::default();
            all.iter().for_each(|(sample, n)| ray.push(Some(sample.repeated(*n))));
            let interval = ray.interval();
            for seed in seeds {
                let mut state = seed;
                let mut random = || {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    // The ends, too.
                    ((state >> 8) as f32 / (1 << 24) as f32 * 1.5 - 0.25).clamp(0.0, 1.0)
                };
                let mut pixel = Premul::CLEAR;
                for (sample, n) in &all {
                    for _ in 0..*n as u32 {
                        let a = within(sample.alpha, random());
                        let [r, g, b] = sample.color.map(|c| a * within(c, random()));
                        pixel = over(pixel, Premul { r, g, b, a });
                    }
                }
                for (c, value) in pixel.to_array().into_iter().enumerate() {
                    let (lo, hi) = (interval.lo[c], interval.hi[c]);
                    prop_assert!(lo - 1e-5 <= value && value <= hi + 1e-5, "channel {c}: {value} in {lo}..{hi}");
                }
            }
        }
    }

    #[test]
    fn what_is_known_has_no_width_and_what_is_not_has() {
        let mut ray = RaySamples::default();
        let (front, back) = (Premul { r: 0.1, g: 0.2, b: 0.05, a: 0.3 }, Premul { r: 0.4, g: 0.0, b: 0.1, a: 0.5 });
        ray.push(Sample::known(front));
        ray.push(Sample::known(back));
        ray.push(Sample::known(Premul::CLEAR));
        let (interval, pixel) = (ray.interval(), over(front, back).to_array());
        for ((lo, hi), pixel) in interval.lo.iter().zip(&interval.hi).zip(pixel) {
            assert!((lo - pixel).abs() < 1e-6 && (hi - pixel).abs() < 1e-6);
        }
        // Analytic: n steps of a in [0.1, 0.2] and white, behind them nothing.
        ray.clear();
        ray.push(Sample::of(Shown { alpha: [0.1, 0.2], color: [[1.0, 1.0]; 3] }).map(|s| s.repeated(10.0)));
        let Interval { lo, hi } = ray.interval();
        let (want_lo, want_hi) = (1.0 - 0.9_f32.powi(10), 1.0 - 0.8_f32.powi(10));
        assert!((lo[3] - want_lo).abs() < 1e-6 && (hi[3] - want_hi).abs() < 1e-6 && (lo[0] - want_lo).abs() < 1e-6);
    }

    #[test]
    fn rays_end_where_nothing_shines_through_and_what_is_behind_counts_as_unknown() {
        let mut ray = RaySamples::default();
        ray.push(Sample::known(Premul { r: 0.5, g: 0.5, b: 0.5, a: 0.99999 }));
        assert!(ray.is_done());
        let Interval { lo, hi } = ray.interval();
        assert!((lo[0] - 0.5).abs() < 1e-6 && hi[0] - lo[0] > 5e-6 && hi[0] - lo[0] < 2e-5, "{lo:?} {hi:?}");
    }
}
