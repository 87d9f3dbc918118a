//! What is packed, what has no width, what is empty, and what no table carries.

use super::*;

#[test]
fn packed_tables_split_into_front_and_back() {
    let f = TransferFunction::window(300.0, 700.0, 0.8, Colormap::Viridis).unwrap();
    for (size, lit) in [(TableSize::N256, true), (TableSize::N256, false), (TableSize::N1024, true)] {
        let p = Preintegrated::build(&f, (0.0, 1000.0), 0.5, size, lit);
        assert!(p.size <= size.entries());
        assert_eq!((p.total.len(), p.lit.is_some()), (p.size * p.size, lit));
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
            assert!(p.size <= n.max(2));
            let want =
                Element { color: lively().color(range.0), log_transparency: (-lively().opacity(range.0)).ln_1p() };
            let a = want.opacity(1.0);
            let want = [want.color[0] * a, want.color[1] * a, want.color[2] * a, a];
            assert!(p.total.iter().all(|e| e.iter().zip(want).all(|(g, w)| (f64::from(*g) - w).abs() < 1e-6)));
        }
    }
}

#[test]
fn what_no_table_carries_is_told() {
    for (name, f) in functions() {
        let told = coarse(&f, RANGE, 0.5, TableSize::N1024);
        assert!(told.is_none(), "{name}: {told:?}");
    }
    // Three hundred peaks of ten values.
    let peak = |k: i32| {
        let at = 200.0 * f64::from(k) + 100.0;
        [(at - 5.0, 0.0), (at, 1.0), (at + 5.0, 0.0)]
    };
    let peaks: Vec<(f64, f64)> = (0..300).flat_map(peak).collect();
    let f = function(&[(0.0, [1.0; 3])], &peaks);
    let [small, large] = [TableSize::N256, TableSize::N1024].map(|size| coarse(&f, RANGE, 0.5, size).unwrap());
    assert!(small.error >= large.error && large.error > 0.02, "{small:?} {large:?}");
    assert!(large.values[0] < large.values[1] && (0.0..65_536.0).contains(&large.values[0]));
}

/// Mostly nothing, with spikes of any width.
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
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// Wrong in the other direction, a macrocell would be skipped of which slabs are seen.
    #[test]
    fn slabs_between_codes_of_an_empty_range_are_nothing(
        f in spiky(),
        length in 0.01..16.0_f64,
        n in prop_oneof![Just(256_usize), Just(1024), 16..100_usize],
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
            // Bilinear lookups see from the node below the lowest position to the one above the highest.
            let position = |code: u16| coordinate(&p, f32::from(code) * (1.0 / 65535.0));
            let (low, high) = (position(min).floor() as usize, (position(max).ceil() as usize).min(p.size - 1));
            for front in low..=high {
                for back in low..=high {
                    for of in [&p.total, &lit.front, &lit.back] {
                        prop_assert_eq!(of[front * p.size + back], [0.0; 4], "{} to {} of {}", front, back, n);
                    }
                }
            }
            prop_assert_eq!(p.shown_before[low], p.shown_before[high.max(low + 1)]);
        }
    }
}
