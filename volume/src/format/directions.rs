//! The vectors of a file's axes become spacing and directions that are exactly at right angles.

use glam::{DMat3, DVec3};

/// How far, of length one, an axis may be from the directions that it is snapped to: rounding and calibration, no
/// shear.
const SNAP: f64 = 1e-3;
/// Axes that all are this near to x, y, z, in any order and sign, are meant to be these.
const ON_AXIS: f64 = 1e-4;
/// What the decimals of a header leave; not worth a word.
pub(super) const TOLD: f64 = 1e-6;

/// Axes as a [`crate::space::Geometry`] takes them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Lengths of the vectors.
    pub spacing: [f64; 3],
    /// Orthonormal, one axis a column.
    pub directions: DMat3,
    /// The farthest that an axis was moved, of length one.
    pub moved: f64,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxesError {
    #[error("axis {axis} has the vector {vector}: it must be finite and not zero")]
    Length { axis: usize, vector: DVec3 },
    #[error(
        "the axes are sheared: they are at angles of {xy:.2} (x, y), {yz:.2} (y, z) and {zx:.2} (z, x) degrees, not \
         90; resample the volume to axes at right angles"
    )]
    Sheared { xy: f64, yz: f64, zx: f64 },
}

impl Axes {
    /// `vectors`: from a voxel to the next along each axis, world.
    ///
    /// # Errors
    /// A vector without length, axes that are not at right angles.
    pub fn of(vectors: [DVec3; 3]) -> Result<Self, AxesError> {
        let spacing = vectors.map(DVec3::length);
        for axis in 0..3 {
            if !(spacing[axis].is_finite() && spacing[axis] > 0.0) {
                return Err(AxesError::Length { axis, vector: vectors[axis] });
            }
        }
        let units: [DVec3; 3] = std::array::from_fn(|axis| vectors[axis] / spacing[axis]);
        let found = on_axes(units).or_else(|| nearest_orthonormal(units));
        let moved = |directions: DMat3| (0..3).map(|a| (directions.col(a) - units[a]).length()).fold(0.0, f64::max);
        match found.map(|directions| Self { spacing, directions, moved: moved(directions) }) {
            // NaN is no distance either.
            Some(axes) if axes.moved <= SNAP => Ok(axes),
            _ => {
                let [x, y, z] = units;
                let angle = |a: DVec3, b: DVec3| a.dot(b).clamp(-1.0, 1.0).acos().to_degrees();
                Err(AxesError::Sheared { xy: angle(x, y), yz: angle(y, z), zx: angle(z, x) })
            }
        }
    }
}

/// The flip and permutation that all of `units` are near to.
fn on_axes(units: [DVec3; 3]) -> Option<DMat3> {
    let mut columns = [DVec3::ZERO; 3];
    let mut taken = DVec3::ZERO;
    for (column, unit) in columns.iter_mut().zip(units) {
        let along = unit.abs().max_position();
        column[along] = unit[along].signum();
        taken[along] += 1.0;
        if (*column - unit).length() > ON_AXIS {
            return None;
        }
    }
    (taken == DVec3::ONE).then(|| DMat3::from_cols(columns[0], columns[1], columns[2]))
}

/// The orthogonal factor of the polar decomposition, by Newton's iteration (Higham 1986); mirrors stay mirrors.
fn nearest_orthonormal([x, y, z]: [DVec3; 3]) -> Option<DMat3> {
    let mut r = DMat3::from_cols(x, y, z);
    // Near orthonormal it is 1 or -1; far from it there is nothing to snap to.
    if !(0.9..1.1).contains(&r.determinant().abs()) {
        return None;
    }
    for _ in 0..8 {
        r = (r + r.inverse().transpose()) * 0.5;
    }
    Some(r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(m: DMat3) -> [DVec3; 3] {
        [m.x_axis, m.y_axis, m.z_axis]
    }

    #[test]
    fn flips_and_permutations_are_exact() {
        let near = DVec3::new(3e-5, -4e-5, 2e-5);
        let vectors = [DVec3::NEG_Z + near, DVec3::X * 2.0, DVec3::new(1e-5, 3.0, 0.0)];
        let axes = Axes::of(vectors).unwrap();
        assert_eq!(axes.directions, DMat3::from_cols(DVec3::NEG_Z, DVec3::X, DVec3::Y));
        assert!((axes.spacing[1], axes.spacing[2].round()) == (2.0, 3.0) && axes.moved > 4e-5 && axes.moved < 1e-4);
        // A quarter of a thousandth of a turn is a rotation that someone meant.
        let turned = Axes::of(columns(DMat3::from_rotation_z(1.6e-3))).unwrap();
        assert!(turned.moved < 1e-15 && turned.directions.x_axis.y > 1.5e-3);
    }

    #[test]
    fn rotations_and_mirrors_are_made_orthonormal_and_say_how_far() {
        for mirror in [DVec3::ONE, DVec3::new(1.0, -1.0, 1.0)] {
            let exact = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -0.7, 1.1) * DMat3::from_diagonal(mirror);
            let bent = DMat3::from_cols(exact.x_axis + exact.y_axis * 8e-4, exact.y_axis, exact.z_axis) * 2.5;
            let axes = Axes::of(columns(bent)).unwrap();
            let product = axes.directions.transpose() * axes.directions;
            assert!(product.abs_diff_eq(DMat3::IDENTITY, 1e-14), "{product}");
            assert!(axes.directions.abs_diff_eq(exact, 1e-3) && axes.moved > 3e-4 && axes.moved < 1e-3);
            assert_eq!(axes.directions.determinant().signum(), mirror.y);
        }
    }

    #[test]
    fn sheared_zero_and_endless_axes_are_refused() {
        let sheared = Axes::of([DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z]).unwrap_err().to_string();
        assert!(sheared.contains("sheared") && sheared.contains("45.00 (x, y), 90.00 (y, z)"), "{sheared}");
        let slight = [DVec3::X, DVec3::new(4e-3, 1.0, 0.0), DVec3::Z];
        assert!(matches!(Axes::of(slight), Err(AxesError::Sheared { .. })));
        assert!(matches!(Axes::of([DVec3::X, DVec3::X, DVec3::Z]), Err(AxesError::Sheared { .. })));
        for bad in [DVec3::ZERO, DVec3::NAN, DVec3::new(0.0, f64::INFINITY, 0.0)] {
            assert!(matches!(Axes::of([DVec3::X, bad, DVec3::Z]), Err(AxesError::Length { axis: 1, .. })), "{bad}");
        }
    }
}
