//! The scenes, each described once, in plain numbers, for the referee and the product.

use glam::DVec3;

use crate::referee::{self, Camera, Lens, Transfer, Volume};

mod functions;
mod holed;

pub use functions::{alloys, functions};
pub use holed::holed;

/// A scene with the 16-bit codes that the product reads. The referee's values are those that the codes stand for, so
/// that only arithmetic can differ.
#[derive(Debug, Clone)]
pub struct Scene {
    pub name: String,
    /// Code 0 and code 65535 stand for these, data units.
    pub range: (f64, f64),
    /// x fastest.
    pub codes: Vec<u16>,
    /// Voxels of code 0 hold no data.
    pub has_holes: bool,
    pub truth: referee::Scene,
    pub faces: Faces,
}

/// What happens where a sample lies on a face of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Faces {
    /// f32 rounding decides whether it counts; it happens in few pixels.
    Rounded,
    /// Every number of the scene is a short binary fraction, so f32 decides as f64 does.
    Exact,
    /// It adds nothing to the picture, counted or not.
    Transparent,
}

impl Scene {
    /// By row-major position: the pixels of the referee's picture in which the product may differ, since a sample
    /// within f32 rounding of the volume's faces may come or go there.
    ///
    /// # Panics
    /// Where these are more than 1 % of the pixels and more than one: such a scene must say what its faces are.
    #[must_use]
    pub fn excused(&self, truth: &referee::Rendering) -> Vec<bool> {
        if self.faces != Faces::Rounded {
            return vec![false; truth.doubtful.len()];
        }
        let count = truth.doubtful.iter().filter(|&&doubt| doubt).count();
        assert!(count * 100 <= truth.doubtful.len().max(100), "{}: {count} doubtful pixels", self.name);
        truth.doubtful.clone()
    }

    /// How many samples the product may count more or less than the referee.
    #[must_use]
    pub fn doubtful_samples(&self, truth: &referee::Rendering) -> u64 {
        match self.faces {
            Faces::Exact => 0,
            // One where the ray enters, one where it leaves.
            Faces::Rounded | Faces::Transparent => 2 * truth.doubtful.iter().filter(|&&doubt| doubt).count() as u64,
        }
    }
}

/// The steps of the definition's comparisons, in voxels.
pub const STEPS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];

/// Data units, chosen so that neither bound is a code, zero or one.
const RANGE: (f64, f64) = (-1000.0, 3095.0);

/// A volume before it has values.
#[derive(Debug, Clone, Copy)]
struct Grid {
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
}

/// Odd sizes, spacing 1:2:3 with a smallest spacing that is not one, origin off zero.
const SKEW: Grid = Grid { dims: [37, 29, 23], spacing: [0.5, 1.0, 1.5], origin: [-20.3, 7.7, 101.1] };
/// Short binary fractions only.
const DYADIC: Grid = Grid { dims: [40, 24, 16], spacing: [1.0, 2.0, 4.0], origin: [-10.5, 3.25, 64.0] };
/// Nothing that f32 could represent.
const ROUNDED: Grid = Grid { dims: [40, 24, 20], spacing: [0.7, 1.4, 2.1], origin: [10.1, -3.3, 7.7] };

impl Grid {
    /// Rounds `value` of each voxel, 0..=1 over the range, to codes.
    fn codes(&self, value: impl Fn([usize; 3]) -> f64) -> Vec<u16> {
        let [nx, ny, nz] = self.dims;
        let mut codes = Vec::with_capacity(nx * ny * nz);
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    codes.push((value([x, y, z]).clamp(0.0, 1.0) * 65535.0).round() as u16);
                }
            }
        }
        codes
    }

    fn volume(&self, codes: &[u16]) -> Volume {
        let (low, high) = RANGE;
        Volume {
            values: codes.iter().map(|&c| low + (high - low) * f64::from(c) / 65535.0).collect(),
            ..Volume::filled(self.dims, self.spacing, self.origin, low)
        }
    }

    /// Index space to world.
    fn world(&self, index: [f64; 3]) -> DVec3 {
        self.volume(&[]).world_from_index(index.into())
    }

    fn scene(&self, name: &str, codes: Vec<u16>, camera: Camera, size: [usize; 2], step: f64) -> Scene {
        let volume = self.volume(&codes);
        let truth = referee::Scene {
            unit: volume.min_spacing(),
            volume,
            camera,
            transfer: transfer(),
            size,
            step,
            early_termination: 1.0,
        };
        Scene {
            name: format!("{name}, step {step}"),
            range: RANGE,
            codes,
            has_holes: false,
            truth,
            faces: Faces::Rounded,
        }
    }
}

