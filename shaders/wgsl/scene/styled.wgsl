// A scene with clips, whose rays may look beyond what a brick owns, and beyond the volume.
// shaders/src/twin/scene/styled.rs is the same on the CPU.

// Isosurfaces and clip planes, at most.
const MAX_SURFACES: u32 = 8u;
const MAX_PLANES: u32 = 12u;

// shaders/src/style.rs says what the members mean.
struct StyleUniform {
    volume_hi: vec3<i32>,
    surface_count: u32,
    light: vec3<f32>,
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    plane_count: u32,
    light_from: f32,
    reserved: array<u32, 3>,
    codes: array<vec4<f32>, MAX_SURFACES>,
    colors: array<vec4<f32>, MAX_SURFACES>,
    planes: array<vec4<f32>, MAX_PLANES>,
}

// Kernels of plain scenes bind its beginning: not all adapters have a buffer to spare.
struct SceneUniform {
    frame: FrameUniform,
    style: StyleUniform,
}

@group(0) @binding(0) var<storage, read> scene_data: SceneUniform;

// The volume's upper corner. A copy: read once, not in loops.
var<private> volume_hi: vec3<f32>;

fn load_frame() -> FrameUniform {
    volume_hi = vec3<f32>(scene_data.style.volume_hi);
    return scene_data.frame;
}

// What clips leave of what the brick owns; nothing where k * step >= t_out.
fn clipped(ray: Ray, owned: Segment) -> Segment {
    let span = clip_span(ray);
    var left = Segment(owned.k, min(owned.t_out, span.y));
    if span.x > 0.0 {
        left.k = max(left.k, first_sample(frame.step, span.x));
    }
    return left;
}

// The place at k steps, which need not be whole; index space, clamped to the volume.
fn place_at(ray: Ray, k: f32) -> vec3<f32> {
    let t = k * frame.step;
    return clamp(ray.origin + t * ray.direction, vec3(0.0), volume_hi);
}

// What clips leave of a ray: from x to below y.
fn clip_span(ray: Ray) -> vec2<f32> {
    var span = vec2(0.0, FAR);
    for (var i = 0u; i < scene_data.style.plane_count; i++) {
        let plane = scene_data.style.planes[i];
        let inside = dot(plane.xyz, ray.origin) - plane.w;
        let along = dot(plane.xyz, ray.direction);
        if along == 0.0 {
            if inside < 0.0 {
                return vec2(FAR, -1.0);
            }
            continue;
        }
        let t = -inside / along;
        if along > 0.0 {
            span.x = max(span.x, t);
        } else {
            span.y = min(span.y, t);
        }
    }
    return span;
}

// Clips that end no deeper in the volume than this count as its own faces; in units of t.
const LEAST_CUT: f32 = 1e-3;

// Where the ray enters the volume, were it endless; t.
fn volume_entry(ray: Ray) -> f32 {
    let flat = ray.direction == vec3(0.0);
    let at_lo = (vec3(0.0) - ray.origin) * ray.inverse;
    let at_hi = (volume_hi - ray.origin) * ray.inverse;
    let enter = select(min(at_lo, at_hi), vec3(-FAR), flat);
    return max(max(max(enter.x, enter.y), enter.z), 0.0);
}

// The first sample behind the cut by which clipping lets the ray in at t_lo; -1 where the volume's own face does, or
// nothing.
fn first_behind_cut(ray: Ray, t_lo: f32) -> f32 {
    if t_lo <= volume_entry(ray) + LEAST_CUT {
        return -1.0;
    }
    return first_sample(frame.step, t_lo);
}
