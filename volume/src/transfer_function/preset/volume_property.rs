//! 3D Slicer's volume property files (`.vp`), as `vtkMRMLVolumePropertyStorageNode` writes them.
//!
//! Nine lines: interpolation type, shading on or off, diffuse, ambient and specular reflection, specular power, scalar
//! opacity, gradient opacity, colour. The last three each hold a count of numbers and the numbers: value and opacity,
//! gradient and opacity, value and red, green, blue of every point. All are linear in between; a repeated value is a
//! step.

use super::error::{MAX_BYTES, PresetErrorKind};
use super::resample::Node;
use crate::transfer_function::function::{MAX_POINTS, MAX_X};

/// What a line holds, and what should have stood there.
#[derive(Debug, Clone, Copy)]
struct Line {
    number: usize,
    name: &'static str,
    expected: &'static str,
    /// Numbers of a point.
    per_point: usize,
}

const ONE: &str = "one number";
const PAIRS: &str = "a count of numbers, then value and opacity of every point";
const QUADS: &str = "a count of numbers, then value, red, green and blue of every point";

/// The lines before the functions: read, so that another kind of file is noticed, and not used.
const LIGHTING: [&str; 6] = [
    "interpolation type",
    "shading",
    "diffuse reflection",
    "ambient reflection",
    "specular reflection",
    "specular power",
];
const SCALAR_OPACITY: Line = Line { number: 7, name: "scalar opacity", expected: PAIRS, per_point: 2 };
const GRADIENT_OPACITY: Line = Line { number: 8, name: "gradient opacity", expected: PAIRS, per_point: 2 };
const COLOR: Line = Line { number: 9, name: "colour", expected: QUADS, per_point: 4 };

/// What a file says, as nodes sorted by x.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VolumeProperty {
    pub(super) colors: Vec<Node<3>>,
    pub(super) opacities: Vec<Node<1>>,
    /// True where opacity depends on the gradient, too.
    pub(super) has_gradient_opacity: bool,
}

/// # Errors
/// A line that is missing or holds something else: its number and what was expected.
pub(super) fn parse(text: &str) -> Result<VolumeProperty, PresetErrorKind> {
    if text.len() > MAX_BYTES {
        return Err(PresetErrorKind::TooLong { bytes: text.len() });
    }
    let lines: Vec<&str> = text.trim_start_matches('\u{feff}').lines().map(without_remark).collect();
    for (i, name) in LIGHTING.into_iter().enumerate() {
        let line = Line { number: i + 1, name, expected: ONE, per_point: 1 };
        match &line.numbers(&lines)?[..] {
            // Slicer keeps its own defaults then.
            [] | [_] => {}
            more => return Err(line.wrong(format!("there are {} numbers", more.len()))),
        }
    }
    let opacities = SCALAR_OPACITY.points(&lines)?;
    let opacities = opacities.chunks_exact(2).map(|p| node(p[0], [p[1]])).collect();
    let gradient = match GRADIENT_OPACITY.numbers(&lines)? {
        numbers if numbers.is_empty() || numbers[..] == [0.0] => Vec::new(),
        _ => GRADIENT_OPACITY.points(&lines)?,
    };
    let colors = COLOR.points(&lines)?;
    let colors = colors.chunks_exact(4).map(|p| node(p[0], [p[1], p[2], p[3]])).collect();
    let has_gradient_opacity = gradient.chunks_exact(2).any(|p| p[1] != 1.0);
    Ok(VolumeProperty { colors, opacities, has_gradient_opacity })
}

fn node<const N: usize>(x: f64, values: [f64; N]) -> Node<N> {
    Node { x, values, midpoint: 0.5, sharpness: 0.0 }
}

/// Slicer reads as many numbers as it needs; its own documentation puts a remark behind them.
fn without_remark(line: &str) -> &str {
    line.split_once("=>").map_or(line, |(numbers, _)| numbers).trim()
}

impl Line {
    fn wrong(&self, problem: impl Into<String>) -> PresetErrorKind {
        let Self { number, name, expected, .. } = *self;
        PresetErrorKind::Line { line: number, name, problem: problem.into(), expected }
    }

    fn numbers(&self, lines: &[&str]) -> Result<Vec<f64>, PresetErrorKind> {
        let Some(line) = lines.get(self.number - 1) else {
            return Err(self.wrong(format!("the file ends after line {}", lines.len())));
        };
        line.split_ascii_whitespace()
            .map(|word| match word.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                _ => Err(self.wrong(format!("`{}` is not a finite number", shortened(word)))),
            })
            .collect()
    }

    /// The numbers behind the count, checked: whole points, x not decreasing, the rest in 0..=1.
    fn points(&self, lines: &[&str]) -> Result<Vec<f64>, PresetErrorKind> {
        let numbers = self.numbers(lines)?;
        let Some((&count, numbers)) = numbers.split_first() else { return Err(self.wrong("the line is empty")) };
        if count != numbers.len() as f64 {
            return Err(self.wrong(format!("the count is {count}, but {} numbers follow", numbers.len())));
        }
        if numbers.is_empty() || numbers.len() % self.per_point != 0 {
            return Err(self.wrong(format!("{count} numbers are no whole points of {}", self.per_point)));
        }
        let points = numbers.len() / self.per_point;
        if points > MAX_POINTS {
            return Err(self.wrong(format!("{points} points are more than {MAX_POINTS}")));
        }
        let mut before = f64::NEG_INFINITY;
        for (i, point) in numbers.chunks_exact(self.per_point).enumerate() {
            let x = point[0];
            if x.abs() > MAX_X || x < before {
                return Err(self.wrong(format!(
                    "point {}: its value {x} is beyond +-{MAX_X:e} or below that of the point before it ({before})",
                    i + 1
                )));
            }
            if let Some(v) = point[1..].iter().find(|v| !(0.0..=1.0).contains(*v)) {
                return Err(self.wrong(format!("point {}: {v} must lie between 0 and 1", i + 1)));
            }
            before = x;
        }
        Ok(numbers.to_vec())
    }
}

/// A word for an error text.
fn shortened(word: &str) -> String {
    if word.chars().count() > 20 { word.chars().take(20).chain("...".chars()).collect() } else { word.to_owned() }
}

#[cfg(test)]
mod tests;
