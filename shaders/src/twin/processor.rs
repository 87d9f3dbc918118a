//! What instruction sets do better than the language: each function has a body for every set, and one for all others.
//! Nothing else in this crate names a set.

use glam::Vec4;

/// The integer part of what an i32 can hold; one instruction, which `as` is not.
#[inline(always)]
pub(super) fn cut_off(x: f32) -> i32 {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_cvttss_si32, _mm_set_ss};
        // SAFETY: there is no such processor without SSE.
        unsafe { _mm_cvttss_si32(_mm_set_ss(x)) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        x as i32
    }
}

/// The integer parts of what an i32 can hold.
#[inline(always)]
pub(super) fn whole(x: Vec4) -> Vec4 {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_cvtepi32_ps, _mm_cvttps_epi32};
        // SAFETY: there is no such processor without SSE2.
        unsafe { _mm_cvtepi32_ps(_mm_cvttps_epi32(x.into())) }.into()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        x.trunc()
    }
}

/// Whole numbers from 0 on.
#[inline(always)]
pub(super) fn indices(x: Vec4) -> [usize; 4] {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_mm_cvttps_epi32, _mm_storeu_si128};
        let mut indices = [0_u32; 4];
        // SAFETY: as above; the array has the size of what is stored.
        unsafe { _mm_storeu_si128(indices.as_mut_ptr().cast(), _mm_cvttps_epi32(x.into())) };
        indices.map(|i| i as usize)
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        x.to_array().map(|i| i as usize)
    }
}

/// The codes at four places, and those behind them.
///
/// # Safety
/// Every place and the one behind it lie within `codes`.
#[inline(always)]
pub(super) unsafe fn pairs(codes: &[u16], at: [usize; 4]) -> (Vec4, Vec4) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{
            __m128i, _mm_and_si128, _mm_cvtepi32_ps, _mm_cvtsi32_si128, _mm_set1_epi32, _mm_srli_epi32,
            _mm_unpacklo_epi32, _mm_unpacklo_epi64,
        };
        // SAFETY: as the caller promises.
        let pair =
            |lane: usize| unsafe { _mm_cvtsi32_si128(codes.as_ptr().add(at[lane]).cast::<i32>().read_unaligned()) };
        // SAFETY: there is no such processor without SSE2.
        unsafe {
            let [a, b] = [_mm_unpacklo_epi32(pair(0), pair(1)), _mm_unpacklo_epi32(pair(2), pair(3))];
            let both: __m128i = _mm_unpacklo_epi64(a, b);
            let first = _mm_cvtepi32_ps(_mm_and_si128(both, _mm_set1_epi32(0xffff)));
            (first.into(), _mm_cvtepi32_ps(_mm_srli_epi32::<16>(both)).into())
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        // SAFETY: as the caller promises.
        let code = |i: usize| f32::from(unsafe { *codes.get_unchecked(i) });
        let [a, b, c, d] = at;
        (Vec4::new(code(a), code(b), code(c), code(d)), Vec4::new(code(a + 1), code(b + 1), code(c + 1), code(d + 1)))
    }
}

/// Says that what lies at `address` will be read: a hint, whatever the address.
#[inline(always)]
pub(super) fn prefetch<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint; it reads nothing, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
