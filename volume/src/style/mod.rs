//! What becomes of the values along a ray: integration, lighting, isosurfaces, projections, clipping.

mod clip;
mod error;
mod light_from;
mod limits;
mod surface;

pub use clip::{Clip, ClipPlane};
pub use error::StyleError;
pub use light_from::{LEAST_GRADIENT, NOISE_DEVIATIONS};
pub use limits::{MAX_CLIP_PLANES, MAX_PLANES, MAX_SURFACES};
pub use surface::Isosurface;

use glam::DVec3;

use crate::filter::Filter;
use crate::pixel::PixelKind;
pub use crate::preintegration::TableSize;
use crate::words::words;

/// How a transfer function is integrated between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integration {
    /// One value per step.
    #[default]
    Sampled,
    /// Every slab between two samples by a table over both values (Lum, Wilson & Ma 2004).
    Preintegrated(TableSize),
}

/// An [`Integration`] without its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IntegrationKind {
    Sampled,
    Preintegrated,
}

words!(
    IntegrationKind,
    "integration",
    [
        (Sampled, "sampled", "One value per step"),
        (Preintegrated, "preintegrated", "The transfer function's integral between two samples"),
    ]
);

/// Whether there is light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShadingKind {
    None,
    Phong,
}

words!(
    ShadingKind,
    "shading",
    [(None, "none", "Colours as they are"), (Phong, "phong", "Phong's model, by the gradient"),]
);

/// Where a slab takes its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Lighting {
    /// At both ends, interpolated within the integral (Lum, Wilson & Ma 2004, section 4).
    #[default]
    Interpolated,
    /// In its middle.
    Center,
    /// Where what it emits comes from on average: near the front of an opaque one. Light there is what falls on what is
    /// seen, however it changes along the ray; one gradient a slab.
    Centroid,
}

words!(
    Lighting,
    "lighting",
    [
        (Interpolated, "interpolated", "At both ends of a slab, interpolated within the integral"),
        (Center, "center", "In the middle of a slab"),
        (Centroid, "centroid", "Where what a slab emits comes from on average"),
    ]
);

impl Lighting {
    /// True where the pre-integration table is weighted by either end.
    #[must_use]
    pub const fn needs_weights(self) -> bool {
        matches!(self, Self::Interpolated | Self::Centroid)
    }
}

/// Phong's model. The colour of a sample is multiplied by `ambient + diffuse |n l|`, and `specular (n h)^shininess` of
/// white is added; both sides of a surface are lit. n is the gradient by central differences over one voxel,
/// interpolated. Light fades in with its length: where it is no longer than the volume's noise makes it, the factor is
/// 1 and nothing is added. The first slab or sample behind a clip plane is lit by that plane's normal, in full.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phong {
    pub lighting: Lighting,
    /// World direction towards the light; none: light comes from where the ray does.
    pub light: Option<DVec3>,
    pub ambient: f32,
    pub diffuse: f32,
    pub specular: f32,
    pub shininess: f32,
    /// Light fades in from a gradient of this length to twice it, data units per smallest spacing; none: see
    /// [`Style::above_noise`].
    pub light_from: Option<f64>,
}

impl Default for Phong {
    fn default() -> Self {
        Self {
            lighting: Lighting::default(),
            light: None,
            ambient: 0.2,
            diffuse: 0.8,
            specular: 0.3,
            shininess: 20.0,
            light_from: None,
        }
    }
}

/// What a pixel shows of the values on its ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Emission and absorption, front to back.
    #[default]
    Composite,
    /// The largest value, through the transfer function.
    Maximum,
    /// The smallest.
    Minimum,
    /// The mean of all samples.
    Average,
}

words!(
    Mode,
    "mode",
    [
        (Composite, "composite", "Emission and absorption"),
        (Maximum, "mip", "The largest value on each ray"),
        (Minimum, "minip", "The smallest value on each ray"),
        (Average, "average", "The mean value on each ray"),
    ]
);

impl Mode {
    /// What its pixels are until the frame is joined.
    #[must_use]
    pub const fn pixel_kind(self) -> PixelKind {
        match self {
            Self::Composite => PixelKind::Over,
            Self::Maximum => PixelKind::Largest,
            Self::Minimum => PixelKind::Smallest,
            Self::Average => PixelKind::Mean,
        }
    }
}

/// Everything about a picture that is neither camera nor transfer function nor acceleration. The default is the plain
/// emission-absorption picture of single samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Style {
    pub integration: Integration,
    /// None: colours as they are.
    pub shading: Option<Phong>,
    /// At most [`MAX_SURFACES`], of different values.
    pub surfaces: Vec<Isosurface>,
    pub mode: Mode,
    pub clip: Clip,
}

