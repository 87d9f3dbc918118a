//! Lanes in plain Rust, of any width: what every other set must equal, and what processors without one run.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable<const N: usize>;

#[derive(Debug, Clone, Copy)]
pub(crate) struct F<const N: usize>([f32; N]);

#[derive(Debug, Clone, Copy)]
pub(crate) struct I<const N: usize>([i32; N]);

#[derive(Debug, Clone, Copy)]
pub(crate) struct M<const N: usize>([bool; N]);

/// By lane, of one or of two.
macro_rules! each {
    ($of:expr) => {{
        let mut all = [Default::default(); N];
        for (lane, one) in all.iter_mut().enumerate() {
            *one = $of(lane);
        }
        all
    }};
}

macro_rules! operator {
    ($type:ident, $trait:ident, $name:ident, $of:expr) => {
        impl<const N: usize> $trait for $type<N> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, with: Self) -> Self {
                Self(each!(|i: usize| $of(self.0[i], with.0[i])))
            }
        }
    };
}

operator!(F, Add, add, |a: f32, b: f32| a + b);
operator!(F, Sub, sub, |a: f32, b: f32| a - b);
operator!(F, Mul, mul, |a: f32, b: f32| a * b);
operator!(F, Div, div, |a: f32, b: f32| a / b);
operator!(I, Add, add, i32::wrapping_add);
operator!(I, Sub, sub, i32::wrapping_sub);
operator!(I, Mul, mul, i32::wrapping_mul);
operator!(I, BitAnd, bitand, |a: i32, b: i32| a & b);
operator!(M, BitAnd, bitand, |a: bool, b: bool| a & b);
operator!(M, BitOr, bitor, |a: bool, b: bool| a | b);

impl<const N: usize> Neg for F<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(each!(|i: usize| -self.0[i]))
    }
}

impl<const N: usize> Not for M<N> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(each!(|i: usize| !self.0[i]))
    }
}

impl<const N: usize> Mask for M<N> {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.iter().rev().fold(0, |bits, &lane| bits << 1 | u32::from(lane))
    }
}

/// The integer part of what an i32 can hold, and the least i32 for all else: one instruction on most processors, and
/// the same on all.
#[inline(always)]
fn cut_off(x: f32) -> i32 {
    if (-2_147_483_648.0..2_147_483_648.0).contains(&x) { x as i32 } else { i32::MIN }
}

impl<const N: usize> Floats for F<N> {
    type I = I<N>;
    type M = M<N>;

    #[inline(always)]
    fn lt(self, than: Self) -> M<N> {
        M(each!(|i: usize| self.0[i] < than.0[i]))
    }

    #[inline(always)]
    fn le(self, than: Self) -> M<N> {
        M(each!(|i: usize| self.0[i] <= than.0[i]))
    }

    #[inline(always)]
    fn same(self, as_: Self) -> M<N> {
        M(each!(|i: usize| self.0[i] == as_.0[i]))
    }

    #[inline(always)]
    fn larger(self, than: Self) -> Self {
        Self(each!(|i: usize| if self.0[i] > than.0[i] { self.0[i] } else { than.0[i] }))
    }

    #[inline(always)]
    fn smaller(self, than: Self) -> Self {
        Self(each!(|i: usize| if self.0[i] < than.0[i] { self.0[i] } else { than.0[i] }))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each!(|i: usize| self.0[i].sqrt()))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(each!(|i: usize| self.0[i].abs()))
    }

    #[inline(always)]
    fn cut_off(self) -> I<N> {
        I(each!(|i: usize| cut_off(self.0[i])))
    }

    #[inline(always)]
    fn bits(self) -> I<N> {
        I(each!(|i: usize| self.0[i].to_bits() as i32))
    }

    #[inline(always)]
    fn select(mask: M<N>, yes: Self, no: Self) -> Self {
        Self(each!(|i: usize| if mask.0[i] { yes.0[i] } else { no.0[i] }))
    }

    #[inline(always)]
    fn only(self, mask: M<N>) -> Self {
        Self(each!(|i: usize| if mask.0[i] { self.0[i] } else { 0.0 }))
    }
}

impl<const N: usize> Ints for I<N> {
    type F = F<N>;
    type M = M<N>;

    #[inline(always)]
    fn gt(self, than: Self) -> M<N> {
        M(each!(|i: usize| self.0[i] > than.0[i]))
    }

    #[inline(always)]
    fn same(self, as_: Self) -> M<N> {
        M(each!(|i: usize| self.0[i] == as_.0[i]))
    }

    #[inline(always)]
    fn larger(self, than: Self) -> Self {
        Self(each!(|i: usize| self.0[i].max(than.0[i])))
    }

