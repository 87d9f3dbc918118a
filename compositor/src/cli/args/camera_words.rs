//! From where a camera looks, as a word.

use clap::ValueEnum;

/// A side of the volume, seen with the chosen axis up; right and left are the viewer's before the front.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// Azimuth 0
    Front,
    /// Azimuth 90
    Right,
    /// Azimuth 180
    Back,
    /// Azimuth 270
    Left,
    /// Elevation 90
    Top,
    /// Elevation -90
    Bottom,
    /// Front, right and top alike: azimuth 45, elevation 35.26
    Iso,
}

impl Side {
    /// Azimuth and elevation, degrees.
    #[must_use]
    pub fn angles(self) -> (f64, f64) {
        match self {
            Self::Front => (0.0, 0.0),
            Self::Right => (90.0, 0.0),
            Self::Back => (180.0, 0.0),
            Self::Left => (270.0, 0.0),
            Self::Top => (0.0, 90.0),
            Self::Bottom => (0.0, -90.0),
            Self::Iso => (45.0, std::f64::consts::FRAC_1_SQRT_2.atan().to_degrees()),
        }
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::{Camera, Geometry, Orbit};
    use glam::DVec3;

    use super::*;

    #[test]
    fn iso_sees_three_faces_alike() {
        let cube = Geometry::new([10; 3], [1.0; 3], [0.0; 3]).unwrap();
        let (azimuth, elevation) = Side::Iso.angles();
        assert!((elevation - 35.264_389_682_754_654).abs() < 1e-12);
        let camera = Camera::orbit(&cube, Orbit { azimuth, elevation, ..Orbit::default() }).unwrap();
        let direction = (camera.position() - camera.focal_point()).normalize();
        assert!((direction - DVec3::ONE.normalize()).length() < 1e-12, "{direction}");
    }
}
