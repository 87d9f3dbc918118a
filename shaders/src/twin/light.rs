//! `wgsl/shared/light.wgsl` on the CPU: values anywhere on a ray, gradients, and Phong's factors.

use super::bindings::Along;
use super::holes::is_no_data;
use super::power::power;
use super::ray::dot;
use super::read::clamped;
use super::scene::styled::inside;
use super::walk::leap::deep_at;

/// Of a place: what its colour is multiplied by, and how much white is added per opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lit {
    pub(crate) factor: f32,
    pub(crate) glint: f32,
}

/// Where the gradient vanishes.
pub(super) const UNLIT: Lit = Lit { factor: 1.0, glint: 0.0 };

/// The trilinear code, negative where there is none; the support must be free of leap voxels.
#[inline(always)]
fn trilinear_at(along: &Along<'_>, p: [f32; 3]) -> f32 {
    along.reader.read_volume(p) * along.bound.brick.code_scale
}

/// The code of V' anywhere.
pub(super) fn value_at(along: &Along<'_>, p: [f32; 3]) -> f32 {
    deep_at(along, p).unwrap_or_else(|| trilinear_at(along, p))
}

/// By central differences over one voxel, interpolated; codes per smallest spacing. None where a place that it uses
/// holds no data.
#[inline(always)]
pub(super) fn gradient_at(along: &Along<'_>, p: [f32; 3]) -> Option<[f32; 3]> {
    let (style, per_unit) = (along.style(), along.frame().voxels_per_unit);
    let mut has_data = true;
    let gradient = std::array::from_fn(|a| {
        let (mut ahead, mut behind) = (p, p);
        ahead[a] += 1.0;
        behind[a] -= 1.0;
        // Written out: a closure for both is a call of its own, and takes a third longer.
        let (ahead, behind) = (trilinear_at(along, inside(style, ahead)), trilinear_at(along, inside(style, behind)));
        has_data &= !is_no_data(ahead.min(behind));
        (ahead - behind) * 0.5 * per_unit[a]
    });
    has_data.then_some(gradient)
}

/// Phong's factors at a place.
pub(super) fn light_at(along: &Along<'_>, p: [f32; 3]) -> Lit {
    if deep_at(along, p).is_some() {
        return UNLIT;
    }
    let Some(gradient) = gradient_at(along, p) else { return UNLIT };
    let steepness = dot(gradient, gradient).sqrt();
    // Homogeneous material is not lit by its noise.
    let part = clamped(steepness / along.style().light_from - 1.0, 1.0);
    let strength = part * part * (3.0 - 2.0 * part);
    if strength == 0.0 { UNLIT } else { lit(along, gradient, steepness, strength) }
}

/// Phong's factors on the face, of the volume or of a clip, by which the ray enters: the cut is flat, whatever is cut.
pub(crate) fn light_of_entry(along: &Along<'_>) -> Lit {
    let (ray, style, per_unit) = (along.ray, along.style(), along.frame().voxels_per_unit);
    // World, either way round; towards the eye where the ray starts inside.
    let mut normal: [f32; 3] = std::array::from_fn(|a| -ray.direction[a] / per_unit[a]);
    let mut t_in = 0.0;
    for [nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
        let inside = nx * ray.origin[0] + ny * ray.origin[1] + nz * ray.origin[2] - w;
        let along = nx * ray.direction[0] + ny * ray.direction[1] + nz * ray.direction[2];
        if along > 0.0 && -inside / along > t_in {
            t_in = -inside / along;
            normal = [nx * per_unit[0], ny * per_unit[1], nz * per_unit[2]];
        }
    }
    for a in 0..3 {
        if ray.direction[a] != 0.0 {
            let hi = style.volume_hi[a] as f32;
            let enter = ((0.0 - ray.origin[a]) * ray.inverse[a]).min((hi - ray.origin[a]) * ray.inverse[a]);
            if enter > t_in {
                t_in = enter;
                normal = std::array::from_fn(|b| if a == b { 1.0 } else { 0.0 });
            }
        }
    }
    lit(along, normal, dot(normal, normal).sqrt(), 1.0)
}

fn lit(along: &Along<'_>, gradient: [f32; 3], steepness: f32, strength: f32) -> Lit {
    let (style, per_unit) = (along.style(), along.frame().voxels_per_unit);
    // World, of length one.
    let to_eye: [f32; 3] = std::array::from_fn(|a| -along.ray.direction[a] / per_unit[a]);
    let to_light = if style.light == [0.0; 3] { to_eye } else { style.light };
    let along = dot(gradient, to_light) / steepness;
    // Both sides are lit: the normal is on the light's.
    let side = if along < 0.0 { -1.0 } else { 1.0 };
    let half: [f32; 3] = std::array::from_fn(|a| to_light[a] + to_eye[a]);
    let length = dot(half, half).sqrt().max(1e-6);
    let shine = clamped(side * dot(gradient, half) / (steepness * length), 1.0);
    let factor = style.ambient + style.diffuse * (side * along).min(1.0);
    Lit { factor: 1.0 + (factor - 1.0) * strength, glint: style.specular * power(shine, style.shininess) * strength }
}

/// Straight colour under a light; no brighter than white.
#[inline(always)]
pub(super) fn lit_color([r, g, b]: [f32; 3], light: Lit) -> [f32; 3] {
    [r, g, b].map(|c| (c * light.factor + light.glint).min(1.0))
}