/// A different ramp along each axis, and an L of full voxels with three arms of different lengths: no turn, swap or
/// mirror image of it is itself.
fn ramps_and_l([nx, ny, nz]: [usize; 3]) -> impl Fn([usize; 3]) -> f64 {
    move |[x, y, z]| {
        let part = |i: usize, n: usize| i as f64 / n as f64;
        let within = |lo: [usize; 3], size: [usize; 3]| {
            (lo[0]..lo[0] + size[0]).contains(&x)
                && (lo[1]..lo[1] + size[1]).contains(&y)
                && (lo[2]..lo[2] + size[2]).contains(&z)
        };
        let (i, j, k) = (nx / 3, ny / 3, nz / 4);
        if within([i, j, k], [nx / 3, 3, 2]) || within([i, j, k], [3, ny / 2, 2]) || within([i, j, k], [3, 3, nz / 2]) {
            return 1.0;
        }
        0.08 + 0.25 * part(x, nx) + 0.33 * part(y, ny) + 0.17 * part(z, nz)
    }
}

/// Translucent, coloured, with a slope below 4 everywhere (the steepest: 2.2), in data units.
fn transfer() -> Transfer {
    let at = |v: f64| RANGE.0 + (RANGE.1 - RANGE.0) * v;
    let colors = [
        (0.0, [0.1, 0.2, 0.9]),
        (0.25, [0.2, 0.7, 0.8]),
        (0.5, [0.9, 0.3, 0.1]),
        (0.75, [0.2, 0.9, 0.3]),
        (1.0, [1.0, 1.0, 0.7]),
    ];
    let opacities =
        [(0.0, 0.0), (0.1, 0.0), (0.3, 0.03), (0.42, 0.14), (0.5, 0.01), (0.7, 0.06), (0.75, 0.06), (1.0, 0.6)];
    Transfer {
        colors: colors.map(|(v, c)| (at(v), c)).to_vec(),
        opacities: opacities.map(|(v, o)| (at(v), o)).to_vec(),
    }
}

/// All scenes with structure in them, for one step.
#[must_use]
pub fn all(step: f64) -> Vec<Scene> {
    vec![
        oblique(step),
        from_below(step),
        parallel_oblique(step),
        eye_inside(step),
        eye_on_a_brick_corner(step),
        samples_and_rays_on_faces(step),
        samples_near_faces(step),
        prime_picture(step),
    ]
}

/// The plain case: perspective, from the side and above.
#[must_use]
pub fn oblique(step: f64) -> Scene {
    let codes = SKEW.codes(ramps_and_l(SKEW.dims));
    let camera = Camera::orbit(&SKEW.volume(&codes), 35.0, 25.0, 1.1, 30.0);
    SKEW.scene("oblique", codes, camera, [80, 64], step)
}

/// Every axis seen from the other side, opacities for a length that is not the smallest spacing.
#[must_use]
pub fn from_below(step: f64) -> Scene {
    let codes = SKEW.codes(ramps_and_l(SKEW.dims));
    let camera = Camera::orbit(&SKEW.volume(&codes), 205.0, -50.0, 1.3, 20.0);
    let mut scene = SKEW.scene("from below", codes, camera, [64, 64], step);
    scene.truth.unit = 0.8;
    scene
}

/// Parallel rays along no axis, viewUp neither an axis nor at right angles; the plane through the position cuts the
/// volume, so that some rays start inside it.
#[must_use]
pub fn parallel_oblique(step: f64) -> Scene {
    let codes = SKEW.codes(ramps_and_l(SKEW.dims));
    let camera = Camera {
        position: SKEW.world([33.0, 25.0, 20.0]),
        focal_point: SKEW.world([17.0, 13.0, 9.0]),
        view_up: DVec3::new(0.2, 1.0, -0.4),
        lens: Lens::Parallel { parallel_scale: 22.0 },
    };
    SKEW.scene("parallel oblique", codes, camera, [64, 64], step)
}

