//! What lies between samples, as it is defined: slabs integrated by many thin slices, light at their ends, isosurfaces
//! found by halving, projections, clip planes. In f64, no tables.

use glam::DVec3;

use super::clip::{Segment, clip, owned_samples};
use super::march::{Gathered, Rendering, by_rows};
use super::{Ray, Scene};

/// Slices of a slab, and more where the function has points close together.
const SLICES: usize = 200;

/// Phong's model; `range` is what codes 0 to 1 stand for, by which gradients are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    pub at: LightAt,
    /// World direction towards the light; none: a headlight.
    pub direction: Option<DVec3>,
    pub ambient: f64,
    pub diffuse: f64,
    pub specular: f64,
    pub shininess: f64,
    pub range: (f64, f64),
    /// Light fades in from a gradient of this length to twice it, data units per smallest spacing.
    pub from: f64,
}

/// Where a slab takes its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightAt {
    /// At both ends, and linear between.
    Ends,
    Middle,
    /// The mean place of what its slices emit.
    Centroid,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Projection {
    Maximum,
    Minimum,
    Average,
}

/// What becomes of the values along a ray.
#[derive(Debug, Clone, Default)]
pub struct Style {
    pub preintegrated: bool,
    pub light: Option<Light>,
    /// Value, straight colour and opacity; ascending.
    pub surfaces: Vec<(f64, [f64; 4])>,
    pub projection: Option<Projection>,
    /// Normal and offset: `normal . p >= offset` stays, world.
    pub planes: Vec<(DVec3, f64)>,
    /// Values are those of the voxels that hold the places, never between.
    pub nearest: bool,
    /// What the picture leaves out on purpose, to show that a comparison would notice.
    pub mistake: Option<Mistake>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mistake {
    /// The value at a slab's front holds for all of it.
    FrontOnly,
    /// Front and back of every slab swapped.
    Swapped,
    /// The last slab is left out.
    LastSlab,
    /// Light on one side of a surface only.
    OneSided,
    /// Light at the front end only.
    FrontLight,
    /// Isosurfaces behind what is in front of them in the same slab.
    SurfaceFirst,
    /// Cuts shaded by the gradient of what they cut.
    RoughCuts,
    /// The same of isosurfaces that are cut.
    RoughSurfaces,
    /// The volume's own faces taken for cuts.
    FacesAreCuts,
    /// Light on every gradient, however short.
    LitNoise,
    /// Light that fades in by a straight line.
    StraightFade,
    /// Labels between labels.
    Between,
    /// Gradients in voxels, whatever their size.
    CubicVoxels,
    /// Voxels without data have a value, below all others.
    FilledHoles,
}

/// What a place's colour is multiplied by, and the white that is added.
type Lit = (f64, f64);

struct March<'a> {
    scene: &'a Scene,
    style: &'a Style,
    ray: &'a Ray,
    /// The first sample behind a cut, where a clip lets the ray in.
    cut: Option<i64>,
}

/// The whole volume at once.
#[must_use]
pub fn render_styled(scene: &Scene, style: &Style) -> Rendering {
    let filled = (style.mistake == Some(Mistake::FilledHoles)).then(|| {
        let mut scene = scene.clone();
        let lowest = scene.volume.values.iter().copied().fold(f64::INFINITY, f64::min);
        scene.volume.values.iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = lowest);
        scene
    });
    let scene = filled.as_ref().unwrap_or(scene);
    by_rows(scene, |ray, _| {
        let mut gathered = Gathered::default();
        if let Some(segment) = clip(scene, ray, [0; 3], scene.volume.dims) {
            let kept = clipped(style, ray, segment);
            let (first, end) = owned_samples(scene, kept);
            if kept.enter < kept.exit && first < end {
                // What lies in a face of the volume, but for rounding, is no cut.
                let is_cut = kept.enter > segment.enter + 1e-3 * scene.volume.min_spacing();
                let cut = (is_cut || style.mistake == Some(Mistake::FacesAreCuts)).then_some(first);
                March { scene, style, ray, cut }.march(first, end, &mut gathered);
            }
        }
        gathered
    })
}

