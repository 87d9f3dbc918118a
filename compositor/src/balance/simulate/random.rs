//! Numbers that depend on their seed alone, in any order of asking.

/// Mixes words into one (splitmix64, Steele et al. 2014).
pub(super) fn hash(words: &[u64]) -> u64 {
    words.iter().fold(0x5851_F42D_4C95_7F2D, |state, word| {
        let mut z = (state ^ word).wrapping_add(0x9E37_79B9_7F4A_7C15);
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    })
}

/// In `[0, 1)`.
pub(super) fn uniform(words: &[u64]) -> f64 {
    (hash(words) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Around 1, with this standard deviation, never below 0.1: a sum of three uniforms.
pub(super) fn noise(deviation: f64, words: &[u64]) -> f64 {
    let mut all = words.to_vec();
    all.push(0);
    let mut sum = 0.0;
    for i in 0..3 {
        all[words.len()] = i;
        sum += uniform(&all) - 0.5;
    }
    // Three uniforms of width 1 have a variance of a quarter.
    (1.0 + 2.0 * deviation * sum).max(0.1)
}
