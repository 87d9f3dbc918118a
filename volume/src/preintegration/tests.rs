mod edges;

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::nodes::{ALL, PARTS};
use super::*;
use crate::transfer_function::codes::Codes;
use crate::transfer_function::empty::halvings;
use crate::transfer_function::{ColorPoint, Colormap, OpacityPoint, TransferFunction, TransferTable};

const LENGTHS: [f64; 6] = [0.01, 0.3, 0.5, 1.0, 4.0, 16.0];
const RANGE: (f64, f64) = (0.0, 65535.0);

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

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// At least n nodes anywhere, some of them parts of a code apart.
fn scattered(n: usize, seed: u64) -> Elements {
    let (mut random, mut nodes) = (random(seed), BTreeSet::from([0, ALL]));
    while nodes.len() < n {
        let around = if random() < 0.5 { 0.3 } else { random() };
        let place = ((around + 1e-4 * random()) * f64::from(ALL)) as u32;
        nodes.extend(halvings(&nodes, place));
    }
    Elements::at(&lively(), Codes::new((0.0, 1.0)), nodes.into_iter().collect())
}

#[test]
fn all_slabs_are_those_of_brute_force() {
    for (n, seed) in [(2, 1), (3, 2), (5, 4), (33, 6), (100, 7)] {
        for elements in [scattered(n, seed), Elements::of(&lively(), (0.0, 1.0), 0.5, n)] {
            let n = elements.nodes.len();
            for length in LENGTHS {
                let [total, front, back] = wide(&elements, length);
                let [alone] = subranges::integrate::<4, 1, [f64; 4]>(&elements, length);
                for (index, [whole, weighted]) in brute_force::table(&elements, length).into_iter().enumerate() {
                    let what = format!("{} to {} of {n}, length {length}", index / n, index % n);
                    assert!((total[index][3] - whole[3]).abs() < 1e-9, "{what}: {:?} {whole:?}", total[index]);
                    close(total[index], whole, 6e-4 * whole[3] + 1e-12, &what);
                    close(alone[index], total[index], 1e-12, &what);
                    close(back[index], weighted, 1e-3 * whole[3] + 1e-12, &what);
                    let rest = [0, 1, 2, 3].map(|c| if c < 3 { total[index][c] - back[index][c] } else { whole[3] });
                    close(front[index], rest, 1e-9, &what);
                }
            }
        }
    }
}

#[test]
fn opacity_has_a_closed_form() {
    let elements = Elements::of(&lively(), (0.0, 1.0), 0.5, 97);
    let n = elements.nodes.len();
    for length in LENGTHS {
        let [total, ..] = wide(&elements, length);
        for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let through = &elements.pieces[elements.first[j]..elements.first[i]];
            let depth: f64 = through.iter().map(|(_, width, e)| e.log_transparency * f64::from(*width)).sum();
            let want = 1.0 - (length * depth / f64::from(elements.nodes[i] - elements.nodes[j])).exp();
            for got in [total[i * n + j][3], total[j * n + i][3]] {
                assert!((got - want).abs() < 1e-9, "{i} to {j}, length {length}: {got} {want}");
            }
        }
    }
}

