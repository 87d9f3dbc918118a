//! Where a frame lies and what its numbers mean, as a data set or one of its functional groups says it.

use brickcast_volume::format::excerpt;
use glam::DVec3;

use super::tags;
use crate::wrong::Wrong;

/// What is not said is said by the group above, or by none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Group {
    /// Of the centre of the first pixel, in mm, LPS.
    pub(super) position: Option<DVec3>,
    /// The direction of rising columns, and that of rising rows.
    pub(super) axes: Option<[DVec3; 2]>,
    /// Between rows, then between columns.
    pub(super) spacing: Option<[f64; 2]>,
    pub(super) between: Option<f64>,
    pub(super) thickness: Option<f64>,
    pub(super) slope: Option<f64>,
    pub(super) intercept: Option<f64>,
}

/// Text of a value, without what pads it.
pub(super) fn text(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
}

/// Decimal numbers between backslashes; none in an empty value.
pub(super) fn decimals(tag: u32, value: &[u8]) -> Result<Vec<f64>, Wrong> {
    let text = text(value);
    let number = |word: &str| word.trim().parse::<f64>().ok().filter(|n| n.is_finite());
    let numbers = (!text.is_empty()).then(|| text.split('\\').map(number).collect::<Option<Vec<_>>>());
    numbers
        .unwrap_or_else(|| Some(Vec::new()))
        .ok_or_else(|| Wrong::broken(tags::name(tag), format!("`{}` is no decimal number", excerpt(&text))))
}

fn some<const N: usize>(tag: u32, value: &[u8]) -> Result<Option<[f64; N]>, Wrong> {
    let numbers = decimals(tag, value)?;
    match (numbers.as_slice().try_into(), numbers.is_empty()) {
        (Ok(numbers), _) => Ok(Some(numbers)),
        (_, true) => Ok(None),
        _ => Err(Wrong::broken(tags::name(tag), format!("{} numbers instead of {N}", numbers.len()))),
    }
}

impl Group {
    /// Keeps what `tag` says, where it says something of these.
    pub(super) fn put(&mut self, tag: u32, value: &[u8]) -> Result<(), Wrong> {
        let one = || some::<1>(tag, value).map(|n| n.map(|[n]| n));
        match tag {
            tags::POSITION => self.position = some::<3>(tag, value)?.map(DVec3::from),
            tags::ORIENTATION => self.axes = some::<6>(tag, value)?.map(axes).transpose()?,
            tags::SPACING => self.spacing = some::<2>(tag, value)?.filter(|s| s.iter().all(|s| *s > 0.0)),
            // Old writers make them negative; some leave 0 where they do not know.
            tags::BETWEEN => self.between = one()?.map(f64::abs).filter(|s| *s > 0.0),
            tags::THICKNESS => self.thickness = one()?.map(f64::abs).filter(|s| *s > 0.0),
            tags::SLOPE | tags::DOSE_SCALING => self.slope = one()?,
            tags::INTERCEPT => self.intercept = one()?,
            _ => {}
        }
        Ok(())
    }

    /// What this one does not say, from the one above.
    pub(super) fn or(self, above: &Self) -> Self {
        Self {
            position: self.position.or(above.position),
            axes: self.axes.or(above.axes),
            spacing: self.spacing.or(above.spacing),
            between: self.between.or(above.between),
            thickness: self.thickness.or(above.thickness),
            slope: self.slope.or(above.slope),
            intercept: self.intercept.or(above.intercept),
        }
    }

    /// The direction that slices are stacked in.
    pub(super) fn normal(&self) -> DVec3 {
        self.axes.map_or(DVec3::Z, |[x, y]| x.cross(y))
    }
}

fn axes([a, b, c, d, e, f]: [f64; 6]) -> Result<[DVec3; 2], Wrong> {
    let (x, y) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
    match (x.try_normalize(), y.try_normalize()) {
        // Axes that are nearly the same have no normal.
        (Some(x), Some(y)) if x.cross(y).length() > 0.5 => Ok([x, y]),
        _ => Err(Wrong::broken(tags::name(tags::ORIENTATION), format!("{x} and {y} span no plane"))),
    }
}
