//! One brick along rays side by side: places, values, gradients, light. The same as the twin's, lane by lane
//! (`shaders/src/twin/light.rs`).

use brickcast_shaders::style::StyleUniform;

use super::lanes::{Floats, Lanes, Mask, Task};
use super::power::power;
use super::ray::{Place, Rays, clamped, dot, splat3};
use super::read::Reader;

/// Of a place: what its colour is multiplied by, and how much white is added per opacity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lit<L: Lanes> {
    pub(crate) factor: L::F,
    pub(crate) glint: L::F,
}

impl<L: Lanes> Lit<L> {
    /// Where the gradient vanishes.
    #[inline(always)]
    pub(crate) fn none(l: L) -> Self {
        Self { factor: l.splat(1.0), glint: l.splat(0.0) }
    }

    #[inline(always)]
    pub(crate) fn select(mask: L::M, yes: Self, no: Self) -> Self {
        let factor = L::F::select(mask, yes.factor, no.factor);
        Self { factor, glint: L::F::select(mask, yes.glint, no.glint) }
    }
}

/// Reads along rays; places outside the volume are clamped to it.
pub(crate) struct Probe<'a, L: Lanes> {
    pub(crate) l: L,
    pub(crate) reader: Reader<'a>,
    pub(crate) rays: &'a Rays<L>,
    pub(crate) step: f32,
    pub(crate) style: &'a StyleUniform,
    /// Places are clamped to the volume.
    pub(crate) is_styled: bool,
    /// Per smallest spacing in place of per voxel.
    pub(crate) per_unit: [f32; 3],
}

impl<L: Lanes> Probe<'_, L> {
    #[inline(always)]
    fn inside(&self, p: Place<L>) -> Place<L> {
        if !self.is_styled {
            return p;
        }
        let (l, [x, y, z]) = (self.l, self.style.volume_hi);
        let (x, y, z) = (l.splat(x as f32), l.splat(y as f32), l.splat(z as f32));
        [clamped(l, p[0], x), clamped(l, p[1], y), clamped(l, p[2], z)]
    }

    /// The places at `k` steps, which need not be whole; index space.
    #[inline(always)]
    pub(crate) fn place(&self, k: L::F) -> Place<L> {
        // Always the product, never accumulated: the same sample in every brick.
        let t = k * self.l.splat(self.step);
        let Rays { origin, direction, .. } = self.rays;
        self.inside([origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]])
    }

    /// Means of the regions that places are deep inside of, and where they are.
    #[inline(always)]
    fn deep(&self, p: Place<L>) -> (L::F, L::M) {
        let coded = self.reader.coded(self.l, p);
        (L::F::select(coded.is_leap, coded.mean, coded.code), coded.is_leap | coded.is_inner)
    }

    /// The code of V' anywhere.
    #[inline(always)]
    pub(crate) fn value(&self, p: Place<L>) -> L::F {
        let code = self.reader.read(self.l, p);
        if self.reader.means.is_none() {
            return code;
        }
        let (deep, is_deep) = self.deep(p);
        L::F::select(is_deep, deep, code)
    }

    /// Phong's factors at places. A call of its own: it is long, and many ask.
    #[inline(always)]
    pub(crate) fn light(&self, p: Place<L>) -> Lit<L> {
        self.l.enter(LightAt { probe: self, p })
    }

    /// Phong's factors on the face, of the volume or of a clip, by which rays enter.
    #[inline(always)]
    pub(crate) fn light_of_entry(&self) -> Lit<L> {
        self.l.enter(LightOfEntry { probe: self })
    }
}

struct LightAt<'a, 'b, L: Lanes> {
    probe: &'a Probe<'b, L>,
    p: Place<L>,
}

/// Tasks are generic over what they run on, but know it already.
macro_rules! task_of_probe {
    ($task:ident, $of:ident) => {
        impl<L: Lanes> Task for $task<'_, '_, L> {
            type Output = Lit<L>;

            #[inline(always)]
            fn run<Same: Lanes>(self, _: Same) -> Lit<L> {
                self.$of()
            }
        }
    };
}

task_of_probe!(LightAt, lit);
task_of_probe!(LightOfEntry, lit);

