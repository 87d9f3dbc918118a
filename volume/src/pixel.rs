//! Pixels: what a ray leaves behind, and how what lies in front is joined with what lies behind.
//!
//! In accumulators, buffers and tiles a pixel is four f32, whatever it means. What it means is its kind, which follows
//! from the scene's [`Mode`](crate::style::Mode): colours are composited, projections carry codes until the frame is
//! joined. All that depends on the kind is said here; nothing else reads a code out of a pixel.

mod coloring;

use bytemuck::{Pod, Zeroable};

pub use self::coloring::Coloring;
use crate::premul::{Premul, over};
use crate::words::words;

/// A pixel whose kind is said elsewhere: the four f32 of kernels and tiles.
pub type RawPixel = [f32; 4];

/// How far rounding may carry an opacity or a code beyond 0..=1.
const SLACK: f32 = 1e-3;

/// What the pixels of a frame are. The numbers are the kernels' (`MODE` of
/// `shaders/wgsl/take/projection.wgsl`).
///
/// A picture of the first thing that a ray meets (its label, its depth) would be one more, `Nearest`: the front one of
/// two that are there, no colour either. There is none yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum PixelKind {
    /// [`Premul`].
    #[default]
    Over = 0,
    /// [`Largest`].
    Largest = 1,
    /// [`Smallest`].
    Smallest = 2,
    /// [`Mean`].
    Mean = 3,
}

words!(
    PixelKind,
    "kind of pixels",
    [
        (Over, "over", "Premultiplied colour and opacity"),
        (Largest, "largest", "The largest code on the ray"),
        (Smallest, "smallest", "The smallest code on the ray"),
        (Mean, "mean", "Sum and number of the codes on the ray"),
    ]
);

/// One kind of pixels as a type. All are four f32, so that the bits are the same in a kernel, in a buffer and on the
/// wire.
pub trait Pixel: Pod + PartialEq {
    const KIND: PixelKind;
    /// Of a ray that met nothing: all bits zero, for tiles leave such pixels out.
    const CLEAR: Self;
    /// What every pixel of the kind keeps to, in words.
    const RULE: &'static str;

    /// Joins what lies in front with what lies behind. [`Self::CLEAR`] changes nothing on either side.
    #[must_use]
    fn join(front: Self, back: Self) -> Self;

    /// The code that it stands for; `None` where its ray met no sample, and of colours.
    #[must_use]
    fn code(self) -> Option<f32>;

    /// Whether it keeps to [`Self::RULE`]; rounding is allowed for.
    #[must_use]
    fn is_valid(self) -> bool;
}

impl Pixel for Premul {
    const KIND: PixelKind = PixelKind::Over;
    const CLEAR: Self = Self::CLEAR;
    const RULE: &'static str = "every channel must be finite and alpha lie in 0..=1";

    #[inline]
    fn join(front: Self, back: Self) -> Self {
        over(front, back)
    }

    fn code(self) -> Option<f32> {
        None
    }

    fn is_valid(self) -> bool {
        self.to_array().iter().all(|v| v.is_finite()) && (0.0..=1.0 + SLACK).contains(&self.a)
    }
}

/// The largest code on a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Largest {
    /// In 0..=1, the ends of the store's range.
    pub code: f32,
    pub unused: [f32; 2],
    /// 1 where the ray met a sample, else 0.
    pub presence: f32,
}

/// The smallest code on a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Smallest {
    /// In 0..=1, the ends of the store's range.
    pub code: f32,
    pub unused: [f32; 2],
    /// 1 where the ray met a sample, else 0.
    pub presence: f32,
}

/// The mean of all codes on a ray, as what it is made of.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Mean {
    /// Of all codes.
    pub sum: f32,
    /// Of samples: a whole number.
    pub count: f32,
    pub unused: f32,
    /// 1 where the ray met a sample, else 0.
    pub presence: f32,
}

