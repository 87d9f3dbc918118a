//! Sixteen lanes of AVX-512.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::super::traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};
use super::spilled::Spilled;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512(());

#[derive(Debug, Clone, Copy)]
pub(crate) struct F16(__m512);

#[derive(Debug, Clone, Copy)]
pub(crate) struct I16(__m512i);

#[derive(Debug, Clone, Copy)]
pub(crate) struct M16(__mmask16);

impl Avx512 {
    /// Where the processor has the parts of it that all but the first have.
    pub(crate) fn new() -> Option<Self> {
        let has_it = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("popcnt");
        has_it.then_some(Self(()))
    }
}

operator!(F16, Add, add, |a, b| _mm512_add_ps(a, b));
operator!(F16, Sub, sub, |a, b| _mm512_sub_ps(a, b));
operator!(F16, Mul, mul, |a, b| _mm512_mul_ps(a, b));
operator!(F16, Div, div, |a, b| _mm512_div_ps(a, b));
operator!(I16, Add, add, |a, b| _mm512_add_epi32(a, b));
operator!(I16, Sub, sub, |a, b| _mm512_sub_epi32(a, b));
operator!(I16, Mul, mul, |a, b| _mm512_mullo_epi32(a, b));
operator!(I16, BitAnd, bitand, |a, b| _mm512_and_si512(a, b));

impl BitAnd for M16 {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, with: Self) -> Self {
        Self(self.0 & with.0)
    }
}

impl BitOr for M16 {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, with: Self) -> Self {
        Self(self.0 | with.0)
    }
}

impl Not for M16 {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Neg for F16 {
    type Output = Self;

    by! {
        fn neg(self) -> Self = Self(_mm512_xor_ps(self.0, _mm512_set1_ps(-0.0)));
    }
}

impl Mask for M16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl Floats for F16 {
    type I = I16;
    type M = M16;

    by! {
        fn lt(self, than: Self) -> M16 = M16(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, than.0));
        fn le(self, than: Self) -> M16 = M16(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, than.0));
        fn same(self, as_: Self) -> M16 = M16(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, as_.0));
        fn larger(self, than: Self) -> Self = Self(_mm512_max_ps(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(_mm512_min_ps(self.0, than.0));
        fn sqrt(self) -> Self = Self(_mm512_sqrt_ps(self.0));
        fn abs(self) -> Self = Self(_mm512_abs_ps(self.0));
        fn cut_off(self) -> I16 = I16(_mm512_cvttps_epi32(self.0));
        fn bits(self) -> I16 = I16(_mm512_castps_si512(self.0));
        fn select(mask: M16, yes: Self, no: Self) -> Self = Self(_mm512_mask_blend_ps(mask.0, no.0, yes.0));
        fn only(self, mask: M16) -> Self = Self(_mm512_maskz_mov_ps(mask.0, self.0));
    }
}

impl Ints for I16 {
    type F = F16;
    type M = M16;