#[test]
fn back_to_front_is_front_to_back_of_the_reversed_function() {
    let forward = scattered(61, 9);
    let n = forward.nodes.len();
    let mut reversed = forward.clone();
    reversed.nodes = forward.nodes.iter().rev().map(|place| ALL - place).collect();
    reversed.entries.reverse();
    reversed.pieces = forward.pieces.iter().rev().map(|&(at, width, e)| (ALL - at - width, width, e)).collect();
    reversed.first = forward.first.iter().rev().map(|first| forward.pieces.len() - first).collect();
    let (tables, mirrored) = (wide(&forward, 2.0), wide(&reversed, 2.0));
    for (table, mirror) in tables.iter().zip(&mirrored) {
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            close(table[i * n + j], mirror[(n - 1 - i) * n + n - 1 - j], 1e-9, &format!("{i} to {j}"));
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
        for length in LENGTHS {
            let elements = Elements::of(&f, (-5.0, 7.0), length, 1024);
            assert!(elements.nodes.len() < 40, "nodes for nothing");
            let depth = -(-opacity.min(MAX_OPACITY)).ln_1p() * length;
            let alpha = -(-depth).exp_m1();
            let [total, front, back] = wide(&elements, length);
            let share = if depth > 1e-2 { (1.0 - (1.0 + depth) * (-depth).exp()) / depth / alpha } else { 0.5 };
            for index in 0..total.len() {
                let (want, what) = ([0.2 * alpha, 0.5 * alpha, alpha, alpha], format!("{index}, {opacity}, {length}"));
                close(total[index], want, 1e-9, &what);
                let sum = [0, 1, 2].map(|c| front[index][c] + back[index][c]);
                close([sum[0], sum[1], sum[2], front[index][3]], want, 1e-9, "front and back");
                close(back[index], want.map(|v| v * share), 2e-3 * alpha + 1e-12, &what);
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
        let (red_first, green_first) = (p.total[p.size - 1], p.total[(p.size - 1) * p.size]);
        assert!(red_first[0] > 0.99 && red_first[1] < 0.01, "{red_first:?}");
        assert!(green_first[1] > 0.99 && green_first[0] < 0.01, "{green_first:?}");
    }
}

/// The coordinate among the nodes, as kernels compute it.
fn coordinate(p: &Preintegrated, code: f32) -> f32 {
    let blocks = p.warp.len();
    let at = (code * (blocks as f32 * (65535.0 / 65536.0))).clamp(0.0, blocks as f32);
    let i = (at as usize).min(blocks - 1);
    p.warp[i][0] + (at - i as f32) * p.warp[i][1]
}

/// The table between two codes, as kernels read it.
fn look_up(p: &Preintegrated, table: &[[f32; 4]], front: f64, back: f64) -> [f64; 4] {
    let place = |code: f64| {
        let at = f64::from(coordinate(p, (code / 65535.0) as f32)).clamp(0.0, (p.size - 1) as f64);
        let i = (at as usize).min(p.size - 2);
        (i, at - i as f64)
    };
    let ((i, u), (j, v)) = (place(front), place(back));
    std::array::from_fn(|c| {
        let at = |i: usize, j: usize| f64::from(table[i * p.size + j][c]);
        let (near, far) = (at(i, j) * (1.0 - v) + at(i, j + 1) * v, at(i + 1, j) * (1.0 - v) + at(i + 1, j + 1) * v);
        near * (1.0 - u) + far * u
    })
}

/// The definition: the function itself, in slices between all of its points. And its back-weighted part.
fn slab(f: &TransferFunction, length: f64, front: f64, back: f64) -> [[f64; 4]; 2] {
    let mut ends: Vec<f64> = (0..=400).map(|k| f64::from(k) / 400.0).collect();
    let points = f.colors().iter().map(|p| p.x).chain(f.opacities().iter().map(|p| p.x));
    let places = points.map(|x| (x - front) / (back - front)).filter(|u| *u > 0.0 && *u < 1.0);
    let mut places: Vec<f64> = places.collect();
    places.sort_by(f64::total_cmp);
    for (a, b) in places.iter().zip(places.iter().skip(1)) {
        ends.extend((0..8).map(|k| a + (b - a) * f64::from(k) / 8.0));
    }
    ends.extend(places);
    ends.sort_by(f64::total_cmp);
    let (mut sum, mut weighted) = ([0.0; 4], [0.0; 4]);
    for w in ends.windows(2).filter(|w| w[1] > w[0]) {
        let (u, x) = (0.5 * (w[0] + w[1]), front + (back - front) * 0.5 * (w[0] + w[1]));
        let depth = -(-f.opacity(x).min(MAX_OPACITY)).ln_1p() * length * (w[1] - w[0]);
        let through = (1.0 - sum[3]) * -(-depth).exp_m1();
        let [r, g, b] = f.color(x);
        for (c, glow) in [r, g, b, 1.0].into_iter().enumerate() {
            sum[c] += through * glow;
            weighted[c] += through * glow * u;
        }
    }
    [sum, weighted]
}

/// Grey, or red below 30020 and blue above.
fn alloys() -> TransferFunction {
    let (red, blue) = ([0.9, 0.1, 0.1], [0.1, 0.2, 1.0]);
    function(
        &[(0.0, [0.5; 3]), (29_980.0, red), (30_019.0, red), (30_021.0, blue), (65_535.0, blue)],
        &[
            (0.0, 0.0),
            (29_995.0, 0.0),
            (30_000.0, 0.9),
            (30_005.0, 0.0),
            (30_035.0, 0.0),
            (30_040.0, 0.8),
            (30_045.0, 0.0),
        ],
    )
}

/// Without flat ends; windows; a band; a peak of ten values, its ends written out; two alloys 40 values apart; steps.
fn functions() -> Vec<(&'static str, TransferFunction)> {
    let (grey, warm) = ([0.2, 0.4, 0.9], [1.0, 0.6, 0.1]);
    let all = [(0.0, grey), (65_535.0, warm)];
    let step = |at: f64| [(at, 0.1), (at + 1e-6, 0.6), (at + 900.0, 0.6), (at + 900.000_001, 0.1)];
    vec![
        ("ramp", function(&all, &[(0.0, 0.1), (65_535.0, 0.8)])),
        ("window", TransferFunction::window(20_000.0, 40_000.0, 0.8, Colormap::Viridis).unwrap()),
        ("narrow window", TransferFunction::window(30_000.0, 30_100.0, 0.8, Colormap::Viridis).unwrap()),
        ("band", function(&all, &[(30_000.0, 0.0), (30_500.0, 0.9), (31_000.0, 0.0)])),
        ("peak", function(&all, &[(0.0, 0.0), (29_995.0, 0.0), (30_000.0, 1.0), (30_005.0, 0.0), (65_535.0, 0.0)])),
        ("alloys", alloys()),
        ("steps", function(&all, &[step(10_000.0), step(30_000.5), step(50_000.3)].concat())),
    ]
}

/// What the table holds between any two values is the integral through the whole function: from afar, from nearby, and
/// within a feature.
#[test]
fn looked_up_slabs_are_the_integral() {
    for (name, f) in functions() {
        for length in [0.5, 2.0] {
            let p = Preintegrated::build(&f, RANGE, length, TableSize::N1024, true);
            let (mut random, mut sums, mut worst, mut count) = (random(5), [0.0; 2], [0.0_f64; 2], 0);
            for k in 0..800 {
                let near = |random: f64| 30_020.0 + (random - 0.5) * [60.0, 600.0, 6000.0, 60_000.0][k % 4];
                let (front, back) = (near(random()), if k % 8 < 4 { near(random()) } else { random() * 65_535.0 });
                let want = slab(&f, length, front, back);
                let lit = p.lit.as_ref().unwrap();
                for (i, (table, want)) in [&p.total, &lit.back].into_iter().zip(want).enumerate() {
                    let got = look_up(&p, table, front, back);
                    let error = (0..4).map(|c| (got[c] - want[c]).abs()).fold(0.0, f64::max);
                    sums[i] += error;
                    worst[i] = worst[i].max(error);
                }
                count += 1;
            }
            let [mean, mean_back] = sums.map(|sum| sum / f64::from(count) * 255.0);
            let [worst, worst_back] = worst.map(|w| w * 255.0);
            eprintln!(
                "{name}, {length}: {} nodes, {} blocks; mean {mean:.4} {mean_back:.4}, worst {worst:.3} \
                 {worst_back:.3} of 255",
                p.size,
                p.warp.len()
            );
            assert!(mean < 0.1 && mean_back < 0.1, "{name}, {length}: mean {mean} {mean_back}");
            // Both ends within one code of a peak of ten.
            assert!(worst < 2.0 && worst_back < 2.0, "{name}, {length}: worst {worst} {worst_back}");
        }
    }
}

/// Values between which nothing changes are where most of a picture is: a slab of one value is the function there.
#[test]
fn slabs_of_one_value_are_the_function() {
    for (name, f) in functions() {
        let p = Preintegrated::build(&f, RANGE, 0.5, TableSize::N1024, false);
        for code in (0..65_536).step_by(997).chain(29_960..30_080).map(f64::from) {
            let (got, a) = (look_up(&p, &p.total, code, code), 1.0 - (1.0 - f.opacity(code)).sqrt());
            let [r, g, b] = f.color(code).map(|c| c * a);
            close(got, [r, g, b, a], 0.02, &format!("{name} at {code}"));
        }
    }
}

/// The same function, with the ends of the range written out or not.
#[test]
fn points_that_change_nothing_change_nothing() {
    let points = [(29_995.0, 0.0), (30_000.0, 1.0), (30_005.0, 0.0)];
    let with_ends = [&[(0.0, 0.0)][..], &points, &[(65_535.0, 0.0)]].concat();
    let [a, b] = [&points[..], &with_ends]
        .map(|points| Preintegrated::build(&function(&[(0.0, [1.0; 3])], points), RANGE, 1.0, TableSize::N1024, false));
    for (front, back) in [(2000.0, 40_000.0), (29_000.0, 30_000.0), (30_000.0, 30_000.0), (30_001.0, 65_535.0)] {
        close(look_up(&a, &a.total, front, back), look_up(&b, &b.total, front, back), 1e-6, "ends");
    }
}

#[test]
fn warps_rise_from_node_to_node() {
    for (name, f) in functions() {
        let elements = Elements::of(&f, RANGE, 0.5, 1024);
        let p = Preintegrated::with_entries(&f, RANGE, 0.5, 1024, false);
        assert!(p.warp.len().is_power_of_two() && p.size == elements.nodes.len() && p.size <= 1024, "{name}");
        let last = p.warp.last().unwrap();
        assert!((last[0] + last[1] - (p.size - 1) as f32).abs() < 1e-3, "{name}");
        for (i, place) in elements.nodes.iter().enumerate() {
            let at = coordinate(&p, (f64::from(*place) / f64::from(PARTS) / 65535.0) as f32);
            // A code in f32 errs by up to 0.008 codes.
            assert!((at - i as f32).abs() < 0.05, "{name}: node {i} at {at}");
        }
        let rising: Vec<f32> = (0..=65535 * 2).map(|half| coordinate(&p, half as f32 / 131_070.0)).collect();
        assert!(rising.windows(2).all(|w| w[1] >= w[0] - 1e-3), "{name}");
    }
}

/// A spike in the middle of nothing, seen by whatever spans it.
#[test]
fn a_spike_is_seen_with_its_own_length() {
    let [from, to] = [30_000.0, 30_131.0];
    let opacities = [(0.0, 0.0), (from, 0.0), (from + 1e-6, 0.6), (to, 0.6), (to + 1e-6, 0.0), (65_535.0, 0.0)];
    let colors = [(0.0, [1.0, 0.0, 0.0]), (from, [1.0, 0.0, 0.0]), (from + 1e-6, [0.0, 1.0, 0.0])];
    let p = Preintegrated::with_entries(&function(&colors, &opacities), RANGE, 1.0, 256, true);
    for (front, back) in [(0.0, 65_535.0), (65_535.0, 0.0), (20_000.0, 30_500.0), (31_000.0, 29_000.0)] {
        let [r, g, b, a] = look_up(&p, &p.total, front, back);
        let want = 1.0 - 0.4_f64.powf(131.0 / f64::abs(back - front));
        assert!((a - want).abs() < 2e-3 * want.max(0.1), "{front} to {back}: {a} {want}");
        assert!((g - a).abs() < 1e-6 && r < 1e-6 && b == 0.0, "its own colour: {r} {g} {b}");
    }
    assert_eq!(look_up(&p, &p.total, 0.0, 29_980.0), [0.0; 4], "before it nothing is");
    assert_eq!(look_up(&p, &p.total, 65_000.0, 30_150.0), [0.0; 4], "nor behind it");
}

/// The mean of an element, against many small steps.
#[test]
fn elements_hold_the_mean_of_the_function() {
    let f = lively();
    for n in [2, 11, 256] {
        let elements = Elements::of(&f, (0.0, 1.0), 1.0, n);
        for &(place, width, element) in elements.pieces.iter().step_by(3) {
            let (mut depth, mut color) = (0.0, [0.0; 3]);
            for k in 0..4000 {
                let at = f64::from(place) + f64::from(width) * (f64::from(k) + 0.5) / 4000.0;
                let at = at / f64::from(PARTS) / 65535.0;
                let l = (-f.opacity(at).min(MAX_OPACITY)).ln_1p() / 4000.0;
                depth += l;
                color = [0, 1, 2].map(|c| color[c] + l * f.color(at)[c]);
            }
            assert!(
                (element.log_transparency - depth).abs() < 5e-3 * (1.0 - depth),
                "{place} of {n}: {element:?} {depth}"
            );
            if depth < -1e-3 {
                let want = color.map(|c| c / depth);
                assert!(element.color.iter().zip(want).all(|(g, w)| (g - w).abs() < 4e-3), "{place}: {element:?}");
            }
        }
    }
}
