//! The colour spaces in which a preset interpolates between two of its colours. Formulas and constants follow VTK
//! (`vtkMath`, `vtkColorTransferFunction`), since its pictures are what a preset's author saw.

use std::f64::consts::PI;

/// Where a preset's colours are interpolated. Colours themselves are always given as RGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColorSpace {
    #[default]
    Rgb,
    Lab,
    Hsv {
        /// Hue takes the shorter way round, across red where need be.
        wrap: bool,
    },
    /// Moreland's Msh, with white between two saturated colours of different hue (Moreland 2009).
    Diverging,
    /// The colour of the segment's upper end throughout.
    Step,
}

/// The colour at `s` in 0..=1 between two RGB colours; each channel in 0..=1.
#[must_use]
pub fn interpolate(space: ColorSpace, from: [f64; 3], to: [f64; 3], s: f64) -> [f64; 3] {
    let rgb = match space {
        ColorSpace::Rgb => lerp(from, to, s),
        ColorSpace::Lab => lab_to_rgb(lerp(rgb_to_lab(from), rgb_to_lab(to), s)),
        ColorSpace::Hsv { wrap } => hsv_between(from, to, s, wrap),
        ColorSpace::Diverging => diverging(from, to, s),
        ColorSpace::Step if s > 0.0 => to,
        ColorSpace::Step => from,
    };
    rgb.map(|v| v.clamp(0.0, 1.0))
}

fn lerp(a: [f64; 3], b: [f64; 3], s: f64) -> [f64; 3] {
    std::array::from_fn(|i| (1.0 - s) * a[i] + s * b[i])
}

/// The white point that VTK uses for Lab: D65, 2 degrees.
const WHITE: [f64; 3] = [0.9505, 1.0, 1.089];

