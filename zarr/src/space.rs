//! Where an image lies in the world.

use brickcast_volume::format::Placement;
use brickcast_volume::space::Geometry;
use brickcast_volume::store::Objects;
use glam::{DMat3, DVec3};

use crate::array::Array;
use crate::axes::Axes;
use crate::error::OmeZarrError;
use crate::image::{self, Image};
use crate::time_axis::TimeAxis;

/// Metres of the units of length that OME-Zarr names and scans have.
const METRES: [(&str, f64); 12] = [
    ("angstrom", 1e-10),
    ("picometer", 1e-12),
    ("nanometer", 1e-9),
    ("micrometer", 1e-6),
    ("millimeter", 1e-3),
    ("centimeter", 1e-2),
    ("decimeter", 1e-1),
    ("meter", 1.0),
    ("kilometer", 1e3),
    ("inch", 0.0254),
    ("foot", 0.3048),
    ("yard", 0.9144),
];

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Space {
    pub(crate) geometry: Geometry,
    pub(crate) placement: Placement,
    pub(crate) unit: Option<String>,
    pub(crate) notes: Vec<String>,
}

impl Space {
    pub(crate) fn of(image: &Image, array: &Array, axes: &Axes) -> Result<Self, OmeZarrError> {
        let count = array.shape.len();
        let [finest, all] = &image.transforms;
        let lists = [&finest.scale, &finest.translation, &all.scale, &all.translation];
        if let Some(list) = lists.into_iter().flatten().find(|list| list.len() != count) {
            let problem = format!("a scale or translation has {} numbers, the array {count} axes", list.len());
            return Err(array.json.problem(problem));
        }
        // An axis that the array does not have: one voxel, as deep as it is wide.
        let along = |list: &Option<Vec<f64>>, axis: Option<usize>, usual: f64| match (list, axis) {
            (Some(list), Some(axis)) => list[axis],
            _ => usual,
        };
        let (mut scale, mut origin) = (DVec3::ONE, DVec3::ZERO);
        for (i, axis) in axes.space.into_iter().enumerate() {
            let outer = along(&all.scale, axis, 1.0);
            scale[i] = along(&finest.scale, axis, 1.0) * outer;
            origin[i] = along(&finest.translation, axis, 0.0) * outer + along(&all.translation, axis, 0.0);
        }
        if axes.space[2].is_none() {
            scale.z = scale.x.abs();
        }
        let mut notes = Vec::new();
        let unit = unit(image, axes, (&mut scale, &mut origin), &mut notes);
        let dims = axes.space.map(|axis| axis.map_or(1, |axis| u32::try_from(array.shape[axis]).unwrap_or(u32::MAX)));
        // An axis that runs backwards keeps its voxels, and lies the other way in space.
        let backwards = scale.map(|s| if s < 0.0 { -1.0 } else { 1.0 });
        let geometry = Geometry::new(dims, scale.abs().to_array(), (origin + 0.0).to_array())?;
        let geometry = geometry.with_directions(DMat3::from_diagonal(backwards))?;
        let has_scale = finest.scale.is_some() || all.scale.is_some();
        if !has_scale {
            notes.push("spacing not said: 1, 1, 1 assumed".to_owned());
        }
        let has_origin = finest.translation.is_some() || all.translation.is_some();
        let placement = Placement { spacing: has_scale, origin: has_origin, directions: false };
        Ok(Self { geometry, placement, unit, notes })
    }
}

/// The axis of time of the image at the root of `objects`, where it has one.
pub(crate) fn times(objects: &dyn Objects) -> Result<Option<TimeAxis>, OmeZarrError> {
    let image = image::find(objects)?;
    let array = Array::of(&image.node, &image.array)?;
    let (count, axes) = (array.shape.len(), image.axes.as_deref());
    let axis = match axes {
        Some(axes) => axes.iter().position(|axis| axis.name == "t"),
        // The usual order, as it is assumed.
        None => (count == 5).then_some(0),
    };
    let Some((axis, length)) = axis.and_then(|axis| Some((axis, *array.shape.get(axis)?))) else { return Ok(None) };
    let [finest, all] = &image.transforms;
    let at = |list: &Option<Vec<f64>>| list.as_ref().and_then(|list| list.get(axis).copied());
    let outer = at(&all.scale).unwrap_or(1.0);
    let step = at(&finest.scale).or(at(&all.scale).map(|_| 1.0)).map(|step| step * outer);
    let step = step.filter(|step| step.is_finite() && *step > 0.0);
    let first = at(&finest.translation).unwrap_or(0.0) * outer + at(&all.translation).unwrap_or(0.0);
    let unit = axes.and_then(|axes| axes.get(axis)?.unit.clone()).filter(|unit| unit.len() < 100);
    Ok(Some(TimeAxis { count: length, first: if first.is_finite() { first } else { 0.0 }, step, unit }))
}

/// The unit of all axes: that of x, to which those of others are taken.
fn unit(
    image: &Image,
    axes: &Axes,
    (scale, origin): (&mut DVec3, &mut DVec3),
    notes: &mut Vec<String>,
) -> Option<String> {
    let said = image.axes.as_ref()?;
    let of = |axis: Option<usize>| said.get(axis?)?.unit.as_deref();
    let unit = of(axes.space[0])?;
    let metres = |unit: &str| METRES.iter().find(|(name, _)| *name == unit).map(|(_, metres)| *metres);
    for (i, name) in [(1, "y"), (2, "z")] {
        match of(axes.space[i]) {
            Some(other) if other != unit => match (metres(other), metres(unit)) {
                (Some(other_metres), Some(own)) => {
                    (scale[i], origin[i]) = (scale[i] * (other_metres / own), origin[i] * (other_metres / own));
                    notes.push(format!("{name} is in {other}, and was taken to the {unit} of x"));
                }
                _ => notes.push(format!("the units of x and {name} differ, and one is unknown: taken as they are")),
            },
            _ => {}
        }
    }
    Some(unit.to_owned())
}
