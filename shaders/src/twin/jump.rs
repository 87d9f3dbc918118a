//! `wgsl/shared/jump.wgsl` on the CPU: how far a ray may go at once.

use super::ray::{FAR, Ray, rounded_up};
/// The first sample that the brick does not own: the first k with `k * step >= t_out`.
#[inline(always)]
pub(crate) fn first_outside(step: f32, k: f32, t_out: f32) -> f32 {
    let mut k_out = rounded_up(t_out / step).max(k + 1.0);
    // The quotient errs by a few units in the last place, the product decides.
    for _ in 0..2 {
        if k_out > k + 1.0 && (k_out - 1.0) * step >= t_out {
            k_out -= 1.0;
        }
    }
    for _ in 0..2 {
        if k_out * step < t_out {
            k_out += 1.0;
        }
    }
    k_out
}

/// Where the ray leaves the cube about `center`; t.
#[inline(always)]
pub(super) fn leaves(ray: &Ray, center: [f32; 3], half: f32) -> f32 {
    let mut t_out = FAR;
    for (a, middle) in center.into_iter().enumerate() {
        let d = ray.direction[a];
        if d != 0.0 {
            let plane = if d > 0.0 { middle + half } else { middle - half };
            t_out = t_out.min((plane - ray.origin[a]) * ray.inverse[a]);
        }
    }
    t_out
}

/// The opacity of `n` samples of opacity `alpha`: by squaring, as exact as n single ones. What is left of `n` beyond
/// whole numbers is a sum of halves of halves, and taken by square roots.
#[inline(always)]
pub(crate) fn opacity_of(alpha: f32, n: f32) -> f32 {
    let (mut clear, mut square, mut left) = (1.0, 1.0 - alpha, n as u32);
    let (mut root, mut part) = (square, n - left as f32);
    while left > 0 {
        if left & 1 == 1 {
            clear *= square;
        }
        square *= square;
        left >>= 1;
    }
    while part > 0.0 {
        root = root.sqrt();
        part *= 2.0;
        if part >= 1.0 {
            clear *= root;
            part -= 1.0;
        }
    }
    1.0 - clear
}