/// sRGB to CIE L*a*b*.
fn rgb_to_lab(rgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = rgb.map(|v| if v > 0.04045 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 });
    let xyz = [
        r * 0.4124 + g * 0.3576 + b * 0.1805,
        r * 0.2126 + g * 0.7152 + b * 0.0722,
        r * 0.0193 + g * 0.1192 + b * 0.9505,
    ];
    let [x, y, z] = std::array::from_fn(|i| {
        let v: f64 = xyz[i] / WHITE[i];
        if v > 0.008856 { v.cbrt() } else { 7.787 * v + 16.0 / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIE L*a*b* to sRGB. Colours outside the gamut are scaled so that the brightest channel is 1; negative ones become 0.
fn lab_to_rgb([l, a, b]: [f64; 3]) -> [f64; 3] {
    let fy = (l + 16.0) / 116.0;
    let f = [a / 500.0 + fy, fy, fy - b / 200.0];
    let [x, y, z] = std::array::from_fn(|i| {
        let cube = f[i].powi(3);
        WHITE[i] * if cube > 0.008856 { cube } else { (f[i] - 16.0 / 116.0) / 7.787 }
    });
    let linear = [
        x * 3.2406 + y * -1.5372 + z * -0.4986,
        x * -0.9689 + y * 1.8758 + z * 0.0415,
        x * 0.0557 + y * -0.2040 + z * 1.0570,
    ];
    let rgb = linear.map(|v| if v > 0.003_130_8 { 1.055 * v.powf(1.0 / 2.4) - 0.055 } else { 12.92 * v });
    let brightest = rgb.into_iter().fold(1.0, f64::max);
    rgb.map(|v| (v / brightest).max(0.0))
}

/// RGB to hue, saturation, value, all in 0..=1; the hue of a grey is 0.
fn rgb_to_hsv([r, g, b]: [f64; 3]) -> [f64; 3] {
    let (max, min) = (r.max(g).max(b), r.min(g).min(b));
    let spread = max - min;
    if spread <= 0.0 {
        return [0.0, 0.0, max];
    }
    let sextant = match () {
        () if r == max => (g - b) / spread,
        () if g == max => 2.0 + (b - r) / spread,
        () => 4.0 + (r - g) / spread,
    };
    [(sextant / 6.0).rem_euclid(1.0), spread / max, max]
}

/// Foley, van Dam et al. 1990, 13.3.4.
fn hsv_to_rgb([h, s, v]: [f64; 3]) -> [f64; 3] {
    let channel = |offset: f64| {
        let k = (offset + h * 6.0).rem_euclid(6.0);
        v - v * s * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

fn hsv_between(from: [f64; 3], to: [f64; 3], s: f64, wrap: bool) -> [f64; 3] {
    let (mut a, mut b) = (rgb_to_hsv(from), rgb_to_hsv(to));
    if wrap && (a[0] - b[0]).abs() > 0.5 {
        let greater = if a[0] > b[0] { &mut a } else { &mut b };
        greater[0] -= 1.0;
    }
    hsv_to_rgb(lerp(a, b, s))
}

/// Lab in polar coordinates: magnitude, saturation angle, hue angle (Moreland 2009, section 5).
fn lab_to_msh([l, a, b]: [f64; 3]) -> [f64; 3] {
    let m = (l * l + a * a + b * b).sqrt();
    let s = if m > 0.001 { (l / m).clamp(-1.0, 1.0).acos() } else { 0.0 };
    let h = if s > 0.001 { b.atan2(a) } else { 0.0 };
    [m, s, h]
}

fn msh_to_lab([m, s, h]: [f64; 3]) -> [f64; 3] {
    [m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin()]
}

/// A hue for the unsaturated end (magnitude `m`) of a way that starts at the saturated `msh` (Moreland 2009,
/// AdjustHue).
fn adjusted_hue(msh: [f64; 3], m: f64) -> f64 {
    if msh[0] >= m - 0.1 {
        return msh[2];
    }
    let spin = msh[1] * (m * m - msh[0] * msh[0]).sqrt() / (msh[0] * msh[1].sin());
    // Away from purple, which looks wrong on the way to white.
    if msh[2] > -0.3 * PI { msh[2] + spin } else { msh[2] - spin }
}

/// The smaller angle between two directions, radians.
fn angle_between(a: f64, b: f64) -> f64 {
    let d = (a - b).abs().rem_euclid(2.0 * PI);
    d.min(2.0 * PI - d)
}

fn diverging(from: [f64; 3], to: [f64; 3], mut s: f64) -> [f64; 3] {
    let (mut a, mut b) = (lab_to_msh(rgb_to_lab(from)), lab_to_msh(rgb_to_lab(to)));
    if a[1] > 0.05 && b[1] > 0.05 && angle_between(a[2], b[2]) > 0.33 * PI {
        let white = [a[0].max(b[0]).max(88.0), 0.0, 0.0];
        if s < 0.5 {
            b = white;
            s *= 2.0;
        } else {
            a = white;
            s = 2.0 * s - 1.0;
        }
    }
    if a[1] < 0.05 && b[1] > 0.05 {
        a[2] = adjusted_hue(b, a[0]);
    } else if b[1] < 0.05 && a[1] > 0.05 {
        b[2] = adjusted_hue(a, b[0]);
    }
    lab_to_rgb(msh_to_lab(lerp(a, b, s)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: [f64; 3], want: [f64; 3], within: f64) {
        assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() <= within), "{got:?} is not {want:?}");
    }

    #[test]
    fn spaces_give_back_the_ends() {
        let spaces = [
            ColorSpace::Rgb,
            ColorSpace::Lab,
            ColorSpace::Hsv { wrap: false },
            ColorSpace::Hsv { wrap: true },
            ColorSpace::Diverging,
            ColorSpace::Step,
        ];
        let colors = [[0.0; 3], [1.0; 3], [0.2, 0.4, 0.9], [0.7, 0.02, 0.15], [1.0, 0.0, 1.0], [0.5; 3]];
        for space in spaces {
            for from in colors {
                for to in colors {
                    // Lab's published matrices are inverse to each other within 0.002 only.
                    close(interpolate(space, from, to, 0.0), from, 0.003);
                    close(interpolate(space, from, to, 1.0), to, 0.003);
                }
            }
        }
    }

    #[test]
    fn hue_goes_round_only_when_wrapped() {
        let (magenta, yellow) = ([1.0, 0.0, 1.0], [1.0, 1.0, 0.0]);
        close(interpolate(ColorSpace::Hsv { wrap: true }, magenta, yellow, 0.5), [1.0, 0.0, 0.0], 1e-12);
        close(interpolate(ColorSpace::Hsv { wrap: false }, magenta, yellow, 0.5), [0.0, 1.0, 1.0], 1e-12);
        close(interpolate(ColorSpace::Hsv { wrap: true }, yellow, magenta, 0.5), [1.0, 0.0, 0.0], 1e-12);
    }
}