    by! {
        fn gt(self, than: Self) -> M16 = M16(_mm512_cmpgt_epi32_mask(self.0, than.0));
        fn same(self, as_: Self) -> M16 = M16(_mm512_cmpeq_epi32_mask(self.0, as_.0));
        fn larger(self, than: Self) -> Self = Self(_mm512_max_epi32(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(_mm512_min_epi32(self.0, than.0));
        fn shift_right(self, bits: u32) -> Self = Self(_mm512_sra_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn shift_right_unsigned(self, bits: u32) -> Self =
            Self(_mm512_srl_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn count(self, mask: M16) -> Self =
            Self(_mm512_mask_add_epi32(self.0, mask.0, self.0, _mm512_set1_epi32(1)));
        fn shift_left(self, bits: u32) -> Self = Self(_mm512_sll_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn floats(self) -> F16 = F16(_mm512_cvtepi32_ps(self.0));
        fn as_bits(self) -> F16 = F16(_mm512_castsi512_ps(self.0));
        fn select(mask: M16, yes: Self, no: Self) -> Self = Self(_mm512_mask_blend_epi32(mask.0, no.0, yes.0));
    }
}

/// Rows of four lanes apart each other, `[j | j + 4 | j + 8 | j + 12]`, to channels.
#[inline(always)]
unsafe fn transposed([r0, r1, r2, r3]: [__m512; 4]) -> [F16; 4] {
    // SAFETY: as the caller's.
    unsafe {
        let (a, b) = (_mm512_unpacklo_ps(r0, r1), _mm512_unpacklo_ps(r2, r3));
        let (c, d) = (_mm512_unpackhi_ps(r0, r1), _mm512_unpackhi_ps(r2, r3));
        [
            F16(_mm512_shuffle_ps::<0b01_00_01_00>(a, b)),
            F16(_mm512_shuffle_ps::<0b11_10_11_10>(a, b)),
            F16(_mm512_shuffle_ps::<0b01_00_01_00>(c, d)),
            F16(_mm512_shuffle_ps::<0b11_10_11_10>(c, d)),
        ]
    }
}

/// The rows at four places.
#[inline(always)]
unsafe fn four(rows: *const [f32; 4], [a, b, c, d]: [usize; 4]) -> __m512 {
    // SAFETY: as the caller's.
    unsafe {
        let first = _mm512_castps128_ps512(_mm_loadu_ps(rows.byte_add(a).cast()));
        let second = _mm512_insertf32x4::<1>(first, _mm_loadu_ps(rows.byte_add(b).cast()));
        let third = _mm512_insertf32x4::<2>(second, _mm_loadu_ps(rows.byte_add(c).cast()));
        _mm512_insertf32x4::<3>(third, _mm_loadu_ps(rows.byte_add(d).cast()))
    }
}

/// Offsets of rows in bytes.
#[inline(always)]
unsafe fn offsets(at: I16) -> Spilled<__m512i> {
    // SAFETY: as the caller's.
    Spilled::new(unsafe { _mm512_slli_epi32::<4>(at.0) })
}

impl Lanes for Avx512 {
    const N: usize = 16;
    type F = F16;
    type I = I16;
    type M = M16;

    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,popcnt")]
        unsafe fn go<T: Task>(lanes: Avx512, task: T) -> T::Output {
            task.run(lanes)
        }
        // SAFETY: see the module's head.
        unsafe { go(self, task) }
    }

    #[inline(always)]
    fn mask(self, bits: u32) -> M16 {
        M16(bits as u16)
    }

    by! {
        fn splat(self, x: f32) -> F16 = F16(_mm512_set1_ps(x));
        fn splat_int(self, x: i32) -> I16 = I16(_mm512_set1_epi32(x));
        fn load(self, from: &[f32; WIDEST]) -> F16 = F16(_mm512_loadu_ps(from.as_ptr()));
        fn store(self, x: F16) -> [f32; WIDEST] = {
            let mut to = [0.0; WIDEST];
            _mm512_storeu_ps(to.as_mut_ptr(), x.0);
            to
        };
        fn store_int(self, x: I16) -> [i32; WIDEST] = {
            let mut to = [0; WIDEST];
            _mm512_storeu_si512(to.as_mut_ptr().cast(), x.0);
            to
        };
    }

    #[inline(always)]
    unsafe fn pairs(self, codes: *const u16, at: I16) -> (F16, F16) {
        // SAFETY: as the caller promises.
        unsafe {
            let both = _mm512_i32gather_epi32::<2>(at.0, codes.cast());
            let near = _mm512_and_si512(both, _mm512_set1_epi32(0xffff));
            (F16(_mm512_cvtepi32_ps(near)), F16(_mm512_cvtepi32_ps(_mm512_srli_epi32::<16>(both))))
        }
    }

    #[inline(always)]
    unsafe fn words(self, words: *const u32, at: I16) -> I16 {
        // SAFETY: as the caller promises.
        I16(unsafe { _mm512_i32gather_epi32::<4>(at.0, words.cast()) })
    }

    #[inline(always)]
    unsafe fn twos(self, twos: *const [f32; 2], at: I16) -> (F16, F16) {
        // SAFETY: as the caller promises.
        unsafe {
            let (lo, hi) = (_mm512_castsi512_si256(at.0), _mm512_extracti32x8_epi32::<1>(at.0));
            let lo = _mm512_castpd_ps(_mm512_i32gather_pd::<8>(lo, twos.cast()));
            let hi = _mm512_castpd_ps(_mm512_i32gather_pd::<8>(hi, twos.cast()));
            let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
            (F16(_mm512_permutex2var_ps(lo, even, hi)), F16(_mm512_permutex2var_ps(lo, odd, hi)))
        }
    }

    #[inline(always)]
    unsafe fn between_rows(self, rows: *const [f32; 4], at: I16, w: F16) -> [F16; 4] {
        // SAFETY: as the caller promises.
        let i = unsafe { offsets(at) };
        let w = w.0;
        macro_rules! quad {
            ($lane:literal) => {{
                let at = [i.lane($lane), i.lane($lane + 4), i.lane($lane + 8), i.lane($lane + 12)];
                let (a, b) = (four(rows, at), four(rows.add(1), at));
                let w = _mm512_permute_ps::<{ $lane * 0b01_01_01_01 }>(w);
                _mm512_add_ps(a, _mm512_mul_ps(_mm512_sub_ps(b, a), w))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([quad!(0), quad!(1), quad!(2), quad!(3)]) }
    }

    #[inline(always)]
    unsafe fn among_rows(self, rows: *const [f32; 4], at: I16, size: usize, [v, u]: [F16; 2]) -> [F16; 4] {
        // SAFETY: as the caller promises.
        let i = unsafe { offsets(at) };
        let (v, u) = (v.0, u.0);
        macro_rules! quad {
            ($lane:literal) => {{
                let far_rows = rows.add(size);
                let at = [i.lane($lane), i.lane($lane + 4), i.lane($lane + 8), i.lane($lane + 12)];
                let (a, b) = (four(rows, at), four(rows.add(1), at));
                let (c, d) = (four(far_rows, at), four(far_rows.add(1), at));
                let v = _mm512_permute_ps::<{ $lane * 0b01_01_01_01 }>(v);
                let u = _mm512_permute_ps::<{ $lane * 0b01_01_01_01 }>(u);
                let near = _mm512_add_ps(a, _mm512_mul_ps(_mm512_sub_ps(b, a), v));
                let far = _mm512_add_ps(c, _mm512_mul_ps(_mm512_sub_ps(d, c), v));
                _mm512_add_ps(near, _mm512_mul_ps(_mm512_sub_ps(far, near), u))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([quad!(0), quad!(1), quad!(2), quad!(3)]) }
    }
}
