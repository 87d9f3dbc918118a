//! The definition of the tables, slab by slab in O(n^3): what [`super::Preintegrated`] is tested and timed against.

use super::{Element, Elements};

/// Premultiplied r, g, b and opacity of the slab from entry `front` to entry `back`, `length` opacity units long, and
/// its back-weighted part: colour and opacity of every element times how far from the front its light comes from, 0..1.
///
/// Elements are composited one behind the other, from the front. A slab of one entry is that entry itself.
#[must_use]
pub fn slab(elements: &Elements, length: f64, front: usize, back: usize) -> [[f64; 4]; 2] {
    if front == back {
        let entry = &elements.entries[front];
        let opacity = entry.opacity(length);
        let total = premultiplied(entry.color, opacity);
        let depth = mean_depth(&elements.entries[front], length);
        return [total, total.map(|v| depth * v)];
    }
    let (low, high) = (front.min(back), front.max(back));
    let width = f64::from(elements.nodes[high] - elements.nodes[low]);
    let mut pieces: Vec<_> = elements.pieces[elements.first[low]..elements.first[high]].to_vec();
    if front > back {
        pieces.reverse();
    }
    let (mut total, mut weighted, mut through, mut passed) = ([0.0; 4], [0.0; 4], 1.0, 0.0);
    for (_, wide, element) in pieces {
        let wide = f64::from(wide) / width;
        let share = length * wide;
        let own = premultiplied(element.color, element.opacity(share));
        let weight = passed + mean_depth(&element, share) * wide;
        for c in 0..4 {
            total[c] += through * own[c];
            weighted[c] += through * own[c] * weight;
        }
        through *= 1.0 - own[3];
        passed += wide;
    }
    [total, weighted]
}

/// Where the light of a homogeneous element comes from on average, as a share of its length from the front: the mean of
/// u under `exp(-tau u)`, `1 / tau - 1 / (exp(tau) - 1)`, by its series (Bernoulli's numbers) where the two cancel.
fn mean_depth(element: &Element, length: f64) -> f64 {
    let tau = -element.log_transparency * length;
    if tau > 0.5 {
        return 1.0 / tau - 1.0 / tau.exp_m1();
    }
    let square = tau * tau;
    let terms = [-1.0 / 12.0, 1.0 / 720.0, -1.0 / 30_240.0, 1.0 / 1_209_600.0, -1.0 / 47_900_160.0];
    0.5 + tau * terms.iter().rev().fold(0.0, |sum, term| sum * square + term)
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
