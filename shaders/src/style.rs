//! The uniform of a scene's style: light, isosurfaces, clip planes.

use brickcast_volume::Geometry;
use brickcast_volume::style::{MAX_PLANES, MAX_SURFACES, Style};
use bytemuck::{Pod, Zeroable};

/// What a scene's style is to the kernel; `tests/layout.rs` compares names and offsets with the WGSL's.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StyleUniform {
    /// The volume's upper corner; its lower one is zero. Index space.
    pub volume_hi: [i32; 3],
    pub surface_count: u32,
    /// Direction towards the light by its parts along the index axes, of length one; zero: from where the ray comes.
    pub light: [f32; 3],
    pub ambient: f32,
    pub diffuse: f32,
    pub specular: f32,
    pub shininess: f32,
    pub plane_count: u32,
    /// Light fades in from a gradient of this length to twice it; codes (0..=1) per smallest spacing.
    pub light_from: f32,
    pub reserved: [u32; 3],
    /// Codes (0..=1) of the isosurfaces, ascending, in x.
    pub codes: [[f32; 4]; MAX_SURFACES],
    /// Their straight colours and opacities.
    pub colors: [[f32; 4]; MAX_SURFACES],
    /// Index space: what stays has `dot(n, p) >= w`.
    pub planes: [[f32; 4]; MAX_PLANES],
}

impl StyleUniform {
    /// Of a scene that has none: no kernel reads it.
    pub const PLAIN: Self = Self {
        volume_hi: [0; 3],
        surface_count: 0,
        light: [0.0; 3],
        ambient: 0.0,
        diffuse: 0.0,
        specular: 0.0,
        shininess: 0.0,
        plane_count: 0,
        light_from: 0.0,
        reserved: [0; 3],
        codes: [[0.0; 4]; MAX_SURFACES],
        colors: [[0.0; 4]; MAX_SURFACES],
        planes: [[0.0; 4]; MAX_PLANES],
    };

    /// `range`: data units of codes 0 and 1. A style that is not valid is cut to what fits.
    #[must_use]
    pub fn new(style: &Style, geometry: &Geometry, range: (f64, f64)) -> Self {
        let mut uniform = Self::PLAIN;
        uniform.volume_hi = geometry.dims().as_ivec3().into();
        for (i, surface) in style.sorted_surfaces().iter().take(MAX_SURFACES).enumerate() {
            let [r, g, b] = surface.color;
            uniform.codes[i][0] = surface.code(range);
            uniform.colors[i] = [r, g, b, surface.opacity];
            uniform.surface_count += 1;
        }
        for (to, plane) in uniform.planes.iter_mut().zip(style.clip.index_planes(geometry)) {
            *to = plane.as_vec4().into();
            uniform.plane_count += 1;
        }
        if let Some(phong) = style.shading {
            uniform.light = phong.light.map_or([0.0; 3], |l| geometry.along_axes(l.normalize()).as_vec3().into());
            (uniform.ambient, uniform.diffuse) = (phong.ambient, phong.diffuse);
            (uniform.specular, uniform.shininess) = (phong.specular, phong.shininess);
            uniform.light_from = phong.light_from_share(range) as f32;
        }
        uniform
    }
}
