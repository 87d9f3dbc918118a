//! Eight lanes of AVX2.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::super::traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};
use super::spilled::Spilled;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(());

#[derive(Debug, Clone, Copy)]
pub(crate) struct F8(__m256);

#[derive(Debug, Clone, Copy)]
pub(crate) struct I8(__m256i);

/// All bits of a lane, or none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct M8(__m256);

impl Avx2 {
    /// Where the processor has it.
    pub(crate) fn new() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt")).then_some(Self(()))
    }
}

operator!(F8, Add, add, |a, b| _mm256_add_ps(a, b));
operator!(F8, Sub, sub, |a, b| _mm256_sub_ps(a, b));
operator!(F8, Mul, mul, |a, b| _mm256_mul_ps(a, b));
operator!(F8, Div, div, |a, b| _mm256_div_ps(a, b));
operator!(I8, Add, add, |a, b| _mm256_add_epi32(a, b));
operator!(I8, Sub, sub, |a, b| _mm256_sub_epi32(a, b));
operator!(I8, Mul, mul, |a, b| _mm256_mullo_epi32(a, b));
operator!(I8, BitAnd, bitand, |a, b| _mm256_and_si256(a, b));
operator!(M8, BitAnd, bitand, |a, b| _mm256_and_ps(a, b));
operator!(M8, BitOr, bitor, |a, b| _mm256_or_ps(a, b));

impl Neg for F8 {
    type Output = Self;

    by! {
        fn neg(self) -> Self = Self(_mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)));
    }
}

impl Not for M8 {
    type Output = Self;

    by! {
        fn not(self) -> Self = Self(_mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1))));
    }
}

impl Mask for M8 {
    by! {
        fn bits(self) -> u32 = _mm256_movemask_ps(self.0) as u32;
    }
}

impl Floats for F8 {
    type I = I8;
    type M = M8;

    by! {
        fn lt(self, than: Self) -> M8 = M8(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, than.0));
        fn le(self, than: Self) -> M8 = M8(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, than.0));
        fn same(self, as_: Self) -> M8 = M8(_mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, as_.0));
        fn larger(self, than: Self) -> Self = Self(_mm256_max_ps(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(_mm256_min_ps(self.0, than.0));
        fn sqrt(self) -> Self = Self(_mm256_sqrt_ps(self.0));
        fn abs(self) -> Self = Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0));
        fn cut_off(self) -> I8 = I8(_mm256_cvttps_epi32(self.0));
        fn bits(self) -> I8 = I8(_mm256_castps_si256(self.0));
        fn select(mask: M8, yes: Self, no: Self) -> Self = Self(_mm256_blendv_ps(no.0, yes.0, mask.0));
        fn only(self, mask: M8) -> Self = Self(_mm256_and_ps(self.0, mask.0));
    }
}

impl Ints for I8 {
    type F = F8;
    type M = M8;

    by! {
        fn gt(self, than: Self) -> M8 = M8(_mm256_castsi256_ps(_mm256_cmpgt_epi32(self.0, than.0)));
        fn same(self, as_: Self) -> M8 = M8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, as_.0)));
        fn larger(self, than: Self) -> Self = Self(_mm256_max_epi32(self.0, than.0));
        fn smaller(self, than: Self) -> Self = Self(_mm256_min_epi32(self.0, than.0));
        fn shift_right(self, bits: u32) -> Self = Self(_mm256_sra_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn shift_right_unsigned(self, bits: u32) -> Self =
            Self(_mm256_srl_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn count(self, mask: M8) -> Self = Self(_mm256_sub_epi32(self.0, _mm256_castps_si256(mask.0)));
        fn shift_left(self, bits: u32) -> Self = Self(_mm256_sll_epi32(self.0, _mm_cvtsi32_si128(bits as i32)));
        fn floats(self) -> F8 = F8(_mm256_cvtepi32_ps(self.0));
        fn as_bits(self) -> F8 = F8(_mm256_castsi256_ps(self.0));
        fn select(mask: M8, yes: Self, no: Self) -> Self =
            Self(_mm256_castps_si256(_mm256_blendv_ps(_mm256_castsi256_ps(no.0), _mm256_castsi256_ps(yes.0), mask.0)));
    }
}

/// Rows of four lanes apart each other, `[j | j + 4]`, to channels.
#[inline(always)]
unsafe fn transposed([r0, r1, r2, r3]: [__m256; 4]) -> [F8; 4] {
    // SAFETY: as the caller's.
    unsafe {
        let (a, b) = (_mm256_unpacklo_ps(r0, r1), _mm256_unpacklo_ps(r2, r3));
        let (c, d) = (_mm256_unpackhi_ps(r0, r1), _mm256_unpackhi_ps(r2, r3));
        [
            F8(_mm256_shuffle_ps::<0b01_00_01_00>(a, b)),
            F8(_mm256_shuffle_ps::<0b11_10_11_10>(a, b)),
            F8(_mm256_shuffle_ps::<0b01_00_01_00>(c, d)),
            F8(_mm256_shuffle_ps::<0b11_10_11_10>(c, d)),
        ]
    }
}

/// The rows at two places.
#[inline(always)]
unsafe fn two(rows: *const [f32; 4], a: usize, b: usize) -> __m256 {
    // SAFETY: as the caller's.
    unsafe {
        let near = _mm256_castps128_ps256(_mm_loadu_ps(rows.byte_add(a).cast()));
        _mm256_insertf128_ps::<1>(near, _mm_loadu_ps(rows.byte_add(b).cast()))
    }
}

