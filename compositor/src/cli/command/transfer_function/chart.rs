//! A curve as plain text of at most 80 columns.

use super::plot::{Plot, hex, short};

const COLUMNS: usize = 68;
const ROWS: usize = 12;
/// Lines of the table.
const MAX_ROWS: usize = 12;
/// Places of a function of too many points.
const SAMPLES: usize = 9;

/// The curve `*` over the histogram `:`, with a scale on either axis.
pub(super) fn lines(plot: &Plot<'_>) -> Vec<String> {
    let mut cells = vec![[' '; COLUMNS]; ROWS];
    let level = |share: f64| (share * (ROWS - 1) as f64).round().clamp(0.0, (ROWS - 1) as f64) as usize;
    for i in 0..COLUMNS {
        let filled = (plot.voxels(i, COLUMNS) * ROWS as f64).ceil() as usize;
        for row in cells.iter_mut().take(filled) {
            row[i] = ':';
        }
        if let Some([low, high]) = plot.curve(i, COLUMNS) {
            for row in &mut cells[level(low)..=level(high)] {
                row[i] = '*';
            }
        }
    }
    let mut lines: Vec<String> = Vec::with_capacity(ROWS + 2);
    for (k, row) in cells.iter().enumerate().rev() {
        let label = match k {
            _ if !plot.has_opacities => String::new(),
            0 => "0".to_owned(),
            _ if k == ROWS - 1 => short(plot.top),
            _ => String::new(),
        };
        lines.push(format!("{label:>9} |{}", row.iter().collect::<String>().trim_end()));
    }
    lines.push(format!("{:>9} +{}", "", "-".repeat(COLUMNS)));
    let [left, middle, right] = [0.0, 0.5, 1.0].map(|share| short(plot.x(share)));
    let half = COLUMNS / 2;
    let (before, behind) = (half.saturating_sub(middle.len() / 2), half.saturating_sub(middle.len().div_ceil(2)));
    lines.push(format!("{:>11}{left:<before$}{middle}{right:>behind$}", ""));
    lines
}

/// Value, opacity and colour at the function's points, or evenly spread where there are too many.
pub(super) fn table(plot: &Plot<'_>) -> Vec<String> {
    let function = plot.function;
    let opacities = if plot.has_opacities { function.opacities() } else { &[] };
    let mut xs: Vec<f64> = function.colors().iter().map(|p| p.x).chain(opacities.iter().map(|p| p.x)).collect();
    xs.sort_by(f64::total_cmp);
    xs.dedup();
    if xs.len() > MAX_ROWS {
        xs = (0..SAMPLES).map(|i| plot.x(i as f64 / (SAMPLES - 1) as f64)).collect();
    }
    let mut lines = vec!["  value        opacity  colour".to_owned()];
    lines.extend(xs.into_iter().map(|x| {
        let opacity = if plot.has_opacities { format!("{:.4}", function.opacity(x)) } else { "-".to_owned() };
        format!("  {:<12} {opacity:<7}  {}", short(x), hex(function.color(x)))
    }));
    lines
}

#[cfg(test)]
mod tests {
    use super::super::plot::tests::function;
    use super::*;

    #[test]
    fn the_chart_is_plain_and_narrow_and_shows_the_ramp() {
        let f = function(&[(0.0, 0.0), (50.0, 0.0), (100.0, 0.6)]);
        let plot = Plot::new(&f, true, None);
        let chart = lines(&plot);
        assert_eq!(chart.len(), ROWS + 2);
        for line in chart.iter().chain(&table(&plot)) {
            assert!(line.is_ascii() && line.len() < 80, "{line}");
            assert!(!line.contains('\u{1b}'));
        }
        assert!(chart[0].starts_with("      0.6 |") && chart[0].ends_with('*'), "{}", chart[0]);
        assert!(chart[ROWS - 1].starts_with("        0 |**********"), "{}", chart[ROWS - 1]);
        assert!(chart[ROWS + 1].contains(" 50 ") && chart[ROWS + 1].ends_with("100"), "{}", chart[ROWS + 1]);
        // Every column holds the curve.
        assert!((0..COLUMNS).all(|i| chart[..ROWS].iter().any(|line| line.as_bytes().get(11 + i) == Some(&b'*'))));
    }

    #[test]
    fn the_table_names_points_or_samples() {
        let f = function(&[(0.0, 0.25), (50.0, 1.0)]);
        let rows = table(&Plot::new(&f, true, None));
        assert_eq!(rows.len(), 4);
        assert!(rows[2].contains("50") && rows[2].contains("1.0000") && rows[2].ends_with("#800080"), "{}", rows[2]);
        let many: Vec<(f64, f64)> = (0..40).map(|i| (f64::from(i), 0.5)).collect();
        assert_eq!(table(&Plot::new(&function(&many), true, None)).len(), 1 + SAMPLES);
        assert!(table(&Plot::new(&f, false, None))[1].contains(" - "));
    }
}
