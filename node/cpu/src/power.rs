//! The twin's powers in every lane (`shaders/src/twin/power.rs`).

use brickcast_shaders::twin::power::{EXP2, EXP2_FROM, EXP2_TO, LOG2, MANTISSA_FROM};

use super::lanes::{Floats, Ints, Lanes};

/// `x^y`.
#[inline(always)]
pub(crate) fn power<L: Lanes>(l: L, x: L::F, y: L::F) -> L::F {
    let zero = l.splat(0.0);
    let of_zero = L::F::select(zero.lt(y), zero, l.splat(1.0));
    L::F::select(zero.lt(x), exp2(l, y * log2(l, x)), of_zero)
}

#[inline(always)]
fn log2<L: Lanes>(l: L, x: L::F) -> L::F {
    let (bits, one) = (x.bits(), l.splat(1.0));
    let exponent = (bits - l.splat_int(MANTISSA_FROM)).shift_right(23);
    let mantissa = (bits - exponent.shift_left(23)).as_bits();
    let s = (mantissa - one) / (mantissa + one);
    let z = s * s;
    let mut series = l.splat(LOG2[5]);
    for of in [LOG2[4], LOG2[3], LOG2[2], LOG2[1], LOG2[0]] {
        series = l.splat(of) + z * series;
    }
    exponent.floats() + s * series
}

#[inline(always)]
fn exp2<L: Lanes>(l: L, t: L::F) -> L::F {
    let t = t.smaller(l.splat(EXP2_TO));
    let whole = (t + l.splat(256.5)).cut_off() - l.splat_int(256);
    let f = t - whole.floats();
    let mut series = l.splat(EXP2[7]);
    for of in [EXP2[6], EXP2[5], EXP2[4], EXP2[3], EXP2[2], EXP2[1], EXP2[0]] {
        series = l.splat(of) + f * series;
    }
    let scale = (whole + l.splat_int(127)).shift_left(23).as_bits();
    L::F::select(t.lt(l.splat(EXP2_FROM)), l.splat(0.0), series * scale)
}
