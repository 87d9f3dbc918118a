//! Pictures and their comparison: four channels, premultiplied.

use std::fmt;

/// A picture of premultiplied RGBA, row-major, (0, 0) top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[f64; 4]>,
}

impl Picture {
    /// The greatest opacity of the picture.
    #[must_use]
    pub fn max_alpha(&self) -> f64 {
        self.pixels.iter().map(|p| p[3]).fold(0.0, f64::max)
    }

    #[must_use]
    pub fn at(&self, x: usize, y: usize) -> [f64; 4] {
        self.pixels[y * self.width + x]
    }
}

/// How far two pictures may be apart; values are premultiplied, 1 is white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// For the greatest difference of any channel of any pixel that is not an outlier.
    pub max: f64,
    /// For the mean over the four channels of all pixels that are not empty in both pictures, so that an empty margin
    /// cannot dilute it.
    pub mean: f64,
    /// Share of the pixels that may exceed `max`; rounded down, so that pictures below its inverse may have none.
    pub outlier_share: f64,
}

impl Tolerance {
    /// GPU, CPU twin and referee among each other: f32 against f64, a table of 4,096 entries and a sampler with weights
    /// of 8 bits or more together stay below two steps of an 8-bit display wherever opacity has a slope <= 4 over the
    /// range; on average they must be invisible (a twentieth of a step), and only a sample within f32 rounding of a
    /// face of the volume may come or go.
    pub const GPU_AGAINST_TWIN: Self = Self { max: 2.0 / 255.0, mean: 0.05 / 255.0, outlier_share: 1e-4 };

    /// The CPU kernel and the referee: the same operations in f32, weights not quantised. What is left is the rounding
    /// of positions (1e-5 voxel) and opacities and the kinks between table entries, all far below what a display can
    /// show; a mistake that hides in the bound for samplers of 8 bits shows in this one.
    pub const CPU_AGAINST_REFEREE: Self = Self { max: 0.25 / 255.0, mean: 0.01 / 255.0, outlier_share: 0.0 };

    /// The same scene in other bricks without early termination: the same samples in another order of f32 sums, read by
    /// samplers with weights relative to another corner.
    pub const OTHER_BRICKS: Self = Self { max: 1.0 / 255.0, mean: 0.05 / 255.0, outlier_share: 0.0 };

    /// The same samples of the same bricks, f32 sums in another order.
    pub const SAME_SAMPLES: Self = Self { max: 1e-5, mean: 1e-6, outlier_share: 0.0 };

    /// Early termination at 0.999 against none: what lies behind is worth a thousandth at most, in every opaque pixel.
    pub const EARLY_TERMINATION: Self = Self { max: 0.00101, mean: 0.001, outlier_share: 0.0 };

    /// Transfer functions steeper than 4 read by a sampler with weights of 8 bits: a weight off by 1/512 times the
    /// slope is seen where a surface passes, so only few pixels may show it, and the whole must not shift by a step.
    pub const STEEP_HARDWARE_FILTER: Self = Self { max: 2.0 / 255.0, mean: 1.0 / 255.0, outlier_share: 0.01 };

    /// The same f64 arithmetic, summed in another order.
    pub const SAME_ARITHMETIC: Self = Self { max: 1e-11, mean: 1e-12, outlier_share: 0.0 };
}

/// Why two pictures cannot be compared at all.
#[derive(Debug, Clone, PartialEq)]
pub enum NotComparable {
    Size { a: [usize; 2], b: [usize; 2] },
    Empty,
    PixelCount { expected: usize, a: usize, b: usize },
    NotFinite { x: usize, y: usize, a: [f64; 4], b: [f64; 4] },
}

/// How far two pictures are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Greatest difference of a channel, and its pixel with both values.
    pub max: f64,
    pub worst: [usize; 2],
    pub a: [f64; 4],
    pub b: [f64; 4],
    /// Mean over the channels of the pixels that are not empty in both.
    pub mean: f64,
    /// Pixels with a channel beyond the bound that was asked for, and the worst difference among the others.
    pub outliers: usize,
    pub max_of_rest: f64,
    /// Pixels compared, and those of them that are not empty in both pictures.
    pub pixels: usize,
    pub touched: usize,
}