/// The pixel of an extreme, by the function that gives the more extreme of two codes.
macro_rules! extreme {
    ($extreme:ident, $more:path) => {
        impl $extreme {
            /// Takes a sample.
            #[inline]
            fn take(&mut self, code: f32) {
                self.code = if self.presence == 0.0 { code } else { $more(self.code, code) };
                self.presence = 1.0;
            }
        }

        impl Pixel for $extreme {
            const KIND: PixelKind = PixelKind::$extreme;
            const CLEAR: Self = Self { code: 0.0, unused: [0.0; 2], presence: 0.0 };
            const RULE: &'static str = "presence must be 0 or 1 and the code lie in 0..=1";

            #[inline]
            fn join(front: Self, back: Self) -> Self {
                match (front.presence == 0.0, back.presence == 0.0) {
                    (true, _) => back,
                    (false, true) => front,
                    (false, false) => Self { code: $more(front.code, back.code), ..front },
                }
            }

            fn code(self) -> Option<f32> {
                (self.presence != 0.0).then_some(self.code)
            }

            fn is_valid(self) -> bool {
                is_presence(self.presence)
                    && (-SLACK..=1.0 + SLACK).contains(&self.code)
                    && self.unused.iter().all(|v| v.is_finite())
            }
        }
    };
}

extreme!(Largest, f32::max);
extreme!(Smallest, f32::min);

impl Mean {
    /// Takes `n` samples of one code.
    #[inline]
    fn take(&mut self, code: f32, n: f32) {
        self.sum += code * n;
        self.count += n;
        self.presence = 1.0;
    }
}

impl Pixel for Mean {
    const KIND: PixelKind = PixelKind::Mean;
    const CLEAR: Self = Self { sum: 0.0, count: 0.0, unused: 0.0, presence: 0.0 };
    const RULE: &'static str =
        "presence must be 0 or 1, the sum of codes finite and not negative, their number whole and not negative";

    #[inline]
    fn join(front: Self, back: Self) -> Self {
        match (front.presence == 0.0, back.presence == 0.0) {
            (true, _) => back,
            (false, true) => front,
            (false, false) => Self { sum: front.sum + back.sum, count: front.count + back.count, ..front },
        }
    }

    fn code(self) -> Option<f32> {
        (self.presence != 0.0).then(|| self.sum / self.count.max(1.0))
    }

    fn is_valid(self) -> bool {
        is_presence(self.presence)
            && (self.sum.is_finite() && self.sum >= -SLACK)
            && (self.count.is_finite() && self.count >= 0.0 && self.count.fract() == 0.0)
            && self.unused.is_finite()
    }
}

fn is_presence(presence: f32) -> bool {
    presence == 0.0 || presence == 1.0
}

/// `$what`, in which `$pixel` is the type of the kind's pixels.
macro_rules! of_kind {
    ($kind:expr, $pixel:ident => $what:expr) => {
        match $kind {
            PixelKind::Over => {
                type $pixel = Premul;
                $what
            }
            PixelKind::Largest => {
                type $pixel = Largest;
                $what
            }
            PixelKind::Smallest => {
                type $pixel = Smallest;
                $what
            }
            PixelKind::Mean => {
                type $pixel = Mean;
                $what
            }
        }
    };
}

impl PixelKind {
    /// True of pixels that carry codes, and take every sample of their rays, whether or not it shows.
    #[must_use]
    pub const fn is_projection(self) -> bool {
        !matches!(self, Self::Over)
    }

    /// May a ray end before its last sample, where what lies behind would hardly show?
    #[must_use]
    pub const fn may_end_early(self) -> bool {
        !self.is_projection()
    }

    /// May its values be rounded on their way? Codes and counts travel as they are, as f32.
    #[must_use]
    pub const fn may_be_rounded(self) -> bool {
        !self.is_projection()
    }

    /// The code of samples that change no pixel, whatever else lies on the ray; a macrocell that holds nothing else is
    /// skipped. For the mean they count, each as zero.
    #[must_use]
    pub const fn neutral_code(self) -> u16 {
        match self {
            Self::Over | Self::Largest | Self::Mean => 0,
            Self::Smallest => u16::MAX,
        }
    }