/// The eye inside the volume, a wide angle, most of the volume behind it.
#[must_use]
pub fn eye_inside(step: f64) -> Scene {
    let codes = SKEW.codes(ramps_and_l(SKEW.dims));
    let camera = Camera {
        position: SKEW.world([26.3, 20.9, 13.2]),
        focal_point: SKEW.world([13.0, 10.0, 7.0]),
        view_up: DVec3::new(0.0, 1.0, 0.0),
        lens: Lens::Perspective { view_angle: 75.0 },
    };
    SKEW.scene("eye inside", codes, camera, [64, 64], step)
}

/// The eye exactly on a corner that eight bricks share: sample 0 lies at it, and visibility order hangs on a comparison
/// with equality.
#[must_use]
pub fn eye_on_a_brick_corner(step: f64) -> Scene {
    let codes = DYADIC.codes(ramps_and_l(DYADIC.dims));
    let camera = Camera {
        position: DYADIC.world([24.0, 8.0, 8.0]),
        focal_point: DYADIC.world([14.0, 11.0, 5.0]),
        view_up: DVec3::new(0.0, 1.0, 0.0),
        lens: Lens::Perspective { view_angle: 90.0 },
    };
    DYADIC.scene("eye on a brick corner", codes, camera, [64, 64], step)
}

/// Parallel to z, all numbers exact in f32: samples lie on brick faces across the ray, whole columns and rows of rays
/// run inside brick faces and in the volume's own faces (of which the low ones belong to it, the high ones do not).
#[must_use]
pub fn samples_and_rays_on_faces(step: f64) -> Scene {
    let codes = DYADIC.codes(ramps_and_l(DYADIC.dims));
    // Pixels are one world unit apart and their centres lie half a unit beside the position.
    let eye = DYADIC.world([20.5, 12.75, 24.0]);
    let camera = Camera {
        position: eye,
        focal_point: eye - DVec3::new(0.0, 0.0, 64.0),
        view_up: DVec3::new(0.0, 1.0, 0.0),
        lens: Lens::Parallel { parallel_scale: 32.0 },
    };
    let mut scene = DYADIC.scene("samples and rays on faces", codes, camera, [64, 64], step);
    scene.faces = Faces::Exact;
    scene
}

/// Parallel to x, a sample at every brick face but for f32's rounding: two bricks that round the face differently lose
/// it or take it twice. The volume's own faces are transparent, since there the rounding decides whether the sample
/// counts.
#[must_use]
pub fn samples_near_faces(step: f64) -> Scene {
    let inner = ramps_and_l(ROUNDED.dims);
    let codes = ROUNDED.codes(|voxel| {
        let border = (0..3).any(|a| voxel[a] < 2 || voxel[a] + 2 >= ROUNDED.dims[a]);
        if border { 0.0 } else { inner(voxel) }
    });
    let camera = Camera {
        position: ROUNDED.world([72.0, 11.3, 9.1]),
        focal_point: ROUNDED.world([8.0, 11.3, 9.1]),
        view_up: DVec3::new(0.0, 1.0, 0.0),
        lens: Lens::Parallel { parallel_scale: 19.0 },
    };
    let mut scene = ROUNDED.scene("samples near faces", codes, camera, [64, 64], step);
    scene.faces = Faces::Transparent;
    scene
}

/// Prime by prime pixels: no tile, workgroup or packet divides them.
#[must_use]
pub fn prime_picture(step: f64) -> Scene {
    let codes = SKEW.codes(ramps_and_l(SKEW.dims));
    let camera = Camera::orbit(&SKEW.volume(&codes), -70.0, 90.0, 1.0, 40.0);
    SKEW.scene("prime by prime from the pole", codes, camera, [61, 47], step)
}

/// Opacity and colour jump within a hundredth of the range (slopes of 50 and more): what the exact filter is for.
#[must_use]
pub fn steep(step: f64) -> Scene {
    let mut scene = oblique(step);
    scene.name = format!("steep, step {step}");
    let at = |v: f64| RANGE.0 + (RANGE.1 - RANGE.0) * v;
    scene.truth.transfer = Transfer {
        colors: vec![(at(0.5), [0.1, 0.4, 0.9]), (at(0.51), [0.9, 0.6, 0.1])],
        opacities: vec![(at(0.3), 0.0), (at(0.31), 0.5), (at(0.32), 0.02), (at(0.6), 0.02), (at(0.61), 0.6)],
    };
    scene
}