/// Compares all pixels, counting those beyond `bound`.
///
/// # Errors
/// Sizes that differ, pictures without pixels, values that are not finite.
pub fn compare(a: &Picture, b: &Picture, bound: f64) -> Result<Difference, NotComparable> {
    compare_where(a, b, bound, |_| true)
}

/// As [`compare`], over the pixels (by row-major position) for which `counts` is true; the others are still checked for
/// values that are not finite.
///
/// # Errors
/// As [`compare`].
pub fn compare_where(
    a: &Picture,
    b: &Picture,
    bound: f64,
    counts: impl Fn(usize) -> bool,
) -> Result<Difference, NotComparable> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(NotComparable::Size { a: [a.width, a.height], b: [b.width, b.height] });
    }
    let expected = a.width * a.height;
    if a.pixels.len() != expected || b.pixels.len() != expected {
        return Err(NotComparable::PixelCount { expected, a: a.pixels.len(), b: b.pixels.len() });
    }
    if expected == 0 {
        return Err(NotComparable::Empty);
    }
    let mut d = Difference {
        max: 0.0,
        worst: [0, 0],
        a: a.pixels[0],
        b: b.pixels[0],
        mean: 0.0,
        outliers: 0,
        max_of_rest: 0.0,
        pixels: 0,
        touched: 0,
    };
    for (i, (&pa, &pb)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        let (x, y) = (i % a.width, i / a.width);
        if pa.iter().chain(&pb).any(|v| !v.is_finite()) {
            return Err(NotComparable::NotFinite { x, y, a: pa, b: pb });
        }
        if !counts(i) {
            continue;
        }
        d.pixels += 1;
        let off: [f64; 4] = std::array::from_fn(|c| (pa[c] - pb[c]).abs());
        let worst = off.iter().copied().fold(0.0, f64::max);
        if worst > d.max {
            (d.max, d.worst, d.a, d.b) = (worst, [x, y], pa, pb);
        }
        if worst > bound {
            d.outliers += 1;
        } else {
            d.max_of_rest = d.max_of_rest.max(worst);
        }
        if pa.iter().chain(&pb).any(|&v| v != 0.0) {
            d.touched += 1;
            d.mean += off.iter().sum::<f64>();
        }
    }
    d.mean /= (4 * d.touched.max(1)) as f64;
    Ok(d)
}

impl Difference {
    /// True where this difference, counted with the bound `tolerance.max`, is tolerable.
    #[must_use]
    pub fn is_within(&self, tolerance: &Tolerance) -> bool {
        self.mean <= tolerance.mean && self.outliers <= (tolerance.outlier_share * self.pixels as f64) as usize
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "max {:.3}/255 at pixel ({}, {}): {:.5?} against {:.5?}; mean {:.4}/255 over {} touched pixels; {} of {} \
             beyond the bound",
            self.max * 255.0,
            self.worst[0],
            self.worst[1],
            self.a,
            self.b,
            self.mean * 255.0,
            self.touched,
            self.outliers,
            self.pixels
        )
    }
}

/// True where both are comparable and within `tolerance`.
#[must_use]
pub fn is_within(a: &Picture, b: &Picture, tolerance: &Tolerance) -> bool {
    compare(a, b, tolerance.max).is_ok_and(|d| d.is_within(tolerance))
}

/// Asserts that two pictures are within `tolerance` of each other.
///
/// # Panics
/// Where they are not, naming the worst pixel with both values.
#[track_caller]
pub fn assert_within(what: &str, a: &Picture, b: &Picture, tolerance: &Tolerance) -> Difference {
    assert_within_where(what, a, b, tolerance, |_| true)
}

/// As [`assert_within`], over the pixels for which `counts` is true.
///
/// # Panics
/// As [`assert_within`].
#[track_caller]
pub fn assert_within_where(
    what: &str,
    a: &Picture,
    b: &Picture,
    tolerance: &Tolerance,
    counts: impl Fn(usize) -> bool,
) -> Difference {
    match compare_where(a, b, tolerance.max, counts) {
        Ok(d) if d.is_within(tolerance) => d,
        Ok(d) => panic!("{what}: {d}; tolerated: {tolerance:?}"),
        Err(e) => panic!("{what}: not comparable: {e:?}"),
    }
}