impl Style {
    /// True where rays need nothing but single samples, as the plain kernels take them.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// True where what lies between two samples matters: the last slab of a brick then ends at the first sample of the
    /// next.
    #[must_use]
    pub fn has_slabs(&self) -> bool {
        self.mode == Mode::Composite && (self.integration != Integration::Sampled || !self.surfaces.is_empty())
    }

    /// True where slabs come from a pre-integration table.
    #[must_use]
    pub fn integrates_slabs(&self) -> bool {
        self.mode == Mode::Composite && self.integration != Integration::Sampled
    }

    /// Voxels beyond a brick's owned box in which its rays may still read a position.
    #[must_use]
    pub fn reach(&self, step: f64) -> u32 {
        // A step is at most that many voxels along any axis: it is in voxels of the smallest spacing.
        if self.has_slabs() { step.ceil() as u32 } else { 0 }
    }

    /// Voxels that a gradient looks beyond a position's support.
    #[must_use]
    pub fn gradient_radius(&self) -> u32 {
        u32::from(self.shading.is_some())
    }

    /// Ghost layers that a brick needs (docs/algorithms.md, Ghost layers and halos): what its last back sample and its
    /// gradients read.
    #[must_use]
    pub fn ghost(&self, step: f64) -> u32 {
        crate::brick::GHOST_SAMPLED + self.reach(step) + self.gradient_radius()
    }

    /// Nodes, at most, of the tables of slabs by which the scene's empty space is told; without pre-integration there
    /// are none to keep to.
    #[must_use]
    pub fn table_entries(&self) -> usize {
        match self.integration {
            Integration::Preintegrated(size) if self.mode == Mode::Composite => size.entries(),
            _ => crate::transfer_function::table::ENTRIES,
        }
    }

    /// The 16-bit codes (of `range`, data units) of the isosurfaces, ascending, each rounded down by more than kernels
    /// round: a voxel below shows nothing of the surface nor of what it encloses.
    #[must_use]
    pub fn surface_codes(&self, range: (f64, f64)) -> Vec<u16> {
        let code = |s: &Isosurface| (f64::from(s.code(range)) * 65535.0).floor().clamp(1.0, 65535.0) as u16 - 1;
        self.sorted_surfaces().iter().map(code).collect()
    }

    /// Surfaces by ascending value, as the kernels want them.
    #[must_use]
    pub fn sorted_surfaces(&self) -> Vec<Isosurface> {
        let mut surfaces = self.surfaces.clone();
        surfaces.sort_by(|a, b| a.value.total_cmp(&b.value));
        surfaces
    }

    /// # Errors
    /// What `filter` has no values for: labels have nothing between them.
    pub fn validate_with(&self, filter: Filter) -> Result<(), StyleError> {
        let what = match filter {
            Filter::Hardware | Filter::Exact => return Ok(()),
            Filter::Nearest if !self.surfaces.is_empty() => "isosurfaces",
            Filter::Nearest if self.shading.is_some() => "gradients, and so no light (shading)",
            Filter::Nearest if self.integrates_slabs() => "values to integrate over (preintegrated)",
            Filter::Nearest => return Ok(()),
        };
        Err(StyleError::Nearest { what })
    }

    /// # Errors
    /// Numbers out of range, too many of something, things that do not go together.
    pub fn validate(&self) -> Result<(), StyleError> {
        if self.surfaces.len() > MAX_SURFACES {
            return Err(StyleError::Surfaces { got: self.surfaces.len() });
        }
        for surface in &self.surfaces {
            surface.validate()?;
        }
        for pair in self.sorted_surfaces().windows(2) {
            if pair[0].value == pair[1].value {
                return Err(StyleError::SameSurface { value: pair[0].value });
            }
        }
        if let Some(phong) = &self.shading {
            let named = [
                ("ambient", phong.ambient, 4.0),
                ("diffuse", phong.diffuse, 4.0),
                ("specular", phong.specular, 4.0),
                ("shininess", phong.shininess, 1000.0),
            ];
            for (name, value, most) in named {
                if !(0.0..=most).contains(&value) {
                    return Err(StyleError::Light { name, value, most });
                }
            }
            if let Some(light) = phong.light.filter(|l| !(l.is_finite() && l.length_squared().is_normal())) {
                return Err(StyleError::LightDirection(light));
            }
            if let Some(length) = phong.light_from.filter(|l| !(l.is_finite() && *l >= 0.0)) {
                return Err(StyleError::LightFrom(length));
            }
        }
        if self.mode != Mode::Composite && (self.shading.is_some() || !self.surfaces.is_empty()) {
            return Err(StyleError::Projection);
        }
        self.clip.validate()
    }
}

#[cfg(test)]
mod tests;
