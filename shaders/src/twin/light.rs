//! `wgsl/shared/light.wgsl` on the CPU: values anywhere on a ray, gradients, and Phong's factors.

use brickcast_volume::regions::code::{CodedTexel, MAX_DENSITY};

use super::accelerated::BrickData;
use super::holes::is_no_data;
use super::raycast::{Ray, VolumeReader, clamped};
use crate::layout::{BrickUniform, FrameUniform};
use crate::style::StyleUniform;

/// Of a place: what its colour is multiplied by, and how much white is added per opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lit {
    pub(super) factor: f32,
    pub(super) glint: f32,
}

/// Where the gradient vanishes.
pub(super) const UNLIT: Lit = Lit { factor: 1.0, glint: 0.0 };

/// Reads one brick along one ray; places outside the volume are clamped to it.
pub(super) struct Probe<'a> {
    pub(super) volume: VolumeReader<'a>,
    pub(super) means: Option<&'a [f32]>,
    pub(super) ray: &'a Ray,
    pub(super) step: f32,
    hi: [f32; 3],
    code_scale: f32,
    style: &'a StyleUniform,
    /// Per smallest spacing in place of per voxel.
    per_unit: [f32; 3],
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<'a> Probe<'a> {
    pub(super) fn new(
        frame: &FrameUniform,
        style: &'a StyleUniform,
        brick: &BrickUniform,
        data: &BrickData<'a>,
        ray: &'a Ray,
    ) -> Self {
        Self {
            volume: VolumeReader::new(frame, brick, data.texels),
            means: data.means,
            ray,
            step: frame.step,
            hi: style.volume_hi.map(|n| n as f32),
            code_scale: brick.code_scale,
            style,
            per_unit: frame.voxels_per_unit,
        }
    }

    fn inside(&self, p: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|a| p[a].max(0.0).min(self.hi[a]))
    }

    /// The place at `k` steps, which need not be whole; index space.
    #[inline(always)]
    pub(super) fn place(&self, k: f32) -> [f32; 3] {
        let t = k * self.step;
        self.inside(std::array::from_fn(|a| self.ray.origin[a] + t * self.ray.direction[a]))
    }

    /// The trilinear code, negative where there is none; the support must be free of leap voxels.
    #[inline(always)]
    pub(super) fn trilinear(&self, p: [f32; 3]) -> f32 {
        self.volume.read_data(p) * self.code_scale
    }

    /// The mean of the region that a place is deep inside of, if it is: leap and inner guard voxels.
    #[inline(always)]
    pub(super) fn deep(&self, p: [f32; 3]) -> Option<f32> {
        let means = self.means?;
        match CodedTexel::unpack(self.volume.nearest(p)) {
            CodedTexel::Leap { slot, .. } => Some(means.get(usize::from(slot)).copied().unwrap_or(0.0)),
            CodedTexel::Value { density, inner } => inner.then(|| f32::from(density) / f32::from(MAX_DENSITY)),
        }
    }

    /// The code of V' anywhere.
    pub(super) fn value(&self, p: [f32; 3]) -> f32 {
        self.deep(p).unwrap_or_else(|| self.trilinear(p))
    }

    /// By central differences over one voxel, interpolated; codes per smallest spacing. None where a place that it uses
    /// holds no data.
    #[inline(always)]
    pub(super) fn gradient(&self, p: [f32; 3]) -> Option<[f32; 3]> {
        let mut has_data = true;
        let gradient = std::array::from_fn(|a| {
            let (mut ahead, mut behind) = (p, p);
            ahead[a] += 1.0;
            behind[a] -= 1.0;
            // Written out: a closure for both is a call of its own, and takes a third longer.
            let (ahead, behind) = (self.trilinear(self.inside(ahead)), self.trilinear(self.inside(behind)));
            has_data &= !is_no_data(ahead.min(behind));
            (ahead - behind) * 0.5 * self.per_unit[a]
        });
        has_data.then_some(gradient)
    }

    /// Phong's factors at a place.
    pub(super) fn light(&self, p: [f32; 3]) -> Lit {
        if self.deep(p).is_some() {
            return UNLIT;
        }
        let Some(gradient) = self.gradient(p) else { return UNLIT };
        let steepness = dot(gradient, gradient).sqrt();
        // Homogeneous material is not lit by its noise.
        let part = clamped(steepness / self.style.light_from - 1.0, 1.0);
        let strength = part * part * (3.0 - 2.0 * part);
        if strength == 0.0 { UNLIT } else { self.lit(gradient, steepness, strength) }
    }

    /// Phong's factors on the face, of the volume or of a clip, by which the ray enters: the cut is flat, whatever is
    /// cut.
    pub(super) fn light_of_entry(&self) -> Lit {
        let normal = self.entry_normal();
        self.lit(normal, dot(normal, normal).sqrt(), 1.0)
    }

    /// World, either way round; towards the eye where the ray starts inside.
    fn entry_normal(&self) -> [f32; 3] {
        let (ray, style) = (self.ray, self.style);
        let mut normal: [f32; 3] = std::array::from_fn(|a| -ray.direction[a] / self.per_unit[a]);
        let mut t_in = 0.0;
        for [nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
            let inside = nx * ray.origin[0] + ny * ray.origin[1] + nz * ray.origin[2] - w;
            let along = nx * ray.direction[0] + ny * ray.direction[1] + nz * ray.direction[2];
            if along > 0.0 && -inside / along > t_in {
                t_in = -inside / along;
                normal = [nx * self.per_unit[0], ny * self.per_unit[1], nz * self.per_unit[2]];
            }
        }
        for a in 0..3 {
            if ray.direction[a] != 0.0 {
                let enter = ((0.0 - ray.origin[a]) * ray.inverse[a]).min((self.hi[a] - ray.origin[a]) * ray.inverse[a]);
                if enter > t_in {
                    t_in = enter;
                    normal = std::array::from_fn(|b| if a == b { 1.0 } else { 0.0 });
                }
            }
        }
        normal
    }

    fn lit(&self, gradient: [f32; 3], steepness: f32, strength: f32) -> Lit {
        // World, of length one.
        let to_eye: [f32; 3] = std::array::from_fn(|a| -self.ray.direction[a] / self.per_unit[a]);
        let to_light = if self.style.light == [0.0; 3] { to_eye } else { self.style.light };
        let along = dot(gradient, to_light) / steepness;
        // Both sides are lit: the normal is on the light's.
        let side = if along < 0.0 { -1.0 } else { 1.0 };
        let half: [f32; 3] = std::array::from_fn(|a| to_light[a] + to_eye[a]);
        let length = dot(half, half).sqrt().max(1e-6);
        let shine = clamped(side * dot(gradient, half) / (steepness * length), 1.0);
        let style = self.style;
        let factor = style.ambient + style.diffuse * (side * along).min(1.0);
        Lit { factor: 1.0 + (factor - 1.0) * strength, glint: style.specular * shine.powf(style.shininess) * strength }
    }
}
