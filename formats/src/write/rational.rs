//! The nearest fraction of two numbers of 32 bits.

/// By continued fractions: decimals of a few digits come out as they are. `value` is above 0.
pub(super) fn rational(value: f64) -> (u32, u32) {
    let (mut before, mut now) = ((0u64, 1u64), (1u64, 0u64));
    let mut rest = value;
    for _ in 0..40 {
        let whole = rest.floor();
        if !(0.0..=f64::from(u32::MAX)).contains(&whole) {
            break;
        }
        let step = |a: u64, b: u64| b.checked_add((whole as u64).checked_mul(a)?).filter(|n| *n <= u64::from(u32::MAX));
        let (Some(n), Some(d)) = (step(now.0, before.0), step(now.1, before.1)) else { break };
        (before, now) = (now, (n, d));
        if (n as f64 / d as f64 - value).abs() <= value * 1e-12 {
            break;
        }
        rest = 1.0 / (rest - whole);
    }
    match now {
        (n, d) if n > 0 && d > 0 => (n as u32, d as u32),
        // Larger or smaller than any.
        _ if value < 1.0 => (1, u32::MAX),
        _ => (u32::MAX, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_exact_and_others_near() {
        assert_eq!(rational(0.5), (1, 2));
        assert_eq!(rational(1.0 / 0.0123), (10_000, 123));
        assert_eq!(rational(3.0), (3, 1));
        for value in [std::f64::consts::PI, 1e-5, 12_345.678, 1.0 / 3.0, 4e9, 1e-9] {
            let (n, d) = rational(value);
            assert!((f64::from(n) / f64::from(d) - value).abs() <= 1e-9 * value, "{value}: {n}/{d}");
        }
        assert_eq!((rational(1e-12), rational(1e12)), ((1, u32::MAX), (u32::MAX, 1)));
    }
}
