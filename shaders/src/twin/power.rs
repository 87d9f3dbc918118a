//! Powers, from + - * / alone: the same bits on every processor, by one ray and by many side by side. A library's
//! differ from system to system in the last bits.

/// Of the mantissa's range `[sqrt(1/2), sqrt(2))`: the bits of its lower end.
pub const MANTISSA_FROM: i32 = 0x3f35_04f3;
/// Of `log2((1 + s) / (1 - s)) / s` by powers of s²: 2 / ln 2 by 1, 1/3, 1/5, ...; what is left out is below 2^-29.
pub const LOG2: [f32; 6] = [2.885_39, 0.961_796_7, 0.577_078, 0.412_198_6, 0.320_598_9, 0.262_308_2];
/// Of `2^f`, |f| <= 1/2, by powers of f: (ln 2)^n / n!; what is left out is below 2^-26.
pub const EXP2: [f32; 8] = [
    1.0,
    std::f32::consts::LN_2,
    0.240_226_5,
    0.055_504_11,
    0.009_618_129,
    0.001_333_355_8,
    0.000_154_035_3,
    0.000_015_252_734,
];
/// `2^t` is 0 below: no denormals.
pub const EXP2_FROM: f32 = -126.0;
/// And no larger than at this.
pub const EXP2_TO: f32 = 127.0;

/// `x^y` for x in 0..=1 (or a little above) and y from 0 on: within 4e-7, relative to the power plus 1e-6 of
/// `|y log2 x|`. 0^0 is 1; what is not positive counts as 0.
#[must_use]
#[inline(always)]
pub fn power(x: f32, y: f32) -> f32 {
    if x > 0.0 {
        exp2(y * log2(x))
    } else if y > 0.0 {
        0.0
    } else {
        1.0
    }
}

/// Of what is positive.
#[inline(always)]
fn log2(x: f32) -> f32 {
    let bits = x.to_bits() as i32;
    let exponent = bits.wrapping_sub(MANTISSA_FROM) >> 23;
    let mantissa = f32::from_bits(bits.wrapping_sub(exponent << 23) as u32);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let z = s * s;
    let series = LOG2[0] + z * (LOG2[1] + z * (LOG2[2] + z * (LOG2[3] + z * (LOG2[4] + z * LOG2[5]))));
    exponent as f32 + s * series
}

#[inline(always)]
fn exp2(t: f32) -> f32 {
    // As `f32::min` but for what is not a number.
    let t = if t < EXP2_TO { t } else { EXP2_TO };
    if t < EXP2_FROM {
        return 0.0;
    }
    // The nearest whole number: the sum is positive, so that cutting off rounds down.
    let whole = (t + 256.5) as i32 - 256;
    let f = t - whole as f32;
    let [a, b, c, d, e, g, h, i] = EXP2;
    let series = a + f * (b + f * (c + f * (d + f * (e + f * (g + f * (h + f * i))))));
    series * f32::from_bits(((whole + 127) << 23) as u32)
}

#[cfg(test)]
mod tests {
    use super::power;

    #[test]
    fn powers_are_those_of_double_precision() {
        let mut worst = (0.0, 0.0, 0.0);
        for i in 0..=4000 {
            for y in [0.0_f32, 0.01, 0.37, 1.0, 1.5, 2.0, 8.0, 20.0, 32.0, 100.0, 777.0, 4000.0] {
                // Densely where powers are steep: near 1, and by orders of magnitude.
                for x in [i as f32 / 4000.0, 1.0 - (i as f32 / 4000.0).powi(4), (i as f32 * -0.02).exp()] {
                    let want = f64::from(x).powf(f64::from(y));
                    let got = f64::from(power(x, y));
                    let rounded = if x > 0.0 { f64::from(x).log2().abs() * f64::from(y) * 1e-6 } else { 0.0 };
                    let error = (got - want).abs() / (want * (4e-7 + rounded) + 2e-38);
                    if error > worst.0 {
                        worst = (error, x, y);
                    }
                }
            }
        }
        assert!(worst.0 < 1.0, "{worst:?}");
    }

    #[test]
    fn what_is_exact_stays_so() {
        for y in [0.0, 0.3, 1.0, 50.0] {
            assert_eq!(power(1.0, y), 1.0);
        }
        assert_eq!((power(0.0, 0.0), power(0.0, 2.0), power(-1.0, 2.0), power(f32::NAN, 1.0)), (1.0, 0.0, 0.0, 0.0));
        assert_eq!((power(0.5, 3.0), power(0.25, 0.5), power(0.5, 1.0)), (0.125, 0.5, 0.5));
        assert_eq!(power(0.5, 200.0), 0.0);
        assert!(power(f32::MIN_POSITIVE / 3.0, 0.5) < 2e-19);
    }
}
