//! Four lanes of NEON, which every 64-bit ARM processor has.

use std::arch::aarch64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Neon(());

#[derive(Debug, Clone, Copy)]
pub(crate) struct F4(float32x4_t);

#[derive(Debug, Clone, Copy)]
pub(crate) struct I4(int32x4_t);

/// All bits of a lane, or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct M4(uint32x4_t);

impl Neon {
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

/// `impl Trait for Type`, by an intrinsic of both.
macro_rules! operator {
    ($type:ident, $trait:ident, $name:ident, $of:ident) => {
        impl $trait for $type {
            type Output = Self;

            #[inline(always)]
            fn $name(self, with: Self) -> Self {
                // SAFETY: there is no such processor without NEON.
                Self(unsafe { $of(self.0, with.0) })
            }
        }
    };
}

/// Functions of a trait, each by intrinsics.
macro_rules! by {
    ($(fn $name:ident($($args:tt)*) -> $result:ty = $of:expr;)*) => {
        $(
            #[inline(always)]
            fn $name($($args)*) -> $result {
                // SAFETY: there is no such processor without NEON.
                #[allow(unused_unsafe)]
                unsafe {
                    $of
                }
            }
        )*
    };
}

operator!(F4, Add, add, vaddq_f32);
operator!(F4, Sub, sub, vsubq_f32);
operator!(F4, Mul, mul, vmulq_f32);
operator!(F4, Div, div, vdivq_f32);
operator!(I4, Add, add, vaddq_s32);
operator!(I4, Sub, sub, vsubq_s32);
operator!(I4, Mul, mul, vmulq_s32);
operator!(I4, BitAnd, bitand, vandq_s32);
operator!(M4, BitAnd, bitand, vandq_u32);
operator!(M4, BitOr, bitor, vorrq_u32);

impl Neg for F4 {
    type Output = Self;

    by! {
        fn neg(self) -> Self = Self(vnegq_f32(self.0));
    }
}

impl Not for M4 {
    type Output = Self;

    by! {
        fn not(self) -> Self = Self(vmvnq_u32(self.0));
    }
}

impl Mask for M4 {
    by! {
        fn bits(self) -> u32 = {
            let places = vld1q_u32([1, 2, 4, 8].as_ptr());
            vaddvq_u32(vandq_u32(self.0, places))
        };
    }
}

impl Floats for F4 {
    type I = I4;
    type M = M4;

