//! Four lanes of SSE2: every x86-64 processor has them.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::super::traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};
use super::spilled::Spilled;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sse2(());

#[derive(Debug, Clone, Copy)]
pub(crate) struct F4(__m128);

#[derive(Debug, Clone, Copy)]
pub(crate) struct I4(__m128i);

/// All bits of a lane, or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct M4(__m128);

impl Sse2 {
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

/// SSE2 multiplies every other lane only; the low halves are the same with and without a sign.
#[inline(always)]
unsafe fn multiplied(a: __m128i, b: __m128i) -> __m128i {
    // SAFETY: there is no such processor without SSE2.
    unsafe {
        let even = _mm_mul_epu32(a, b);
        let odd = _mm_mul_epu32(_mm_srli_epi64::<32>(a), _mm_srli_epi64::<32>(b));
        _mm_unpacklo_epi32(_mm_shuffle_epi32::<0b00_00_10_00>(even), _mm_shuffle_epi32::<0b00_00_10_00>(odd))
    }
}

/// By whole lanes of bits.
#[inline(always)]
unsafe fn chosen(mask: __m128, yes: __m128, no: __m128) -> __m128 {
    // SAFETY: there is no such processor without SSE.
    unsafe { _mm_or_ps(_mm_and_ps(mask, yes), _mm_andnot_ps(mask, no)) }
}

operator!(F4, Add, add, |a, b| _mm_add_ps(a, b));
operator!(F4, Sub, sub, |a, b| _mm_sub_ps(a, b));
operator!(F4, Mul, mul, |a, b| _mm_mul_ps(a, b));
operator!(F4, Div, div, |a, b| _mm_div_ps(a, b));
operator!(I4, Add, add, |a, b| _mm_add_epi32(a, b));
operator!(I4, Sub, sub, |a, b| _mm_sub_epi32(a, b));
operator!(I4, Mul, mul, |a, b| multiplied(a, b));
operator!(I4, BitAnd, bitand, |a, b| _mm_and_si128(a, b));
operator!(M4, BitAnd, bitand, |a, b| _mm_and_ps(a, b));
operator!(M4, BitOr, bitor, |a, b| _mm_or_ps(a, b));

impl Neg for F4 {
    type Output = Self;

    by! {
        fn neg(self) -> Self = Self(_mm_xor_ps(self.0, _mm_set1_ps(-0.0)));
    }
}

impl Not for M4 {
    type Output = Self;

    by! {
        fn not(self) -> Self = Self(_mm_xor_ps(self.0, _mm_castsi128_ps(_mm_set1_epi32(-1))));
    }
}

impl Mask for M4 {
    by! {
        fn bits(self) -> u32 = _mm_movemask_ps(self.0) as u32;
    }
}

impl Floats for F4 {
    type I = I4;
    type M = M4;

