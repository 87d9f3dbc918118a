//! Which axis of the world points up, and where the others go then.

use glam::DVec3;

use crate::words::words;

/// The axis of the world that points up in a picture; azimuth and elevation are counted around it.
///
/// | up | right | towards the viewer at azimuth 0 |
/// | --- | --- | --- |
/// | y | x | z |
/// | z | x | -y |
/// | x | -y | z |
///
/// The opposite of an axis is that turned by half a turn about the direction towards the viewer: the same front, upside
/// down. All six are rotations, so what is right-handed stays so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Up {
    X,
    #[default]
    Y,
    Z,
    NegativeX,
    NegativeY,
    NegativeZ,
}

words!(
    Up,
    "axis",
    [(X, "x", ""), (Y, "y", ""), (Z, "z", ""), (NegativeX, "-x", ""), (NegativeY, "-y", ""), (NegativeZ, "-z", "")]
);

impl Up {
    /// `(right, up, towards the viewer)` in the world; exact, and for y the vector itself.
    #[must_use]
    pub fn turn(self, v: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(v.y, -v.x, v.z),
            Self::Y => v,
            Self::Z => DVec3::new(v.x, -v.z, v.y),
            Self::NegativeX => DVec3::new(-v.y, v.x, v.z),
            Self::NegativeY => DVec3::new(-v.x, -v.y, v.z),
            Self::NegativeZ => DVec3::new(-v.x, -v.z, -v.y),
        }
    }

    /// Of length one.
    #[must_use]
    pub fn axis(self) -> DVec3 {
        self.turn(DVec3::Y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Orbit};
    use crate::space::Geometry;
    use crate::words::Words as _;

    fn each() -> impl Iterator<Item = Up> {
        Up::WORDS.iter().map(|word| word.value)
    }

    #[test]
    fn every_up_is_a_rotation_that_brings_y_to_its_axis() {
        for (up, axis) in [
            ("x", DVec3::X),
            ("y", DVec3::Y),
            ("z", DVec3::Z),
            ("-x", DVec3::NEG_X),
            ("-y", DVec3::NEG_Y),
            ("-z", DVec3::NEG_Z),
        ] {
            let up: Up = up.parse().unwrap();
            assert_eq!(up.axis(), axis);
            let [right, above, front] = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| up.turn(v));
            assert_eq!(right.cross(above), front, "{up}: right-handed");
        }
    }

    /// The front of what stands on z is its -y side, with x to the right: as CAD programs have it, and for a patient
    /// (LPS) from the front.
    #[test]
    fn with_z_up_azimuth_goes_from_minus_y_over_x() {
        let g = Geometry::new([8, 10, 12], [1.0; 3], [0.0; 3]).unwrap();
        let of = |azimuth: f64, elevation: f64| {
            let camera = Camera::orbit(&g, Orbit { azimuth, elevation, up: Up::Z, ..Orbit::default() }).unwrap();
            let direction = (camera.position() - g.center_world()).normalize();
            (direction.round(), camera.view_up(), camera.basis().0.round())
        };
        assert_eq!(of(0.0, 0.0), (DVec3::NEG_Y, DVec3::Z, DVec3::X));
        assert_eq!(of(90.0, 0.0), (DVec3::X, DVec3::Z, DVec3::Y));
        assert_eq!(of(180.0, 0.0).0, DVec3::Y);
        assert_eq!(of(0.0, 90.0), (DVec3::Z, DVec3::Y, DVec3::X));
        assert_eq!(of(0.0, -90.0), (DVec3::NEG_Z, DVec3::NEG_Y, DVec3::X));
    }

    /// A volume turned with its up has the picture of the one that was not: the camera is the y-up camera, turned.
    #[test]
    fn cameras_and_sequences_turn_with_their_up() {
        let cube = Geometry::new([16; 3], [0.5; 3], [-3.75; 3]).unwrap();
        assert_eq!(cube.center_world(), DVec3::ZERO);
        for up in each() {
            for (azimuth, elevation) in [(0.0, 0.0), (33.0, 20.0), (200.0, -70.0), (10.0, 90.0), (45.0, -90.0)] {
                let orbit = Orbit { azimuth, elevation, zoom: 1.5, ..Orbit::default() };
                let plain = Camera::orbit(&cube, orbit).unwrap();
                let turned = Camera::orbit(&cube, Orbit { up, ..orbit }).unwrap();
                assert_eq!(turned.position(), up.turn(plain.position()), "{up} {azimuth} {elevation}");
                assert_eq!(turned.view_up(), up.turn(plain.view_up()), "{up} {azimuth} {elevation}");
                let [later, want] = [turned, plain].map(|camera| camera.orbited(70.0).unwrap().position());
                assert!((later - up.turn(want)).length() < 1e-12, "{up}: a sequence turns around it");
            }
        }
    }

    /// Where the eye is above or below, the sequence turns around the axis too.
    #[test]
    fn a_sequence_keeps_its_height_above_the_volume() {
        let g = Geometry::new([8, 10, 12], [1.0, 2.0, 0.5], [5.0; 3]).unwrap();
        for up in each() {
            let start = Camera::orbit(&g, Orbit { azimuth: 20.0, elevation: 35.0, up, ..Orbit::default() }).unwrap();
            let height = |camera: &Camera| (camera.position() - g.center_world()).dot(up.axis());
            let later = start.orbited(123.0).unwrap();
            assert!((height(&later) - height(&start)).abs() < 1e-9, "{up}");
        }
    }
}