    by! {
        fn lt(self, than: Self) -> M4 = M4(vcltq_f32(self.0, than.0));
        fn le(self, than: Self) -> M4 = M4(vcleq_f32(self.0, than.0));
        fn same(self, as_: Self) -> M4 = M4(vceqq_f32(self.0, as_.0));
        // Not `vmaxq_f32`: it has another answer where one is not a number, or both are zero.
        fn larger(self, than: Self) -> Self = Self(vbslq_f32(vcgtq_f32(self.0, than.0), self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(vbslq_f32(vcltq_f32(self.0, than.0), self.0, than.0));
        fn sqrt(self) -> Self = Self(vsqrtq_f32(self.0));
        fn abs(self) -> Self = Self(vabsq_f32(self.0));
        fn cut_off(self) -> I4 = {
            // What does not fit is the least number, as on other processors; here it would be the nearest.
            let fits = vandq_u32(
                vcgeq_f32(self.0, vdupq_n_f32(-2_147_483_648.0)),
                vcltq_f32(self.0, vdupq_n_f32(2_147_483_648.0)),
            );
            I4(vbslq_s32(fits, vcvtq_s32_f32(self.0), vdupq_n_s32(i32::MIN)))
        };
        fn bits(self) -> I4 = I4(vreinterpretq_s32_f32(self.0));
        fn select(mask: M4, yes: Self, no: Self) -> Self = Self(vbslq_f32(mask.0, yes.0, no.0));
        fn only(self, mask: M4) -> Self = Self(vbslq_f32(mask.0, self.0, vdupq_n_f32(0.0)));
    }
}

impl Ints for I4 {
    type F = F4;
    type M = M4;

    by! {
        fn gt(self, than: Self) -> M4 = M4(vcgtq_s32(self.0, than.0));
        fn same(self, as_: Self) -> M4 = M4(vceqq_s32(self.0, as_.0));
        fn larger(self, than: Self) -> Self = Self(vmaxq_s32(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(vminq_s32(self.0, than.0));
        fn shift_right(self, bits: u32) -> Self = Self(vshlq_s32(self.0, vdupq_n_s32(-(bits as i32))));
        fn shift_right_unsigned(self, bits: u32) -> Self =
            Self(vreinterpretq_s32_u32(vshlq_u32(vreinterpretq_u32_s32(self.0), vdupq_n_s32(-(bits as i32)))));
        fn count(self, mask: M4) -> Self = Self(vsubq_s32(self.0, vreinterpretq_s32_u32(mask.0)));
        fn shift_left(self, bits: u32) -> Self = Self(vshlq_s32(self.0, vdupq_n_s32(bits as i32)));
        fn floats(self) -> F4 = F4(vcvtq_f32_s32(self.0));
        fn as_bits(self) -> F4 = F4(vreinterpretq_f32_s32(self.0));
        fn select(mask: M4, yes: Self, no: Self) -> Self = Self(vbslq_s32(mask.0, yes.0, no.0));
    }
}

/// Rows to channels.
#[inline(always)]
unsafe fn transposed([r0, r1, r2, r3]: [float32x4_t; 4]) -> [F4; 4] {
    // SAFETY: there is no such processor without NEON.
    unsafe {
        let (a, b) = (vtrnq_f32(r0, r1), vtrnq_f32(r2, r3));
        let low = |x, y| vcombine_f32(vget_low_f32(x), vget_low_f32(y));
        let high = |x, y| vcombine_f32(vget_high_f32(x), vget_high_f32(y));
        [F4(low(a.0, b.0)), F4(low(a.1, b.1)), F4(high(a.0, b.0)), F4(high(a.1, b.1))]
    }
}

impl Lanes for Neon {
    const N: usize = 4;
    type F = F4;
    type I = I4;
    type M = M4;

    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }

    by! {
        fn splat(self, x: f32) -> F4 = F4(vdupq_n_f32(x));
        fn splat_int(self, x: i32) -> I4 = I4(vdupq_n_s32(x));
        fn mask(self, bits: u32) -> M4 = {
            let places = vld1q_u32([1, 2, 4, 8].as_ptr());
            M4(vtstq_u32(vdupq_n_u32(bits), places))
        };
        fn load(self, from: &[f32; WIDEST]) -> F4 = F4(vld1q_f32(from.as_ptr()));
        fn store(self, x: F4) -> [f32; WIDEST] = {
            let mut to = [0.0; WIDEST];
            vst1q_f32(to.as_mut_ptr(), x.0);
            to
        };
        fn store_int(self, x: I4) -> [i32; WIDEST] = {
            let mut to = [0; WIDEST];
            vst1q_s32(to.as_mut_ptr(), x.0);
            to
        };
    }

    #[inline(always)]
    unsafe fn pairs(self, codes: *const u16, at: I4) -> (F4, F4) {
        let i = self.store_int(at);
        // SAFETY: as the caller promises.
        unsafe {
            let pair = |lane: usize| codes.add(i[lane] as usize).cast::<u32>().read_unaligned();
            let both = vld1q_u32([pair(0), pair(1), pair(2), pair(3)].as_ptr());
            let near = vandq_u32(both, vdupq_n_u32(0xffff));
            (F4(vcvtq_f32_u32(near)), F4(vcvtq_f32_u32(vshrq_n_u32::<16>(both))))
        }
    }

    #[inline(always)]
    unsafe fn words(self, words: *const u32, at: I4) -> I4 {
        let i = self.store_int(at);
        // SAFETY: as the caller promises.
        unsafe {
            let word = |lane: usize| words.add(i[lane] as usize).read();
            I4(vreinterpretq_s32_u32(vld1q_u32([word(0), word(1), word(2), word(3)].as_ptr())))
        }
    }

    #[inline(always)]
    unsafe fn twos(self, twos: *const [f32; 2], at: I4) -> (F4, F4) {
        let i = self.store_int(at);
        // SAFETY: as the caller promises.
        unsafe {
            let two = |lane: usize| vld1_f32(twos.add(i[lane] as usize).cast());
            let (ab, cd) = (vcombine_f32(two(0), two(1)), vcombine_f32(two(2), two(3)));
            (F4(vuzp1q_f32(ab, cd)), F4(vuzp2q_f32(ab, cd)))
        }
    }

    #[inline(always)]
    unsafe fn between_rows(self, rows: *const [f32; 4], at: I4, w: F4) -> [F4; 4] {
        let (i, w) = (self.store_int(at), self.store(w));
        macro_rules! row {
            ($lane:literal) => {{
                let at = rows.add(i[$lane] as usize);
                let (a, b) = (vld1q_f32(at.cast()), vld1q_f32(at.add(1).cast()));
                vaddq_f32(a, vmulq_f32(vsubq_f32(b, a), vdupq_n_f32(w[$lane])))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([row!(0), row!(1), row!(2), row!(3)]) }
    }

    #[inline(always)]
    unsafe fn among_rows(self, rows: *const [f32; 4], at: I4, size: usize, [v, u]: [F4; 2]) -> [F4; 4] {
        let (i, v, u) = (self.store_int(at), self.store(v), self.store(u));
        macro_rules! row {
            ($lane:literal) => {{
                let at = rows.add(i[$lane] as usize);
                let (a, b) = (vld1q_f32(at.cast()), vld1q_f32(at.add(1).cast()));
                let (c, d) = (vld1q_f32(at.add(size).cast()), vld1q_f32(at.add(size + 1).cast()));
                let (v, u) = (vdupq_n_f32(v[$lane]), vdupq_n_f32(u[$lane]));
                let near = vaddq_f32(a, vmulq_f32(vsubq_f32(b, a), v));
                let far = vaddq_f32(c, vmulq_f32(vsubq_f32(d, c), v));
                vaddq_f32(near, vmulq_f32(vsubq_f32(far, near), u))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([row!(0), row!(1), row!(2), row!(3)]) }
    }
}
