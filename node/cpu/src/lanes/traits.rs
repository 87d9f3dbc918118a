//! What all instruction sets can do with numbers side by side.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Numbers with their operations, a lane each.
pub(crate) trait Floats:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    type I;
    type M;

    fn lt(self, than: Self) -> Self::M;
    fn le(self, than: Self) -> Self::M;
    fn same(self, as_: Self) -> Self::M;
    /// The larger one; the second where they are equal, or either is not a number.
    fn larger(self, than: Self) -> Self;
    /// The smaller one; the second where they are equal, or either is not a number.
    fn smaller(self, than: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// The integer part of what an i32 can hold.
    fn cut_off(self) -> Self::I;
    fn bits(self) -> Self::I;
    /// By lane.
    fn select(mask: Self::M, yes: Self, no: Self) -> Self;
    /// 0 in the other lanes.
    fn only(self, mask: Self::M) -> Self;
}

/// Whole numbers, a lane each; what does not fit wraps.
pub(crate) trait Ints:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + BitAnd<Output = Self>
{
    type F;
    type M;

    fn gt(self, than: Self) -> Self::M;
    fn same(self, as_: Self) -> Self::M;
    fn larger(self, than: Self) -> Self;
    fn smaller(self, than: Self) -> Self;
    /// By a number of bits below 32; the sign goes along.
    fn shift_right(self, bits: u32) -> Self;
    /// By a number of bits below 32; zeros come in.
    fn shift_right_unsigned(self, bits: u32) -> Self;
    fn shift_left(self, bits: u32) -> Self;
    /// One more in the lanes of the mask.
    fn count(self, mask: Self::M) -> Self;
    /// The numbers, rounded.
    fn floats(self) -> Self::F;
    fn as_bits(self) -> Self::F;
    fn select(mask: Self::M, yes: Self, no: Self) -> Self;
}

/// True or false, a lane each.
pub(crate) trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// A bit for each lane, the first one lowest.
    fn bits(self) -> u32;

    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Work over lanes of any set.
pub(crate) trait Task {
    type Output;

    /// Must be inlined, as everything that it calls with lanes: only so is it compiled for the set.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// An instruction set, as a token of no size that its presence was seen.
pub(crate) trait Lanes: Copy + Debug + Send + Sync + 'static {
    /// Lanes: a power of two, no more than [`WIDEST`].
    const N: usize;
    /// It is there for its speed.
    const IS_FAST: bool = true;
    type F: Floats<I = Self::I, M = Self::M> + Send + Sync + Debug;
    type I: Ints<F = Self::F, M = Self::M> + Send + Sync + Debug;
    type M: Mask + Send + Sync + Debug;

    /// Runs `task` compiled for the set.
    fn enter<T: Task>(self, task: T) -> T::Output;

    fn splat(self, x: f32) -> Self::F;
    fn splat_int(self, x: i32) -> Self::I;
    /// The lanes whose bits are set, the first lane's lowest.
    fn mask(self, bits: u32) -> Self::M;
    /// Of the first [`Self::N`] numbers of `from`.
    fn load(self, from: &[f32; WIDEST]) -> Self::F;
    fn store(self, x: Self::F) -> [f32; WIDEST];
    fn store_int(self, x: Self::I) -> [i32; WIDEST];

    /// The codes at places, and those behind them, as numbers.
    ///
    /// # Safety
    /// Every place is at least 0, and it and the one behind it lie within what `codes` points to.
    unsafe fn pairs(self, codes: *const u16, at: Self::I) -> (Self::F, Self::F);

    /// The words at places.
    ///
    /// # Safety
    /// Every place is at least 0 and lies within what `words` points to.
    unsafe fn words(self, words: *const u32, at: Self::I) -> Self::I;

    /// Both numbers at places, the first ones apart from the second.
    ///
    /// # Safety
    /// As of [`Lanes::words`].
    unsafe fn twos(self, twos: *const [f32; 2], at: Self::I) -> (Self::F, Self::F);

    /// `a + (b - a) * w` of the row at a place and the one behind it, transposed: red first.
    ///
    /// # Safety
    /// As of [`Lanes::pairs`], of rows.
    unsafe fn between_rows(self, rows: *const [f32; 4], at: Self::I, w: Self::F) -> [Self::F; 4];

    /// Bilinear between four rows: by `v` from that at a place to the one behind it, and from that `size` on to the one
    /// behind it; by `u` between the two. Transposed.
    ///
    /// # Safety
    /// As of [`Lanes::pairs`], of rows: for places and those `size` on.
    unsafe fn among_rows(self, rows: *const [f32; 4], at: Self::I, size: usize, weights: [Self::F; 2]) -> [Self::F; 4];
}

/// Lanes of the widest set.
pub(crate) const WIDEST: usize = 16;