/// Offsets of rows in bytes.
#[inline(always)]
unsafe fn offsets(at: I8) -> Spilled<__m256i> {
    // SAFETY: as the caller's.
    Spilled::new(unsafe { _mm256_slli_epi32::<4>(at.0) })
}

impl Lanes for Avx2 {
    const N: usize = 8;
    type F = F8;
    type I = I8;
    type M = M8;

    #[inline(never)]
    fn enter<T: Task>(self, task: T) -> T::Output {
        #[target_feature(enable = "avx2,popcnt")]
        unsafe fn go<T: Task>(lanes: Avx2, task: T) -> T::Output {
            task.run(lanes)
        }
        // SAFETY: see the module's head.
        unsafe { go(self, task) }
    }

    by! {
        fn splat(self, x: f32) -> F8 = F8(_mm256_set1_ps(x));
        fn splat_int(self, x: i32) -> I8 = I8(_mm256_set1_epi32(x));
        fn mask(self, bits: u32) -> M8 = {
            let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lane);
            M8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lane)))
        };
        fn load(self, from: &[f32; WIDEST]) -> F8 = F8(_mm256_loadu_ps(from.as_ptr()));
        fn store(self, x: F8) -> [f32; WIDEST] = {
            let mut to = [0.0; WIDEST];
            _mm256_storeu_ps(to.as_mut_ptr(), x.0);
            to
        };
        fn store_int(self, x: I8) -> [i32; WIDEST] = {
            let mut to = [0; WIDEST];
            _mm256_storeu_si256(to.as_mut_ptr().cast(), x.0);
            to
        };
    }

    #[inline(always)]
    unsafe fn pairs(self, codes: *const u16, at: I8) -> (F8, F8) {
        // SAFETY: as the caller promises.
        unsafe {
            let both = _mm256_i32gather_epi32::<2>(codes.cast(), at.0);
            let near = _mm256_and_si256(both, _mm256_set1_epi32(0xffff));
            (F8(_mm256_cvtepi32_ps(near)), F8(_mm256_cvtepi32_ps(_mm256_srli_epi32::<16>(both))))
        }
    }

    #[inline(always)]
    unsafe fn words(self, words: *const u32, at: I8) -> I8 {
        // SAFETY: as the caller promises.
        I8(unsafe { _mm256_i32gather_epi32::<4>(words.cast(), at.0) })
    }

    #[inline(always)]
    unsafe fn twos(self, twos: *const [f32; 2], at: I8) -> (F8, F8) {
        // SAFETY: as the caller promises.
        unsafe {
            let (lo, hi) = (_mm256_castsi256_si128(at.0), _mm256_extracti128_si256::<1>(at.0));
            let lo = _mm256_castpd_ps(_mm256_i32gather_pd::<8>(twos.cast(), lo));
            let hi = _mm256_castpd_ps(_mm256_i32gather_pd::<8>(twos.cast(), hi));
            // Quarters lie as 0 2 1 3.
            let (first, second) =
                (_mm256_shuffle_ps::<0b10_00_10_00>(lo, hi), _mm256_shuffle_ps::<0b11_01_11_01>(lo, hi));
            let first = _mm256_permute4x64_pd::<0b11_01_10_00>(_mm256_castps_pd(first));
            let second = _mm256_permute4x64_pd::<0b11_01_10_00>(_mm256_castps_pd(second));
            (F8(_mm256_castpd_ps(first)), F8(_mm256_castpd_ps(second)))
        }
    }

    #[inline(always)]
    unsafe fn between_rows(self, rows: *const [f32; 4], at: I8, w: F8) -> [F8; 4] {
        // SAFETY: as the caller promises.
        let i = unsafe { offsets(at) };
        let w = w.0;
        macro_rules! pair {
            ($lane:literal) => {{
                let (i, j) = (i.lane($lane), i.lane($lane + 4));
                let (a, b) = (two(rows, i, j), two(rows.add(1), i, j));
                let w = _mm256_permute_ps::<{ $lane * 0b01_01_01_01 }>(w);
                _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), w))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([pair!(0), pair!(1), pair!(2), pair!(3)]) }
    }

    #[inline(always)]
    unsafe fn among_rows(self, rows: *const [f32; 4], at: I8, size: usize, [v, u]: [F8; 2]) -> [F8; 4] {
        // SAFETY: as the caller promises.
        let i = unsafe { offsets(at) };
        let (v, u) = (v.0, u.0);
        macro_rules! pair {
            ($lane:literal) => {{
                let far_rows = rows.add(size);
                let (i, j) = (i.lane($lane), i.lane($lane + 4));
                let (a, b) = (two(rows, i, j), two(rows.add(1), i, j));
                let (c, d) = (two(far_rows, i, j), two(far_rows.add(1), i, j));
                let v = _mm256_permute_ps::<{ $lane * 0b01_01_01_01 }>(v);
                let u = _mm256_permute_ps::<{ $lane * 0b01_01_01_01 }>(u);
                let near = _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), v));
                let far = _mm256_add_ps(c, _mm256_mul_ps(_mm256_sub_ps(d, c), v));
                _mm256_add_ps(near, _mm256_mul_ps(_mm256_sub_ps(far, near), u))
            }};
        }
        // SAFETY: as the caller promises.
        unsafe { transposed([pair!(0), pair!(1), pair!(2), pair!(3)]) }
    }
}
