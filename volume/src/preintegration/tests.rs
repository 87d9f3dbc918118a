use proptest::prelude::*;

use super::*;
use crate::transfer_function::{ColorPoint, Colormap, OpacityPoint, TransferFunction, TransferTable};

const LENGTHS: [f64; 6] = [0.01, 0.3, 0.5, 1.0, 4.0, 16.0];

type Wide = Vec<[f64; 4]>;

/// Total, front and back before they are packed.
fn wide(elements: &Elements, length: f64) -> [Wide; 3] {
    subranges::integrate::<8, 3, [f64; 4]>(elements, length)
}

fn close(got: [f64; 4], want: [f64; 4], within: f64, what: &str) {
    assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() <= within), "{what}: {got:?} is not {want:?}");
}

fn function(colors: &[(f64, [f64; 3])], opacities: &[(f64, f64)]) -> TransferFunction {
    let colors = colors.iter().map(|&(x, rgb)| ColorPoint { x, rgb }).collect();
    TransferFunction::new(colors, opacities.iter().map(|&(x, opacity)| OpacityPoint { x, opacity }).collect()).unwrap()
}

/// Colours and opacities that change at places of their own, with steps, full opacity and nothing.
fn lively() -> TransferFunction {
    function(
        &[(0.0, [0.1, 0.9, 0.4]), (0.3, [1.0, 0.0, 0.2]), (0.31, [0.0, 0.3, 1.0]), (0.9, [0.6, 0.6, 0.0])],
        &[(0.0, 0.2), (0.1, 0.0), (0.25, 0.0), (0.3, 1.0), (0.35, 1.0), (0.36, 0.05), (0.8, 0.7), (1.0, 0.0)],
    )
}

fn noisy(n: usize, seed: u64) -> Elements {
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut element = || {
        let color = [random(), random(), random()];
        let opacity = if random() < 0.3 { 0.0 } else { random().powi(4).min(MAX_OPACITY) };
        Element { color, log_transparency: (-opacity).ln_1p() }
    };
    let entries = (0..n).map(|_| element()).collect();
    Elements { c_first: 0.0, c_last: 1.0, entries, between: (1..n).map(|_| element()).collect() }
}

#[test]
fn all_slabs_are_those_of_brute_force() {
    for (n, seed) in [(2, 1), (3, 2), (4, 3), (5, 4), (16, 5), (33, 6), (100, 7), (128, 8)] {
        for elements in [noisy(n, seed), Elements::of(&lively(), (0.0, 1.0), n)] {
            for length in LENGTHS {
                let [total, front, back] = wide(&elements, length);
                let [alone] = subranges::integrate::<4, 1, [f64; 4]>(&elements, length);
                for (index, [whole, weighted]) in brute_force::table(&elements, length).into_iter().enumerate() {
                    let what = format!("{} to {} of {n}, length {length}", index / n, index % n);
                    close(total[index], whole, 1e-12, &what);
                    close(alone[index], whole, 1e-12, &what);
                    close(back[index], weighted, 1e-12, &what);
                    let rest = [0, 1, 2, 3].map(|c| if c < 3 { whole[c] - weighted[c] } else { whole[3] });
                    close(front[index], rest, 1e-12, &what);
                }
            }
        }
    }
}

#[test]
fn opacity_has_a_closed_form() {
    let elements = Elements::of(&lively(), (0.0, 1.0), 97);
    for length in LENGTHS {
        let [total, ..] = wide(&elements, length);
        for i in 0..97 {
            for j in (0..97).filter(|&j| j != i) {
                let through = &elements.between[i.min(j)..i.max(j)];
                let mean = through.iter().map(|e| e.log_transparency).sum::<f64>() / through.len() as f64;
                let (got, want) = (total[i * 97 + j][3], 1.0 - (length * mean).exp());
                assert!((got - want).abs() < 1e-12, "{i} to {j}, length {length}: {got} {want}");
            }
        }
    }
}

#[test]
fn back_to_front_is_front_to_back_of_the_reversed_function() {
    let n = 61;
    let mut reversed = noisy(n, 9);
    let forward = reversed.clone();
    reversed.entries.reverse();
    reversed.between.reverse();
    let (tables, mirrored) = (wide(&forward, 2.0), wide(&reversed, 2.0));
    for (table, mirror) in tables.iter().zip(&mirrored) {
        for i in 0..n {
            for j in 0..n {
                let (here, there) = (table[i * n + j], mirror[(n - 1 - i) * n + n - 1 - j]);
                close(here, there, 1e-12, &format!("{i} to {j}"));
            }
        }
    }
    // Front and back differ: the mirror is no copy.
    assert!((0..n * n).any(|k| (tables[0][k][0] - tables[0][k % n * n + k / n][0]).abs() > 0.1));
}

