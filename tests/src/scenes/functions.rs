//! Transfer functions that tables find hard, and a volume of alloys to see them in.

use super::*;

/// Functions that no table of evenly spaced entries carries: without flat ends, a window of which both ends lie between
/// values, a band, a peak of ten grey values with the ends of the range written out, two alloys 40 grey values apart,
/// steps.
#[must_use]
pub fn functions() -> Vec<(&'static str, Transfer)> {
    let at = |code: f64| RANGE.0 + (RANGE.1 - RANGE.0) * code / 65535.0;
    let colors = |points: &[(f64, [f64; 3])]| points.iter().map(|&(code, c)| (at(code), c)).collect::<Vec<_>>();
    let opacities = |points: &[(f64, f64)]| points.iter().map(|&(code, o)| (at(code), o)).collect::<Vec<_>>();
    let all = colors(&[(0.0, [0.2, 0.4, 0.9]), (65_535.0, [1.0, 0.6, 0.1])]);
    let (red, blue) = ([0.9, 0.1, 0.1], [0.1, 0.2, 1.0]);
    let alloys = colors(&[(29_990.0, red), (30_019.0, red), (30_021.0, blue), (30_050.0, blue)]);
    let peak = |middle: f64| [(middle - 5.0, 0.0), (middle, 0.9), (middle + 5.0, 0.0)];
    let ends = |points: &[(f64, f64)]| opacities(&[&[(0.0, 0.0)], points, &[(65_535.0, 0.0)]].concat());
    let step = |code: f64| [(code, 0.02), (code + 1e-6, 0.4), (code + 900.0, 0.4), (code + 900.000_001, 0.02)];
    vec![
        ("ramp", Transfer { colors: all.clone(), opacities: opacities(&[(0.0, 0.02), (65_535.0, 0.3)]) }),
        ("window", Transfer { colors: all.clone(), opacities: opacities(&[(20_000.3, 0.0), (40_000.7, 0.5)]) }),
        (
            "band",
            Transfer {
                colors: all.clone(),
                opacities: opacities(&[(30_000.0, 0.0), (30_500.0, 0.9), (31_000.0, 0.0)]),
            },
        ),
        ("peak", Transfer { colors: all.clone(), opacities: ends(&peak(30_000.0)) }),
        ("alloys", Transfer { colors: alloys, opacities: ends(&[peak(30_000.0), peak(30_040.0)].concat()) }),
        ("steps", Transfer { colors: all, opacities: opacities(&[step(10_000.5), step(30_010.5)].concat()) }),
    ]
}

/// Two alloys 40 grey values apart, side by side in air, and a third that is neither.
#[must_use]
pub fn alloys(step: f64) -> Scene {
    let [nx, ny, nz] = SKEW.dims;
    let codes = SKEW.codes(|[x, y, z]| {
        let is_inside = (4..nx - 4).contains(&x) && (4..ny - 4).contains(&y) && (4..nz - 4).contains(&z);
        let code = if !is_inside {
            2000.0
        } else if z < nz / 2 {
            50_000.0
        } else if x < nx / 2 {
            30_000.0
        } else {
            30_040.0
        };
        code / 65_535.0
    });
    let camera = Camera::orbit(&SKEW.volume(&codes), 35.0, 25.0, 1.1, 30.0);
    SKEW.scene("alloys", codes, camera, [40, 32], step)
}