/// A scene drawn by lot: sizes, spacings, origin, camera (outside, inside, parallel), step and unit. The same for the
/// same `seed`. Steps are no round numbers, so samples fall on faces by accident only.
#[must_use]
pub fn random(seed: u64) -> Scene {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03;
    let mut lot = |low: f64, high: f64| {
        // xorshift64* (Vigna 2016), the upper 53 bits.
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        low + (high - low) * ((state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64)
    };
    let grid = Grid {
        dims: std::array::from_fn(|_| lot(5.0, 40.0) as usize),
        spacing: std::array::from_fn(|_| lot(0.3, 3.0)),
        origin: std::array::from_fn(|_| lot(-200.0, 200.0)),
    };
    let codes = grid.codes(ramps_and_l(grid.dims));
    let volume = grid.volume(&codes);
    let mut anywhere =
        |margin: f64| grid.world(std::array::from_fn(|a| lot(-margin, 1.0 + margin) * grid.dims[a] as f64));
    let (near, far, target) = (anywhere(0.0), anywhere(2.0), anywhere(0.0));
    let radius = (volume.world_box().1 - volume.world_box().0).length() / 2.0;
    let view_up = DVec3::new(lot(-1.0, 1.0), lot(0.1, 1.0), lot(-1.0, 1.0));
    let (position, lens) = match seed % 3 {
        0 => (far, Lens::Perspective { view_angle: lot(10.0, 80.0) }),
        1 => (near, Lens::Perspective { view_angle: lot(40.0, 120.0) }),
        _ => (far, Lens::Parallel { parallel_scale: lot(0.5, 1.2) * radius }),
    };
    let camera = Camera { position, focal_point: target, view_up, lens };
    let size = [lot(8.0, 48.0) as usize, lot(8.0, 48.0) as usize];
    let mut scene = grid.scene(&format!("random {seed}"), codes, camera, size, lot(0.2, 2.5));
    scene.truth.unit = volume.min_spacing() * lot(0.5, 3.0);
    scene
}

/// A scene whose box is wholly behind the eye.
#[must_use]
pub fn behind_the_eye() -> Scene {
    let mut scene = oblique(0.5);
    let camera = &mut scene.truth.camera;
    camera.focal_point = camera.position * 2.0 - camera.focal_point;
    scene.name = "behind the eye".to_owned();
    scene
}

/// `scene` as a picture of another size.
#[must_use]
pub fn resized(mut scene: Scene, size: [usize; 2]) -> Scene {
    scene.name = format!("{}, {} x {}", scene.name, size[0], size[1]);
    scene.truth.size = size;
    scene
}

/// A box of constant colour and opacity: 32 x 32 x 11 voxels of 1:2:3, seen by `camera`.
#[must_use]
pub fn constant_box(camera: Camera, opacity: f64, step: f64) -> Scene {
    let grid = Grid { dims: [32, 32, 11], spacing: [0.5, 1.0, 1.5], origin: [-3.0, 5.0, 9.0] };
    let codes = grid.codes(|_| 0.5);
    let mut scene = grid.scene(&format!("constant box of {opacity}"), codes, camera, [48, 48], step);
    scene.truth.transfer = Transfer::constant([0.8, 0.5, 0.2], opacity);
    scene
}

/// A ball's radius and centre, index space; its voxels are cubes of 1.
pub const BALL_RADIUS: f64 = 14.3;
pub const BALL_CENTER: [f64; 3] = [18.2, 19.7, 20.4];

/// A ball of constant opacity in an empty volume: each voxel's value is the part of it inside (to first order), and
/// opacity grows with it from 0 to `opacity`.
#[must_use]
pub fn ball(opacity: f64, step: f64) -> Scene {
    let grid = Grid { dims: [39, 37, 41], spacing: [1.0; 3], origin: [0.5; 3] };
    let codes = grid.codes(|voxel| {
        let centre = DVec3::new(voxel[0] as f64, voxel[1] as f64, voxel[2] as f64) + 0.5;
        BALL_RADIUS + 0.5 - centre.distance(BALL_CENTER.into())
    });
    let camera = Camera::orbit(&grid.volume(&codes), 20.0, 30.0, 1.2, 30.0);
    let mut scene = grid.scene(&format!("ball of {opacity}"), codes, camera, [64, 64], step);
    let (low, high) = RANGE;
    scene.truth.transfer =
        Transfer { colors: vec![(low, [0.8, 0.5, 0.2])], opacities: vec![(low, 0.0), (high, opacity)] };
    scene
}