/// A function without features: every slab is the same, and its lighting has a closed form.
#[test]
fn a_constant_function_has_one_slab() {
    for opacity in [0.0, 1e-9, 0.3, 0.9, 1.0] {
        let f = function(&[(0.0, [0.2, 0.5, 1.0])], &[(0.0, opacity)]);
        let elements = Elements::of(&f, (-5.0, 7.0), 50);
        for length in LENGTHS {
            let depth = -(-opacity.min(MAX_OPACITY)).ln_1p() * length;
            let alpha = -(-depth).exp_m1();
            let [total, front, back] = wide(&elements, length);
            for index in 0..total.len() {
                let want = [0.2 * alpha, 0.5 * alpha, alpha, alpha];
                close(total[index], want, 1e-12, &format!("{index}, opacity {opacity}, length {length}"));
                let sum = [0, 1, 2].map(|c| front[index][c] + back[index][c]);
                close([sum[0], sum[1], sum[2], front[index][3]], want, 1e-12, "front and back");
            }
            // The integral of t exp(-depth t) depth over 0..1, which 49 elements come close to.
            if depth > 1e-3 && depth < 1.0 {
                let want = (1.0 - (1.0 + depth) * (-depth).exp()) / depth;
                assert!((back[49][3] - want).abs() < 1e-3 && (back[49 * 50][3] - want).abs() < 1e-3, "{depth}");
            }
        }
    }
}