    by! {
        fn lt(self, than: Self) -> M4 = M4(_mm_cmplt_ps(self.0, than.0));
        fn le(self, than: Self) -> M4 = M4(_mm_cmple_ps(self.0, than.0));
        fn same(self, as_: Self) -> M4 = M4(_mm_cmpeq_ps(self.0, as_.0));
        fn larger(self, than: Self) -> Self = Self(_mm_max_ps(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(_mm_min_ps(self.0, than.0));
        fn sqrt(self) -> Self = Self(_mm_sqrt_ps(self.0));
        fn abs(self) -> Self = Self(_mm_andnot_ps(_mm_set1_ps(-0.0), self.0));
        fn cut_off(self) -> I4 = I4(_mm_cvttps_epi32(self.0));
        fn bits(self) -> I4 = I4(_mm_castps_si128(self.0));
        fn select(mask: M4, yes: Self, no: Self) -> Self = Self(chosen(mask.0, yes.0, no.0));
        fn only(self, mask: M4) -> Self = Self(_mm_and_ps(self.0, mask.0));
    }
}

impl Ints for I4 {
    type F = F4;
    type M = M4;

    by! {
        fn gt(self, than: Self) -> M4 = M4(_mm_castsi128_ps(_mm_cmpgt_epi32(self.0, than.0)));
        fn same(self, as_: Self) -> M4 = M4(_mm_castsi128_ps(_mm_cmpeq_epi32(self.0, as_.0)));
        fn larger(self, than: Self) -> Self = Self::select(self.gt(than), self, than);
        fn smaller(self, than: Self) -> Self = Self::select(self.gt(than), than, self);
        fn shift_right(self, bits: u32) -> Self = Self(_mm_sra_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn shift_right_unsigned(self, bits: u32) -> Self = Self(_mm_srl_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn count(self, mask: M4) -> Self = Self(_mm_sub_epi32(self.0, _mm_castps_si128(mask.0)));
        fn shift_left(self, bits: u32) -> Self = Self(_mm_sll_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn floats(self) -> F4 = F4(_mm_cvtepi32_ps(self.0));
        fn as_bits(self) -> F4 = F4(_mm_castsi128_ps(self.0));
        fn select(mask: M4, yes: Self, no: Self) -> Self =
            Self(_mm_castps_si128(chosen(mask.0, _mm_castsi128_ps(yes.0), _mm_castsi128_ps(no.0))));
    }
}

/// Rows to channels.
#[inline(always)]
unsafe fn transposed([r0, r1, r2, r3]: [__m128; 4]) -> [F4; 4] {
    // SAFETY: there is no such processor without SSE.
    unsafe {
        let (a, b) = (_mm_unpacklo_ps(r0, r1), _mm_unpacklo_ps(r2, r3));
        let (c, d) = (_mm_unpackhi_ps(r0, r1), _mm_unpackhi_ps(r2, r3));
        [F4(_mm_movelh_ps(a, b)), F4(_mm_movehl_ps(b, a)), F4(_mm_movelh_ps(c, d)), F4(_mm_movehl_ps(d, c))]
    }
}

impl Lanes for Sse2 {
    const N: usize = 4;
    type F = F4;
    type I = I4;
    type M = M4;

    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }

    by! {
        fn splat(self, x: f32) -> F4 = F4(_mm_set1_ps(x));
        fn splat_int(self, x: i32) -> I4 = I4(_mm_set1_epi32(x));
        fn mask(self, bits: u32) -> M4 = {
            let lane = _mm_setr_epi32(1, 2, 4, 8);
            M4(_mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(bits as i32), lane), lane)))
        };
        fn load(self, from: &[f32; WIDEST]) -> F4 = F4(_mm_loadu_ps(from.as_ptr()));
        fn store(self, x: F4) -> [f32; WIDEST] = {
            let mut to = [0.0; WIDEST];
            _mm_storeu_ps(to.as_mut_ptr(), x.0);
            to
        };
        fn store_int(self, x: I4) -> [i32; WIDEST] = {
            let mut to = [0; WIDEST];
            _mm_storeu_si128(to.as_mut_ptr().cast(), x.0);
            to
        };
    }

    #[inline(always)]
    unsafe fn pairs(self, codes: *const u16, at: I4) -> (F4, F4) {
        // SAFETY: as the caller promises.
        unsafe {
            let i = Spilled::new(at.0);
            let pair = |lane: usize| _mm_cvtsi32_si128(codes.add(i.lane(lane)).cast::<i32>().read_unaligned());
            let [a, b] = [_mm_unpacklo_epi32(pair(0), pair(1)), _mm_unpacklo_epi32(pair(2), pair(3))];
            let both = _mm_unpacklo_epi64(a, b);
            let near = _mm_and_si128(both, _mm_set1_epi32(0xffff));
            (F4(_mm_cvtepi32_ps(near)), F4(_mm_cvtepi32_ps(_mm_srli_epi32::<16>(both))))
        }
    }

    #[inline(always)]
    unsafe fn words(self, words: *const u32, at: I4) -> I4 {
        // SAFETY: as the caller promises.
        unsafe {
            let i = Spilled::new(at.0);
            let word = |lane: usize| words.add(i.lane(lane)).read() as i32;
            I4(_mm_setr_epi32(word(0), word(1), word(2), word(3)))
        }
    }

    #[inline(always)]
    unsafe fn twos(self, twos: *const [f32; 2], at: I4) -> (F4, F4) {
        // SAFETY: as the caller promises.
        unsafe {
            let i = Spilled::new(at.0);
            let a = _mm_castpd_ps(_mm_loadl_pd(_mm_setzero_pd(), twos.add(i.lane(0)).cast()));
            let b = _mm_castpd_ps(_mm_loadl_pd(_mm_setzero_pd(), twos.add(i.lane(1)).cast()));
            let c = _mm_castpd_ps(_mm_loadl_pd(_mm_setzero_pd(), twos.add(i.lane(2)).cast()));
            let d = _mm_castpd_ps(_mm_loadl_pd(_mm_setzero_pd(), twos.add(i.lane(3)).cast()));
            let (ab, cd) = (_mm_movelh_ps(a, b), _mm_movelh_ps(c, d));
            (F4(_mm_shuffle_ps::<0b10_00_10_00>(ab, cd)), F4(_mm_shuffle_ps::<0b11_01_11_01>(ab, cd)))
        }
    }

    #[inline(always)]
    unsafe fn between_rows(self, rows: *const [f32; 4], at: I4, w: F4) -> [F4; 4] {
        // SAFETY: as the caller promises.
        let i = Spilled::new(unsafe { _mm_slli_epi32::<4>(at.0) });
        let w = w.0;
        macro_rules! row {
            ($lane:literal) => {{
                let at = rows.byte_add(i.lane($lane));
                let (a, b) = (_mm_loadu_ps(at.cast()), _mm_loadu_ps(at.add(1).cast()));
                let w = _mm_shuffle_ps::<{ $lane * 0b01_01_01_01 }>(w, w);
                _mm_add_ps(a, _mm_mul_ps(_mm_sub_ps(b, a), w))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([row!(0), row!(1), row!(2), row!(3)]) }
    }

    #[inline(always)]
    unsafe fn among_rows(self, rows: *const [f32; 4], at: I4, size: usize, [v, u]: [F4; 2]) -> [F4; 4] {
        // SAFETY: as the caller promises.
        let i = Spilled::new(unsafe { _mm_slli_epi32::<4>(at.0) });
        let (v, u) = (v.0, u.0);
        macro_rules! row {
            ($lane:literal) => {{
                let at = rows.byte_add(i.lane($lane));
                let (a, b) = (_mm_loadu_ps(at.cast()), _mm_loadu_ps(at.add(1).cast()));
                let (c, d) = (_mm_loadu_ps(at.add(size).cast()), _mm_loadu_ps(at.add(size + 1).cast()));
                let v = _mm_shuffle_ps::<{ $lane * 0b01_01_01_01 }>(v, v);
                let u = _mm_shuffle_ps::<{ $lane * 0b01_01_01_01 }>(u, u);
                let near = _mm_add_ps(a, _mm_mul_ps(_mm_sub_ps(b, a), v));
                let far = _mm_add_ps(c, _mm_mul_ps(_mm_sub_ps(d, c), v));
                _mm_add_ps(near, _mm_mul_ps(_mm_sub_ps(far, near), u))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([row!(0), row!(1), row!(2), row!(3)]) }
    }
}
