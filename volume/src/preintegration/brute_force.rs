//! The definition of the tables, slab by slab in O(n^3): what [`super::Preintegrated`] is tested and timed against.

use super::Elements;

/// Premultiplied r, g, b and opacity of the slab from entry `front` to entry `back`, `length` opacity units long, and its
/// back-weighted part: colour and opacity of every element times how far its middle lies from the front, 0..1.
///
/// Elements are composited one behind the other, from the front. A slab of one entry is that entry itself; half of its
/// colour counts to either end.
#[must_use]
pub fn slab(elements: &Elements, length: f64, front: usize, back: usize) -> [[f64; 4]; 2] {
    let count = front.abs_diff(back);
    if count == 0 {
        let entry = &elements.entries[front];
        let opacity = entry.opacity(length);
        let total = premultiplied(entry.color, opacity);
        return [total, total.map(|v| 0.5 * v)];
    }
    let share = length / count as f64;
    let (mut total, mut weighted, mut through) = ([0.0; 4], [0.0; 4], 1.0);
    for k in 0..count {
        let element = &elements.between[if front < back { front + k } else { front - 1 - k }];
        let own = premultiplied(element.color, element.opacity(share));
        let weight = (k as f64 + 0.5) / count as f64;
        for c in 0..4 {
            total[c] += through * own[c];
            weighted[c] += through * own[c] * weight;
        }
        through *= 1.0 - own[3];
    }
    [total, weighted]
}

/// All slabs, index `front * n + back`.
#[must_use]
pub fn table(elements: &Elements, length: f64) -> Vec<[[f64; 4]; 2]> {
    let n = elements.entries.len();
    (0..n * n).map(|index| slab(elements, length, index / n, index % n)).collect()
}

fn premultiplied([r, g, b]: [f64; 3], opacity: f64) -> [f64; 4] {
    [r * opacity, g * opacity, b * opacity, opacity]
}
