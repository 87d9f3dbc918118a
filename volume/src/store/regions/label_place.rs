//! Whether a label volume lies where the volume does.

use glam::DVec3;

use super::error::RegionsError;
use crate::format::Placement;
use crate::space::Geometry;

/// A geometry, and what of it was said.
pub(crate) type Placed<'a> = (&'a Geometry, Placement);

/// Labels must lie where the volume does, as far as both say where that is; of equal dims.
pub(crate) fn check((volume, of_volume): Placed<'_>, (labels, of_labels): Placed<'_>) -> Result<(), RegionsError> {
    let spacing = of_volume.spacing && of_labels.spacing;
    let origin = of_volume.origin && of_labels.origin;
    let directions = of_volume.directions && of_labels.directions;
    // What only one of them says is not compared: the labels take it from the volume.
    let choose = |both: bool, part: fn(&Geometry) -> DVec3| part(if both { labels } else { volume }).to_array();
    let turned = if directions { labels.directions() } else { volume.directions() };
    let there =
        Geometry::new(volume.dims().to_array(), choose(spacing, Geometry::spacing), choose(origin, Geometry::origin))
            .and_then(|geometry| geometry.with_directions(turned));
    if there.as_ref().is_ok_and(|there| is_same_place(volume, there)) {
        return Ok(());
    }
    let differ = |a: DVec3, b: DVec3, slack: f64| (a - b).abs().max_element() > slack;
    let far = [
        spacing && differ(volume.spacing(), labels.spacing(), DIGITS * volume.spacing().max_element()),
        origin && differ(volume.origin(), labels.origin(), slack(volume, volume.origin())),
        directions && (0..3).any(|a| differ(volume.directions().col(a), labels.directions().col(a), DIGITS)),
    ];
    // Each within its rounding, and together beyond it: all that was compared.
    let far = if far == [false; 3] { [spacing, origin, directions] } else { far };
    let words = |g: &Geometry| {
        let mut parts = Vec::new();
        if far[0] {
            parts.push(format!("spacing {:?}", g.spacing().to_array()));
        }
        if far[1] {
            parts.push(format!("origin {:?}", g.origin().to_array()));
        }
        if far[2] {
            parts.push(format!("directions {:?}", g.directions().to_cols_array_2d()));
        }
        parts.join(", ")
    };
    Err(RegionsError::LabelPlace { got: words(labels), want: words(volume) })
}

/// Six significant digits, as many tools write.
const DIGITS: f64 = 1e-5;

/// How far a point may be off: a thousandth of a voxel, and what six digits leave of its coordinates.
fn slack(volume: &Geometry, p_world: DVec3) -> f64 {
    1e-3 * volume.min_spacing() + DIGITS * p_world.abs().max_element()
}

fn is_same_place(a: &Geometry, b: &Geometry) -> bool {
    a.corners_world().into_iter().zip(b.corners_world()).all(|(p, q)| (p - q).abs().max_element() <= slack(a, p))
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    const SAID: Placement = Placement { spacing: true, origin: true, directions: true };

    fn placed(spacing: [f64; 3], origin: [f64; 3]) -> Geometry {
        Geometry::new([24, 30, 20], spacing, origin).unwrap()
    }

    fn error(labels: &Geometry) -> String {
        check((&placed([1.0, 1.0, 2.0], [5.0, 0.0, -7.0]), SAID), (labels, SAID)).unwrap_err().to_string()
    }

    #[test]
    fn what_differs_is_named_with_the_numbers_of_both() {
        let shifted = error(&placed([1.0, 1.0, 2.0], [9.0, 0.0, -7.0]));
        assert!(
            shifted.contains("origin [9.0, 0.0, -7.0]") && shifted.contains("origin [5.0, 0.0, -7.0]"),
            "{shifted}"
        );
        assert!(!shifted.contains("spacing [") && !shifted.contains("directions ["), "{shifted}");
        let finer = error(&placed([0.5, 1.0, 2.0], [5.0, 0.0, -7.0]));
        assert!(finer.contains("spacing [0.5, 1.0, 2.0]") && finer.contains("spacing [1.0, 1.0, 2.0]"), "{finer}");
        let both = error(&placed([1.0, 1.0, 2.02], [5.0, 0.1, -7.0]));
        assert!(both.contains("spacing [1.0, 1.0, 2.02], origin [5.0, 0.1, -7.0]"), "{both}");
    }

    /// Stored from the far end, they cover the same space, and voxel by voxel another place.
    #[test]
    fn labels_stored_in_another_order_are_refused() {
        let flipped = placed([1.0, 1.0, 2.0], [5.0, 0.0, -7.0 + 2.0 * 19.0]);
        let flipped = flipped.with_directions(DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0))).unwrap();
        let says = error(&flipped);
        assert!(says.contains("directions [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]"), "{says}");
    }

    #[test]
    fn rounding_is_no_difference() {
        let volume = Geometry::new([2000, 2000, 1000], [1.0 / 3.0; 3], [-123.456_789, 0.1, 2.0]).unwrap();
        let short = Geometry::new([2000, 2000, 1000], [0.333_333; 3], [-123.457, 0.1, 2.0]).unwrap();
        assert!(check((&volume, SAID), (&short, SAID)).is_ok());
        let single =
            Geometry::new([2000, 2000, 1000], [f64::from(1.0_f32 / 3.0); 3], [-123.456_789, 0.1, 2.0]).unwrap();
        assert!(check((&volume, SAID), (&single, SAID)).is_ok());
        let off = Geometry::new([2000, 2000, 1000], [1.0 / 3.0; 3], [-123.44, 0.1, 2.0]).unwrap();
        assert!(check((&volume, SAID), (&off, SAID)).is_err());
    }

    /// Only what both say is compared.
    #[test]
    fn what_one_of_them_does_not_say_cannot_differ() {
        let (volume, labels) = (placed([1.0, 1.0, 2.0], [5.0, 0.0, -7.0]), placed([1.0; 3], [0.0; 3]));
        let spacing = Placement { spacing: true, ..Placement::default() };
        let origin = Placement { origin: true, ..Placement::default() };
        assert!(check((&volume, SAID), (&labels, Placement::default())).is_ok());
        assert!(check((&volume, Placement::default()), (&labels, SAID)).is_ok());
        assert!(check((&volume, origin), (&labels, spacing)).is_ok());
        let says = check((&volume, SAID), (&labels, spacing)).unwrap_err().to_string();
        assert!(says.contains("spacing [") && !says.contains("origin ["), "{says}");
        let says = check((&volume, origin), (&labels, SAID)).unwrap_err().to_string();
        assert!(says.contains("origin [") && !says.contains("spacing ["), "{says}");
    }
}
