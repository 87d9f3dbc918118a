// Rays, and the samples of a ray that a brick owns (docs/definition.md, Sampling grid). Everything is global: the same
// expression for a plane gives the same t in every brick, so that each sample has exactly one owner. t and k count from
// a common start near the volume (KernelView says why).

// Slower than this per unit of t, a ray moves by less than 3e-7 voxel over the longest reach: it runs inside the plane.
const PARALLEL_TO_PLANE: f32 = 1e-12;
const FAR: f32 = 3e38;

struct Ray {
    origin: vec3<f32>,
    // Index space per unit of t; components parallel to a plane are exactly zero.
    direction: vec3<f32>,
    // 1 / direction, zero where direction is zero.
    inverse: vec3<f32>,
}

struct Segment {
    // First owned sample: an integer, exact in f32 up to 2^24.
    k: f32,
    // The ray leaves the brick here; samples below it are owned.
    t_out: f32,
}

fn pixel_ray(frame: FrameUniform, x: i32, y: i32) -> Ray {
    // From an integer, so that the middle of an odd picture is exactly 0.
    let u = f32(2 * x + 1 - frame.width) * frame.inverse_width;
    let v = f32(frame.height - 1 - 2 * y) * frame.inverse_height;
    let q = frame.ray_right * u + frame.ray_up * v;
    var direction = frame.ray_forward;
    var aside = q;
    if frame.parallel == 0u {
        direction += q;
        let far = sqrt(dot(direction, direction));
        let scale = 1.0 / far;
        // Without cancellation: scale - 1 = -q.q scale / (1 + far).
        aside = q * scale - frame.ray_forward * (dot(q, q) * scale / (1.0 + far));
        direction *= scale;
    }
    let origin = frame.eye + aside * frame.fan;
    direction *= frame.voxels_per_unit;
    let flat = abs(direction) < vec3(PARALLEL_TO_PLANE);
    direction = select(direction, vec3(0.0), flat);
    let inverse = select(1.0 / select(direction, vec3(1.0), flat), vec3(0.0), flat);
    return Ray(origin, direction, inverse);
}

// The first sample at or behind t, exactly.
fn first_sample(step: f32, t: f32) -> f32 {
    // The quotient errs by a few units in the last place, the product decides.
    var k = ceil(t / step);
    for (var i = 0; i < 4; i++) {
        if k > 0.0 && (k - 1.0) * step >= t {
            k -= 1.0;
        }
    }
    for (var i = 0; i < 4; i++) {
        if k * step < t {
            k += 1.0;
        }
    }
    return k;
}

// Of samples `step` apart; empty where k * step >= t_out.
fn owned_segment(step: f32, brick: BrickUniform, ray: Ray) -> Segment {
    let lo = vec3<f32>(brick.owned_lo);
    let hi = vec3<f32>(brick.owned_hi);
    let flat = ray.direction == vec3(0.0);
    if any(flat & ((ray.origin < lo) | (ray.origin >= hi))) {
        return Segment(0.0, -1.0);
    }
    let at_lo = (lo - ray.origin) * ray.inverse;
    let at_hi = (hi - ray.origin) * ray.inverse;
    let enter = select(min(at_lo, at_hi), vec3(-FAR), flat);
    let leave = select(max(at_lo, at_hi), vec3(FAR), flat);
    let t_in = max(max(max(enter.x, enter.y), enter.z), 0.0);
    let t_out = min(min(leave.x, leave.y), leave.z);
    if t_in >= t_out {
        return Segment(0.0, -1.0);
    }
    return Segment(first_sample(step, t_in), t_out);
}