#[test]
fn full_opacity_is_all_but_opaque_and_hides_what_is_behind() {
    let (red, green) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let f = function(&[(0.0, red), (0.5, red), (0.51, green), (1.0, green)], &[(0.0, 1.0)]);
    for length in [1.0, 16.0] {
        let p = Preintegrated::with_entries(&f, (0.0, 1.0), length, 101, true);
        let alpha = 1.0 - 1e-6_f32.powf(length as f32);
        assert!(p.total.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
        assert!(p.total.iter().all(|e| (e[3] - alpha).abs() < 1e-6));
        let (red_first, green_first) = (p.total[100], p.total[100 * 101]);
        assert!(red_first[0] > 0.99 && red_first[1] < 0.01, "{red_first:?}");
        assert!(green_first[1] > 0.99 && green_first[0] < 0.01, "{green_first:?}");
    }
}

/// Between entries 50 and 51, seen by neither: optical depth is that of the function itself.
#[test]
fn a_spike_between_entries_is_seen() {
    let [from, to] = [50.3, 50.5].map(|x| x / 100.0);
    let opacities = [(0.0, 0.0), (from, 0.0), (from + 1e-9, 0.6), (to, 0.6), (to + 1e-9, 0.0), (1.0, 0.0)];
    let colors = [(0.0, [1.0, 0.0, 0.0]), (from, [1.0, 0.0, 0.0]), (from + 1e-9, [0.0, 1.0, 0.0])];
    let p = Preintegrated::with_entries(&function(&colors, &opacities), (0.0, 1.0), 1.0, 101, true);
    assert!((0..101).all(|i| p.total[i * 101 + i] == [0.0; 4]), "no entry lies in the spike");
    for (front, back) in [(50, 51), (51, 50), (0, 100), (100, 0), (40, 60)] {
        let [r, g, b, a] = p.total[front * 101 + back];
        let through = front.abs_diff(back) as f64;
        let want = (1.0 - 0.4_f64.powf(0.2 / through)) as f32;
        assert!((a - want).abs() < 1e-6, "{front} to {back}: {a} {want}");
        assert!((g - a).abs() < 1e-6 && r < 1e-6 && b == 0.0, "its own colour: {r} {g} {b}");
    }
    assert!(p.total[50] == [0.0; 4] && p.total[51 * 101 + 100] == [0.0; 4], "before and behind it nothing is");
}

/// The mean of an element, against many small steps.
#[test]
fn elements_hold_the_mean_of_the_function() {
    let f = lively();
    for n in [2, 3, 11, 256] {
        let elements = Elements::of(&f, (0.0, 1.0), n);
        let (first, width) = (f64::from(elements.c_first), f64::from(elements.c_last - elements.c_first));
        for (x, element) in elements.between.iter().enumerate() {
            let (mut depth, mut color) = (0.0, [0.0; 3]);
            for k in 0..4000 {
                let at = first + width * (x as f64 + (f64::from(k) + 0.5) / 4000.0) / (n - 1) as f64;
                let l = (-f.opacity(at).min(MAX_OPACITY)).ln_1p() / 4000.0;
                depth += l;
                color = [0, 1, 2].map(|c| color[c] + l * f.color(at)[c]);
            }
            assert!((element.log_transparency - depth).abs() < 4e-3, "{x} of {n}: {element:?} {depth}");
            if depth < -1e-3 {
                let want = color.map(|c| c / depth);
                assert!(element.color.iter().zip(want).all(|(g, w)| (g - w).abs() < 4e-3), "{x}: {element:?} {want:?}");
            }
        }
    }
}

/// More and more entries tend to the same slab.
#[test]
fn tables_of_any_size_agree_on_the_slab_from_end_to_end() {
    let ends = |n: usize| {
        let p = Preintegrated::with_entries(&lively(), (0.0, 1.0), 1.0, n, false);
        [p.total[n - 1], p.total[(n - 1) * n]]
    };
    let finest = ends(600);
    for (n, within) in [(16, 0.1), (64, 0.02), (256, 0.005)] {
        for (got, want) in ends(n).into_iter().flatten().zip(finest.into_iter().flatten()) {
            assert!((got - want).abs() < within, "{n}: {got} {want}");
        }
    }
}

#[test]
fn packed_tables_stand_at_the_codes_of_the_transfer_table() {
    let f = TransferFunction::window(300.0, 700.0, 0.8, Colormap::Viridis).unwrap();
    for (size, lit) in [(TableSize::N256, true), (TableSize::N256, false), (TableSize::N1024, true)] {
        let p = Preintegrated::build(&f, (0.0, 1000.0), 0.5, size, lit);
        let n = size.entries();
        let table = TransferTable::with_entries(&f, (0.0, 1000.0), 0.5, n);
        assert_eq!((p.size, p.c_first, p.c_last), (n, table.c_first, table.c_last));
        assert_eq!((p.total.len(), p.lit.is_some()), (n * n, lit));
        for (i, &[r, g, b, a]) in table.entries.iter().enumerate() {
            let want = [r * a, g * a, b * a, a];
            close(p.total[i * n + i].map(f64::from), want.map(f64::from), 1e-6, &format!("entry {i}"));
        }
        let Some(lit) = p.lit else { continue };
        for ((total, front), back) in p.total.iter().zip(&lit.front).zip(&lit.back) {
            assert!((0..3).all(|c| (front[c] + back[c] - total[c]).abs() <= 2.0 * f32::EPSILON * total[c]));
            assert!(front[3] == total[3] && (0.0..=total[3]).contains(&back[3]));
        }
    }
}

#[test]
fn volumes_and_tables_without_width_are_no_trouble() {
    for range in [(5.0, 5.0), (0.0, 0.0), (-3.0, -3.0)] {
        for n in [0, 1, 2, 9] {
            let p = Preintegrated::with_entries(&lively(), range, 1.0, n, true);
            assert_eq!(p.size, n.max(2));
            let want =
                Element { color: lively().color(range.0), log_transparency: (-lively().opacity(range.0)).ln_1p() };
            let a = want.opacity(1.0);
            let want = [want.color[0] * a, want.color[1] * a, want.color[2] * a, a];
            assert!(p.total.iter().all(|e| e.iter().zip(want).all(|(g, w)| (f64::from(*g) - w).abs() < 1e-6)));
        }
    }
}

/// Mostly nothing, with spikes of any width, many of them between two entries.
fn spiky() -> impl Strategy<Value = TransferFunction> {
    let width = prop_oneof![Just(0.0), 1e-9..1e-3_f64, 1e-3..20.0_f64];
    let ends = prop_oneof![Just(vec![]), Just(vec![(0.0, 0.0), (1000.0, 0.0)])];
    (ends, proptest::collection::vec((0.0..1000.0_f64, width, 0.0..1.0_f64), 1..5)).prop_map(|(mut points, spikes)| {
        for (x, width, opacity) in spikes {
            points.extend([(x - width - 1e-6, 0.0), (x - width, opacity), (x + width + 1e-9, opacity)]);
            points.push((x + width + 1e-6, 0.0));
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0 == b.0);
        function(&[(0.0, [1.0; 3])], &points)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Wrong in the other direction, a macrocell would be skipped of which slabs are seen.
    #[test]
    fn slabs_between_codes_of_an_empty_range_are_nothing(
        f in spiky(),
        length in 0.01..16.0_f64,
        n in prop_oneof![Just(256_usize), 16..100_usize],
        ranges in proptest::collection::vec((any::<u16>(), 0..9000_u16), 40),
    ) {
        let p = Preintegrated::with_entries(&f, (0.0, 1000.0), length, n, true);
        let table = TransferTable::with_entries(&f, (0.0, 1000.0), length, n);
        let counts = table.opaque_counts();
        let lit = p.lit.as_ref().unwrap();
        for (min, extent) in ranges {
            let max = min.saturating_add(extent);
            let empty = table.is_empty_over(min, max);
            prop_assert_eq!(empty, counts[usize::from(max)][1] == counts[usize::from(min)][0]);
            if !empty {
                continue;
            }
            // Bilinear lookups see from the entry below the lowest position to the one above the highest.
            let last = (n - 1) as f32;
            let scale = last / (p.c_last - p.c_first);
            let position = |code: u16| ((f32::from(code) / 65535.0 - p.c_first) * scale).clamp(0.0, last);
            let (low, high) = (position(min).floor() as usize, position(max).ceil() as usize);
            for front in low..=high {
                for back in low..=high {
                    for of in [&p.total, &lit.front, &lit.back] {
                        prop_assert_eq!(of[front * n + back], [0.0; 4], "{} to {} of {}", front, back, n);
                    }
                }
            }
        }
    }
}