impl<L: Lanes> LightAt<'_, '_, L> {
    #[inline(always)]
    fn lit(&self) -> Lit<L> {
        let (probe, p) = (self.probe, self.p);
        let l = probe.l;
        let (style, none) = (probe.style, Lit::none(l));
        let one = l.splat(1.0);
        // By central differences over one voxel.
        let (mut gradient, mut lacks) = ([one; 3], one.lt(one));
        let (mut ahead, mut behind) = (p, p);
        for a in 0..3 {
            (ahead[a], behind[a]) = (p[a] + one, p[a] - one);
        }
        let around = probe.reader.around(l, probe.inside(p), probe.inside(ahead), probe.inside(behind));
        for a in 0..3 {
            let [ahead, behind] = around[a];
            if probe.reader.has_holes {
                lacks = lacks | ahead.smaller(behind).lt(l.splat(0.0));
            }
            gradient[a] = (ahead - behind) * l.splat(0.5) * l.splat(probe.per_unit[a]);
        }
        let steepness = dot::<L>(gradient, gradient).sqrt();
        // Homogeneous material is not lit by its noise.
        let part = clamped(l, steepness / l.splat(style.light_from) - one, one);
        let strength = part * part * (l.splat(3.0) - l.splat(2.0) * part);
        let mut is_none = lacks | strength.same(l.splat(0.0));
        if probe.reader.means.is_some() {
            is_none = is_none | probe.deep(p).1;
        }
        if !(!is_none).any() {
            return none;
        }
        Lit::select(is_none, none, phong(probe, style, gradient, (steepness, strength)))
    }
}

struct LightOfEntry<'a, 'b, L: Lanes> {
    probe: &'a Probe<'b, L>,
}

impl<L: Lanes> LightOfEntry<'_, '_, L> {
    #[inline(always)]
    fn lit(&self) -> Lit<L> {
        let probe = self.probe;
        let l = probe.l;
        let style = probe.style;
        let (zero, rays) = (l.splat(0.0), probe.rays);
        let per_unit = splat3(l, probe.per_unit);
        // World, either way round; towards the eye where the ray starts inside.
        let mut normal = towards_eye(probe);
        let mut t_in = zero;
        for &[nx, ny, nz, w] in &style.planes[..style.plane_count as usize] {
            let (plane, w) = (splat3(l, [nx, ny, nz]), l.splat(w));
            let inside = dot::<L>(plane, rays.origin) - w;
            let along = dot::<L>(plane, rays.direction);
            let t = -inside / along;
            let is_later = zero.lt(along) & t_in.lt(t);
            t_in = L::F::select(is_later, t, t_in);
            for a in 0..3 {
                normal[a] = L::F::select(is_later, plane[a] * per_unit[a], normal[a]);
            }
        }
        for a in 0..3 {
            let at_lo = (zero - rays.origin[a]) * rays.inverse[a];
            let at_hi = (l.splat(style.volume_hi[a] as f32) - rays.origin[a]) * rays.inverse[a];
            let enter = at_lo.smaller(at_hi);
            let is_later = !rays.direction[a].same(zero) & t_in.lt(enter);
            t_in = L::F::select(is_later, enter, t_in);
            for (b, normal) in normal.iter_mut().enumerate() {
                *normal = L::F::select(is_later, l.splat(f32::from(u8::from(a == b))), *normal);
            }
        }
        let steepness = dot::<L>(normal, normal).sqrt();
        phong(probe, style, normal, (steepness, l.splat(1.0)))
    }
}

/// World, of length one.
#[inline(always)]
fn towards_eye<L: Lanes>(probe: &Probe<'_, L>) -> Place<L> {
    let (d, per_unit) = (probe.rays.direction, splat3(probe.l, probe.per_unit));
    [-d[0] / per_unit[0], -d[1] / per_unit[1], -d[2] / per_unit[2]]
}

#[inline(always)]
fn phong<L: Lanes>(
    probe: &Probe<'_, L>,
    style: &StyleUniform,
    gradient: Place<L>,
    (steepness, strength): (L::F, L::F),
) -> Lit<L> {
    let l = probe.l;
    let (zero, one) = (l.splat(0.0), l.splat(1.0));
    let to_eye = towards_eye(probe);
    let to_light = if style.light == [0.0; 3] { to_eye } else { splat3(l, style.light) };
    let along = dot::<L>(gradient, to_light) / steepness;
    // Both sides are lit: the normal is on the light's.
    let side = L::F::select(along.lt(zero), l.splat(-1.0), one);
    let half = [to_light[0] + to_eye[0], to_light[1] + to_eye[1], to_light[2] + to_eye[2]];
    let length = dot::<L>(half, half).sqrt().larger(l.splat(1e-6));
    let shine = clamped(l, side * dot::<L>(gradient, half) / (steepness * length), one);
    let factor = l.splat(style.ambient) + l.splat(style.diffuse) * (side * along).smaller(one);
    let gleam = power(l, shine, l.splat(style.shininess));
    Lit { factor: one + (factor - one) * strength, glint: l.splat(style.specular) * gleam * strength }
}
