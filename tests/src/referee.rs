//! The referee: a plain f64 raycaster, written from the definition of the picture and sharing no code with the product.
//!
//! It is slow and obvious on purpose. [`render`] marches through the whole volume; [`render_bricks`] marches brick by
//! brick, with or without a deliberate mistake ([`Sabotage`]), so that tests can show which mistakes their tolerances
//! would catch.

mod camera;
mod clip;
mod march;
mod sabotage;
mod styled;
mod transfer;
mod volume;

pub use camera::{Camera, Lens, Ray};
pub use march::{Rendering, render, render_bricks};
pub use sabotage::Sabotage;
pub use styled::{Light, LightAt, Mistake, Projection, Style, render_styled};
pub use transfer::Transfer;
pub use volume::Volume;

/// All that a picture is made of. Lengths are world units unless said otherwise.
#[derive(Debug, Clone)]
pub struct Scene {
    pub volume: Volume,
    pub camera: Camera,
    pub transfer: Transfer,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Sample distance in units of the smallest spacing.
    pub step: f64,
    /// Length to which opacities refer: `a' = 1 - (1 - a)^(Delta / unit)`.
    pub unit: f64,
    /// Rays stop once their opacity reaches this; 1 never stops them before the volume's end.
    pub early_termination: f64,
}

impl Scene {
    /// The sample distance, world units.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.step * self.volume.min_spacing()
    }
}
