//! From nodes with curves between them to what is linear in between.

use super::error::PresetErrorKind;
use super::resample::{Node, Shape, resample, shaped};
use crate::transfer_function::color_space::{ColorSpace, interpolate};
use crate::transfer_function::function::{ColorPoint, MAX_POINTS, MAX_X, OpacityPoint, TransferFunction};

/// Nodes of opacity as a function; its colour is of no meaning.
pub(super) fn opacities_of(nodes: &[Node<1>]) -> Result<TransferFunction, PresetErrorKind> {
    let color = [Node { x: 0.0, values: [0.0; 3], midpoint: 0.5, sharpness: 0.0 }];
    function(&color, ColorSpace::Rgb, Some(nodes.to_vec()), &[])
}

/// Nodes to what is linear in between; `default` where there are no opacities.
pub(super) fn function(
    colors: &[Node<3>],
    space: ColorSpace,
    opacities: Option<Vec<Node<1>>>,
    default: &[OpacityPoint],
) -> Result<TransferFunction, PresetErrorKind> {
    let colors = resample(
        colors,
        MAX_POINTS,
        |a, b| match space {
            _ if a.values == b.values => Shape::Linear,
            ColorSpace::Rgb => Shape::Linear,
            ColorSpace::Step => Shape::Upper,
            ColorSpace::Lab | ColorSpace::Hsv { .. } | ColorSpace::Diverging => Shape::Curve { middle: 0.5 },
        },
        |a, b, s| interpolate(space, a.values, b.values, s),
    );
    let opacities = match opacities {
        None => default.to_vec(),
        Some(nodes) => resample(&nodes, MAX_POINTS, Node::shape_to, |a, b, s| [shaped(a, b, s)])
            .into_iter()
            .map(|(x, [opacity])| OpacityPoint { x, opacity })
            .collect(),
    };
    let colors = colors.into_iter().map(|(x, rgb)| ColorPoint { x, rgb }).collect();
    Ok(TransferFunction::new(colors, opacities)?)
}

pub(super) fn rescale(
    colors: &mut [Node<3>],
    opacities: &mut Option<Vec<Node<1>>>,
    lo: f64,
    hi: f64,
) -> Result<(), PresetErrorKind> {
    if !(lo < hi && lo.abs() <= MAX_X && hi.abs() <= MAX_X) {
        return Err(PresetErrorKind::Range { lo, hi });
    }
    let opacities = opacities.as_deref_mut().unwrap_or_default();
    let xs = || colors.iter().map(|n| n.x).chain(opacities.iter().map(|n| n.x));
    let (first, last) = xs().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let width = last - first;
    let stretch = |x: f64| match x {
        // The ends exactly; a preset of one x stands at LO.
        _ if x == first || width <= 0.0 => lo,
        _ if x == last => hi,
        _ => (lo + (x - first) / width * (hi - lo)).clamp(lo, hi),
    };
    colors.iter_mut().for_each(|n| n.x = stretch(n.x));
    opacities.iter_mut().for_each(|n| n.x = stretch(n.x));
    Ok(())
}