fn clipped(style: &Style, ray: &Ray, mut segment: Segment) -> Segment {
    for &(normal, offset) in &style.planes {
        let (inside, along) = (normal.dot(ray.origin) - offset, normal.dot(ray.direction));
        if along > 0.0 {
            segment.enter = segment.enter.max(-inside / along);
        } else if along < 0.0 {
            segment.exit = segment.exit.min(-inside / along);
        } else if inside < 0.0 {
            segment.exit = segment.enter;
        }
    }
    segment
}

impl March<'_> {
    fn place(&self, k: f64) -> DVec3 {
        let volume = &self.scene.volume;
        let hi = DVec3::from(volume.dims.map(|n| n as f64));
        volume.index_from_world(self.ray.origin + self.ray.direction * (k * self.scene.delta())).clamp(DVec3::ZERO, hi)
    }

    fn value(&self, k: f64) -> f64 {
        let (volume, place) = (&self.scene.volume, self.place(k));
        let is_nearest = self.style.nearest && self.style.mistake != Some(Mistake::Between);
        if is_nearest { volume.nearest(place) } else { volume.sample(place) }
    }

    /// Of the face by which the ray enters what clipping leaves of the volume; towards the eye where it starts inside.
    fn entry_normal(&self) -> DVec3 {
        let (volume, ray) = (&self.scene.volume, self.ray);
        let (lo, hi) = volume.world_box();
        let mut faces = self.style.planes.clone();
        for axis in [0, 1, 2].map(|a| volume.directions.col(a)) {
            faces.extend([(axis, axis.dot(lo)), (-axis, -axis.dot(hi))]);
        }
        let (mut nearest, mut normal) = (0.0, -ray.direction);
        for (n, offset) in faces {
            let (inside, along) = (n.dot(ray.origin) - offset, n.dot(ray.direction));
            if along > 0.0 && -inside / along > nearest {
                (nearest, normal) = (-inside / along, n);
            }
        }
        normal
    }

    fn light(&self, k: f64) -> Lit {
        let Some(light) = &self.style.light else { return (1.0, 0.0) };
        let (volume, p) = (&self.scene.volume, self.place(k));
        let hi = DVec3::from(volume.dims.map(|n| n as f64));
        let unit = if self.style.mistake == Some(Mistake::CubicVoxels) {
            DVec3::ONE
        } else {
            volume.spacing / volume.min_spacing()
        };
        let rise = |axis: DVec3| {
            let at = |p: DVec3| volume.sample(p.clamp(DVec3::ZERO, hi));
            (at(p + axis) - at(p - axis)) * 0.5 / (light.range.1 - light.range.0)
        };
        let gradient = DVec3::new(rise(DVec3::X), rise(DVec3::Y), rise(DVec3::Z)) / unit;
        if gradient.is_nan() {
            return (1.0, 0.0);
        }
        let least = 1.0 / 16383.0_f64;
        let from = match self.style.mistake {
            Some(Mistake::LitNoise) => least,
            _ => least.max(light.from / (light.range.1 - light.range.0)),
        };
        let part = (gradient.length() / from - 1.0).clamp(0.0, 1.0);
        let is_straight = self.style.mistake == Some(Mistake::StraightFade);
        let strength = if is_straight { part } else { part * part * (3.0 - 2.0 * part) };
        if strength == 0.0 {
            return (1.0, 0.0);
        }
        // By parts along the grid's axes; light comes from somewhere in the world.
        self.lit(light, volume.directions * gradient.normalize(), strength)
    }

    /// Of the first slab or sample behind a cut; none elsewhere.
    fn light_of_cut(&self, k: f64) -> Option<Lit> {
        let light = self.style.light.as_ref().filter(|_| self.style.mistake != Some(Mistake::RoughCuts))?;
        let is_cut = self.cut.is_some_and(|cut| cut == k.floor() as i64);
        is_cut.then(|| self.lit(light, self.entry_normal().normalize(), 1.0))
    }

    fn lit(&self, light: &Light, mut normal: DVec3, strength: f64) -> Lit {
        let eye = -self.ray.direction;
        let to_light = light.direction.map_or(eye, DVec3::normalize);
        if normal.dot(to_light) < 0.0 && self.style.mistake != Some(Mistake::OneSided) {
            normal = -normal;
        }
        let half = (to_light + eye).normalize_or_zero();
        let factor = light.ambient + light.diffuse * normal.dot(to_light).max(0.0);
        let glint = light.specular * normal.dot(half).max(0.0).powf(light.shininess);
        (1.0 + (factor - 1.0) * strength, glint * strength)
    }

    fn add(gathered: &mut Gathered, premultiplied: [f64; 4]) {
        let through = 1.0 - gathered.rgba[3];
        for (sum, c) in gathered.rgba.iter_mut().zip(premultiplied) {
            *sum += through * c;
        }
    }

    /// The values from `v0` to `v1` over `length` steps, from `k`: in thin slices, each with the light between the two
    /// ends.
    fn slab(&self, gathered: &mut Gathered, (v0, v1): (f64, f64), k: f64, length: f64) {
        let (v0, v1) = match self.style.mistake {
            Some(Mistake::FrontOnly) => (v0, v0),
            Some(Mistake::Swapped) => (v1, v0),
            _ => (v0, v1),
        };
        let transfer = &self.scene.transfer;
        let units = self.scene.delta() / self.scene.unit * length;
        // Middle and width of each, as shares of the slab.
        let cuts = transfer.cuts(v0, v1, SLICES);
        let slices = || cuts.windows(2).map(|w| (0.5 * (w[0] + w[1]), w[1] - w[0]));
        let place = self.style.light.map_or(LightAt::Ends, |light| light.at);
        let at = match place {
            LightAt::Ends => 0.0,
            LightAt::Middle => 0.5,
            LightAt::Centroid => {
                let (mut through, mut light, mut moment) = (1.0, 0.0, 0.0);
                for (u, width) in slices() {
                    let alpha = 1.0 - (1.0 - transfer.opacity(v0 + (v1 - v0) * u)).powf(units * width);
                    light += through * alpha;
                    moment += through * alpha * u;
                    through *= 1.0 - alpha;
                }
                if light > 0.0 { moment / light } else { 0.5 }
            }
        };
        let cut = self.light_of_cut(k);
        let once = cut.unwrap_or_else(|| self.light(k + length * at));
        let ends = (self.light(k), self.light(k + length));
        let mut slab = [0.0; 4];
        for (u, width) in slices() {
            let value = v0 + (v1 - v0) * u;
            let alpha = 1.0 - (1.0 - transfer.opacity(value)).powf(units * width);
            let (factor, glint) = if place != LightAt::Ends || cut.is_some() {
                once
            } else if self.style.mistake == Some(Mistake::FrontLight) {
                ends.0
            } else {
                (ends.0.0 * (1.0 - u) + ends.1.0 * u, ends.0.1 * (1.0 - u) + ends.1.1 * u)
            };
            let through = 1.0 - slab[3];
            for (sum, c) in slab.iter_mut().zip(transfer.color(value)) {
                *sum += through * alpha * (c * factor + glint);
            }
            slab[3] += through * alpha;
        }
        let a = slab[3];
        Self::add(gathered, [slab[0].min(a), slab[1].min(a), slab[2].min(a), a]);
    }

    fn surface(&self, gathered: &mut Gathered, [r, g, b, a]: [f64; 4], (factor, glint): Lit) {
        let [r, g, b] = [r, g, b].map(|c| (c * factor + glint).min(1.0) * a);
        Self::add(gathered, [r, g, b, a]);
    }

    /// Where the value is `value`, between `k` and the next sample on its other side; nowhere where one of the places
    /// that are looked at first holds no data.
    fn crossing(&self, k: f64, value: f64) -> Option<f64> {
        let is_above = self.value(k) >= value;
        let (mut lo, mut hi) = (0.0, 1.0);
        for halving in 0..40 {
            let middle = 0.5 * (lo + hi);
            let here = self.value(k + middle);
            if here.is_nan() {
                if halving < 6 {
                    return None;
                }
                break;
            }
            if (here >= value) == is_above { lo = middle } else { hi = middle }
        }
        Some(k + 0.5 * (lo + hi))
    }

    fn march(&self, first: i64, end: i64, gathered: &mut Gathered) {
        if let Some(projection) = self.style.projection {
            let values: Vec<f64> = (first..end).map(|k| self.value(k as f64)).filter(|v| !v.is_nan()).collect();
            if values.is_empty() {
                return;
            }
            let count = values.len() as f64;
            let values = values.into_iter();
            let value = match projection {
                Projection::Maximum => values.fold(f64::MIN, f64::max),
                Projection::Minimum => values.fold(f64::MAX, f64::min),
                Projection::Average => values.sum::<f64>() / count,
            };
            let ([r, g, b], a) = (self.scene.transfer.color(value), self.scene.transfer.opacity(value));
            gathered.rgba = [r * a, g * a, b * a, a];
            return;
        }
        for k in first..end {
            let at = k as f64;
            let (v0, v1) = (self.value(at), self.value(at + 1.0));
            if k == first {
                for &(value, color) in &self.style.surfaces {
                    if v0 >= value {
                        let is_rough = self.style.mistake == Some(Mistake::RoughSurfaces);
                        if is_rough {
                            self.surface(gathered, color, self.light(at));
                            continue;
                        }
                        let light = self.style.light.as_ref();
                        let lit = light.map_or((1.0, 0.0), |l| self.lit(l, self.entry_normal().normalize(), 1.0));
                        self.surface(gathered, color, lit);
                    }
                }
            }
            if !self.style.preintegrated && !v0.is_nan() {
                self.sample(gathered, v0, at);
            }
            if v0.is_nan() || v1.is_nan() {
                continue;
            }
            let mut crossed: Vec<_> =
                self.style.surfaces.iter().filter(|(value, _)| (v0 >= *value) != (v1 >= *value)).collect();
            if v1 < v0 {
                crossed.reverse();
            }
            let (mut from, mut value) = (at, v0);
            for &&(level, color) in &crossed {
                let Some(here) = self.crossing(at, level) else { continue };
                let here = here.max(from);
                if self.style.mistake == Some(Mistake::SurfaceFirst) {
                    self.surface(gathered, color, self.light(here));
                }
                if self.style.preintegrated {
                    self.slab(gathered, (value, level), from, here - from);
                }
                if self.style.mistake != Some(Mistake::SurfaceFirst) {
                    self.surface(gathered, color, self.light(here));
                }
                (from, value) = (here, level);
            }
            let is_last = self.style.mistake == Some(Mistake::LastSlab) && k + 1 == end;
            if self.style.preintegrated && !is_last {
                self.slab(gathered, (value, v1), from, at + 1.0 - from);
            }
        }
    }

    fn sample(&self, gathered: &mut Gathered, value: f64, k: f64) {
        let transfer = &self.scene.transfer;
        let alpha = 1.0 - (1.0 - transfer.opacity(value)).powf(self.scene.delta() / self.scene.unit);
        if alpha > 0.0 {
            let (factor, glint) = self.light_of_cut(k).unwrap_or_else(|| self.light(k));
            let [r, g, b] = transfer.color(value).map(|c| (c * factor + glint).min(1.0) * alpha);
            Self::add(gathered, [r, g, b, alpha]);
        }
    }
}
