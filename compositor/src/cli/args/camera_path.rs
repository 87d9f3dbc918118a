//! The cameras of a sequence.

use brickcast_volume::camera::{Camera, CameraError};
use clap::ValueEnum;

/// How the camera moves over a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum CameraPath {
    /// Around the focal point
    #[default]
    Orbit,
    /// Towards the focal point, half a turn around it on the way, and back: close views put most of the work into few
    /// chunks
    Dive,
}

/// Of its first distance, how near to the focal point a dive gets.
const NEAREST: f64 = 0.08;

impl CameraPath {
    /// `count` cameras from `start` on; `degrees` is the whole turn.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn cameras(self, start: &Camera, count: u32, degrees: f64) -> Result<Vec<Camera>, CameraError> {
        (0..count)
            .map(|i| {
                if i == 0 {
                    return Ok(*start);
                }
                let turned = start.orbited(degrees * f64::from(i) / f64::from(count))?;
                match self {
                    Self::Orbit => Ok(turned),
                    Self::Dive => {
                        let depth = (std::f64::consts::PI * f64::from(i) / f64::from(count)).sin().powi(2);
                        let away = 1.0 - (1.0 - NEAREST) * depth;
                        let position = turned.focal_point() + (turned.position() - turned.focal_point()) * away;
                        Camera::new(position, turned.focal_point(), turned.view_up(), turned.projection())
                    }
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::{Geometry, Orbit};

    use super::*;

    #[test]
    fn a_dive_goes_in_and_comes_back() {
        let geometry = Geometry::new([64; 3], [1.0; 3], [0.0; 3]).unwrap();
        let start = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let cameras = CameraPath::Dive.cameras(&start, 60, 180.0).unwrap();
        let distance = |c: &Camera| (c.position() - c.focal_point()).length() / geometry.radius_world();
        assert_eq!(cameras[0], start);
        assert!(distance(&cameras[30]) < 0.4, "in the middle of the volume: {}", distance(&cameras[30]));
        assert!(distance(&cameras[59]) > 0.95 * distance(&start));
        let orbit = CameraPath::Orbit.cameras(&start, 8, 360.0).unwrap();
        assert!(orbit.iter().all(|c| (distance(c) - distance(&start)).abs() < 1e-9));
        assert!((orbit[4].position().z - 2.0 * start.focal_point().z + start.position().z).abs() < 1e-9);
    }
}