    /// Takes `n` samples of one code into a projection's accumulator. Colours are no codes: theirs stays as it is.
    #[inline]
    pub fn take(self, pixel: &mut RawPixel, code: f32, n: f32) {
        match self {
            Self::Over => {}
            Self::Largest => bytemuck::cast_mut::<_, Largest>(pixel).take(code),
            Self::Smallest => bytemuck::cast_mut::<_, Smallest>(pixel).take(code),
            Self::Mean => bytemuck::cast_mut::<_, Mean>(pixel).take(code, n),
        }
    }

    /// Joins pixels of this kind one by one, the front ones into those behind.
    pub fn join(self, front: &[RawPixel], back: &mut [RawPixel]) {
        fn join<P: Pixel>(front: &[RawPixel], back: &mut [RawPixel]) {
            let pairs = bytemuck::cast_slice::<_, P>(front).iter().zip(bytemuck::cast_slice_mut::<_, P>(back));
            pairs.for_each(|(front, back)| *back = P::join(*front, *back));
        }
        of_kind!(self, P => join::<P>(front, back));
    }

    /// As [`Pixel::code`].
    #[must_use]
    pub fn code(self, pixel: RawPixel) -> Option<f32> {
        of_kind!(self, P => bytemuck::cast::<_, P>(pixel).code())
    }

    /// As [`Pixel::is_valid`].
    #[must_use]
    pub fn is_valid(self, pixel: RawPixel) -> bool {
        of_kind!(self, P => bytemuck::cast::<_, P>(pixel).is_valid())
    }

    /// As [`Pixel::RULE`].
    #[must_use]
    pub const fn rule(self) -> &'static str {
        of_kind!(self, P => P::RULE)
    }
}

/// Pixels of another kind than what they are to be joined with, or than is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("pixels of kind `{got}` where `{want}` is asked for: only pixels of one kind can be joined")]
pub struct KindError {
    pub got: PixelKind,
    pub want: PixelKind,
}

/// The pixels of a picture, or of a part of it: all of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    kind: PixelKind,
    values: Vec<RawPixel>,
}

impl Pixels {
    /// Of rays that met nothing.
    #[must_use]
    pub fn clear(kind: PixelKind, count: usize) -> Self {
        Self { kind, values: vec![[0.0; 4]; count] }
    }

    /// What a kernel or a tile says is of this kind.
    #[must_use]
    pub fn from_raw(kind: PixelKind, values: Vec<RawPixel>) -> Self {
        Self { kind, values }
    }

    #[must_use]
    pub fn of<P: Pixel>(values: Vec<P>) -> Self {
        Self { kind: P::KIND, values: values.into_iter().map(bytemuck::cast).collect() }
    }

    #[must_use]
    pub fn kind(&self) -> PixelKind {
        self.kind
    }

    /// The kind that both have.
    ///
    /// # Errors
    /// Two kinds: `other` is not what this one is.
    pub fn kind_with(&self, other: &Self) -> Result<PixelKind, KindError> {
        if other.kind == self.kind { Ok(self.kind) } else { Err(KindError { got: other.kind, want: self.kind }) }
    }

    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    #[must_use]
    pub fn raw(&self) -> &[RawPixel] {
        &self.values
    }

    /// For kernels, and to copy or join what is of the same kind.
    pub fn raw_mut(&mut self) -> &mut [RawPixel] {
        &mut self.values
    }

    /// # Errors
    /// They are of another kind.
    pub fn typed<P: Pixel>(&self) -> Result<&[P], KindError> {
        if self.kind == P::KIND {
            Ok(bytemuck::cast_slice(&self.values))
        } else {
            Err(KindError { got: self.kind, want: P::KIND })
        }
    }
}

impl AsRef<[RawPixel]> for Pixels {
    fn as_ref(&self) -> &[RawPixel] {
        &self.values
    }
}

#[cfg(test)]
mod tests;