    #[inline(always)]
    fn smaller(self, than: Self) -> Self {
        Self(each!(|i: usize| self.0[i].min(than.0[i])))
    }

    #[inline(always)]
    fn shift_right(self, bits: u32) -> Self {
        Self(each!(|i: usize| self.0[i] >> bits))
    }

    #[inline(always)]
    fn shift_right_unsigned(self, bits: u32) -> Self {
        Self(each!(|i: usize| (self.0[i] as u32 >> bits) as i32))
    }

    #[inline(always)]
    fn shift_left(self, bits: u32) -> Self {
        Self(each!(|i: usize| self.0[i] << bits))
    }

    #[inline(always)]
    fn floats(self) -> F<N> {
        F(each!(|i: usize| self.0[i] as f32))
    }

    #[inline(always)]
    fn as_bits(self) -> F<N> {
        F(each!(|i: usize| f32::from_bits(self.0[i] as u32)))
    }

    #[inline(always)]
    fn count(self, mask: M<N>) -> Self {
        Self(each!(|i: usize| self.0[i].wrapping_add(i32::from(mask.0[i]))))
    }

    #[inline(always)]
    fn select(mask: M<N>, yes: Self, no: Self) -> Self {
        Self(each!(|i: usize| if mask.0[i] { yes.0[i] } else { no.0[i] }))
    }
}

impl<const N: usize> Lanes for Portable<N> {
    const N: usize = N;
    const IS_FAST: bool = false;
    type F = F<N>;
    type I = I<N>;
    type M = M<N>;

    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }

    #[inline(always)]
    fn splat(self, x: f32) -> F<N> {
        F([x; N])
    }

    #[inline(always)]
    fn splat_int(self, x: i32) -> I<N> {
        I([x; N])
    }

    #[inline(always)]
    fn mask(self, bits: u32) -> M<N> {
        M(each!(|i: usize| bits >> i & 1 == 1))
    }

    #[inline(always)]
    fn load(self, from: &[f32; WIDEST]) -> F<N> {
        F(each!(|i: usize| from[i]))
    }

    #[inline(always)]
    fn store(self, x: F<N>) -> [f32; WIDEST] {
        let mut to = [0.0; WIDEST];
        to[..N].copy_from_slice(&x.0);
        to
    }

    #[inline(always)]
    fn store_int(self, x: I<N>) -> [i32; WIDEST] {
        let mut to = [0; WIDEST];
        to[..N].copy_from_slice(&x.0);
        to
    }

    #[inline(always)]
    unsafe fn pairs(self, codes: *const u16, at: I<N>) -> (F<N>, F<N>) {
        // SAFETY: as the caller promises.
        let code = |i: usize, on: usize| unsafe { f32::from(*codes.add(at.0[i] as usize + on)) };
        (F(each!(|i: usize| code(i, 0))), F(each!(|i: usize| code(i, 1))))
    }

    #[inline(always)]
    unsafe fn words(self, words: *const u32, at: I<N>) -> I<N> {
        // SAFETY: as the caller promises.
        I(each!(|i: usize| unsafe { *words.add(at.0[i] as usize) } as i32))
    }

    #[inline(always)]
    unsafe fn twos(self, twos: *const [f32; 2], at: I<N>) -> (F<N>, F<N>) {
        // SAFETY: as the caller promises.
        unsafe {
            (
                F(each!(|i: usize| (*twos.add(at.0[i] as usize))[0])),
                F(each!(|i: usize| (*twos.add(at.0[i] as usize))[1])),
            )
        }
    }

    #[inline(always)]
    unsafe fn between_rows(self, rows: *const [f32; 4], at: I<N>, w: F<N>) -> [F<N>; 4] {
        let mut out = [F([0.0; N]); 4];
        for i in 0..N {
            // SAFETY: as the caller promises.
            let (a, b) = unsafe { (&*rows.add(at.0[i] as usize), &*rows.add(at.0[i] as usize + 1)) };
            for c in 0..4 {
                out[c].0[i] = a[c] + (b[c] - a[c]) * w.0[i];
            }
        }
        out
    }

    #[inline(always)]
    unsafe fn among_rows(self, rows: *const [f32; 4], at: I<N>, size: usize, [v, u]: [F<N>; 2]) -> [F<N>; 4] {
        let mut out = [F([0.0; N]); 4];
        for i in 0..N {
            // SAFETY: as the caller promises.
            let row = |on: usize| unsafe { &*rows.add(at.0[i] as usize + on) };
            let (a, b, c, d) = (row(0), row(1), row(size), row(size + 1));
            for k in 0..4 {
                let near = a[k] + (b[k] - a[k]) * v.0[i];
                let far = c[k] + (d[k] - c[k]) * v.0[i];
                out[k].0[i] = near + (far - near) * u.0[i];
            }
        }
        out
    }
}
