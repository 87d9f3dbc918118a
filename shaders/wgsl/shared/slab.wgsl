// What lies between two places of a ray. shaders/src/twin/slab.rs is the same on the CPU.

// Slabs come from a table over both of their ends.
override PREINTEGRATED: bool;
// Where slabs and samples take their light: one of those below, or 0 without light.
override LIGHT: u32;
// At both ends of a slab, interpolated; in its middle; where what it emits comes from on average.
const LIGHT_INTERPOLATED: u32 = 1u;
const LIGHT_CENTER: u32 = 2u;
const LIGHT_CENTROID: u32 = 3u;
override SURFACES: bool;

// Slabs by node of the back value (x) and of the front value (y): premultiplied colour and opacity of one step. With
// interpolated light the first is the front end's, with the whole opacity, the second the back end's, with its part of
// it.
@group(0) @binding(5) var slab_front: texture_2d<f32>;
@group(0) @binding(6) var slab_back: texture_2d<f32>;
// The same for slabs in regions.
@group(0) @binding(7) var region_slab_front: texture_2d<f32>;
@group(0) @binding(8) var region_slab_back: texture_2d<f32>;
// By block of codes: the node coordinate at its start (r), and what it grows by to its end (g).
@group(0) @binding(9) var warp: texture_2d<f32>;
@group(0) @binding(10) var region_warp: texture_2d<f32>;

// An end of a slab, or a place between.
struct End {
    code: f32,
    // In steps along the ray.
    k: f32,
    light: vec2<f32>,
    is_lit: bool,
    // What follows, up to the next sample, is lit as the cut by which the ray enters.
    is_cut: bool,
}

// Premultiplied, behind what is there.
fn add(sum: ptr<function, vec4<f32>>, premul: vec4<f32>) {
    *sum += premul * (1.0 - (*sum).a);
}

// Premultiplied, of a slab, as of one that is `length` times as long.
fn of_length(slab: vec4<f32>, length: f32) -> vec4<f32> {
    if length == 1.0 {
        return slab;
    }
    let clear = 1.0 - slab.a;
    let longer = 1.0 - select(0.0, pow(max(clear, 1e-30), length), clear > 0.0);
    let scale = select(length, longer / max(slab.a, 1e-30), slab.a > 1e-6);
    return vec4(slab.rgb * scale, longer);
}

// Where a code stands among the nodes of the slabs: all blocks are 65,536 codes.
fn node_of(warp: texture_2d<f32>, code: f32) -> f32 {
    let dims = textureDimensions(warp);
    let blocks = dims.x * dims.y;
    let at = clamp(code * (f32(blocks) * (65535.0 / 65536.0)), 0.0, f32(blocks));
    let i = min(u32(at), blocks - 1u);
    let block = textureLoad(warp, vec2(i % dims.x, i / dims.x), 0);
    return block.x + (at - f32(i)) * block.y;
}

// Of the back value in x, of the front value in y.
fn nodes_of(in_region: bool, front: f32, back: f32) -> vec2<f32> {
    if REGIONS && in_region {
        return vec2(node_of(region_warp, back), node_of(region_warp, front));
    }
    return vec2(node_of(warp, back), node_of(warp, front));
}

fn look_up(is_back: bool, in_region: bool, nodes: vec2<f32>) -> vec4<f32> {
    if REGIONS && in_region {
        if is_back {
            return slab_of(region_slab_back, nodes);
        }
        return slab_of(region_slab_front, nodes);
    }
    if is_back {
        return slab_of(slab_back, nodes);
    }
    return slab_of(slab_front, nodes);
}

// A slab, looked up already, under the light of the cut by which the ray enters.
fn cut_slab(ray: Ray, in_region: bool, nodes: vec2<f32>, slab: vec4<f32>) -> vec4<f32> {
    var color = slab.rgb;
    if LIGHT == LIGHT_INTERPOLATED || LIGHT == LIGHT_CENTROID {
        color += look_up(true, in_region, nodes).rgb;
    }
    let light = light_of_entry(ray);
    return vec4(min(color * light.x + slab.a * light.y, vec3(slab.a)), slab.a);
}

// The slab from `front` to `back`, `length` steps long, premultiplied; learns the light of its ends.
fn slab_between(
    reader: Reader,
    ray: Ray,
    in_region: bool,
    front: ptr<function, End>,
    back: ptr<function, End>,
    length: f32,
) -> vec4<f32> {
    let nodes = nodes_of(in_region, (*front).code, (*back).code);
    let slab = look_up(false, in_region, nodes);
    if slab.a <= 0.0 {
        return vec4(0.0);
    }
    if LIGHT != 0u && (*front).is_cut {
        return of_length(cut_slab(ray, in_region, nodes, slab), length);
    }
    var color = slab.rgb;
    if LIGHT == LIGHT_INTERPOLATED {
        let far = look_up(true, in_region, nodes);
        if !(*front).is_lit {
            (*front).light = light_at(reader, ray, place_at(ray, (*front).k));
            (*front).is_lit = true;
        }
        if !(*back).is_lit {
            (*back).light = light_at(reader, ray, place_at(ray, (*back).k));
            (*back).is_lit = true;
        }
        let glint = (slab.a - far.a) * (*front).light.y + far.a * (*back).light.y;
        color = min(slab.rgb * (*front).light.x + far.rgb * (*back).light.x + glint, vec3(slab.a));
    }
    if LIGHT == LIGHT_CENTER {
        // Both ends deep in a region: so is what lies between.
        var light = UNLIT;
        if !((*front).is_lit && (*back).is_lit) {
            light = light_at(reader, ray, place_at(ray, 0.5 * ((*front).k + (*back).k)));
        }
        color = min(slab.rgb * light.x + slab.a * light.y, vec3(slab.a));
    }
    if LIGHT == LIGHT_CENTROID {
        let far = look_up(true, in_region, nodes);
        var light = UNLIT;
        if !((*front).is_lit && (*back).is_lit) {
            let k = (*front).k + ((*back).k - (*front).k) * (far.a / slab.a);
            light = light_at(reader, ray, place_at(ray, k));
        }
        color = min((slab.rgb + far.rgb) * light.x + slab.a * light.y, vec3(slab.a));
    }
    return of_length(vec4(color, slab.a), length);
}

// n slabs, both ends of each deep in one region, where nothing is lit; premultiplied.
fn flat_slabs(in_region: bool, code: f32, n: f32) -> vec4<f32> {
    let nodes = nodes_of(in_region, code, code);
    var slab = look_up(false, in_region, nodes);
    if LIGHT == LIGHT_INTERPOLATED || LIGHT == LIGHT_CENTROID {
        slab = vec4(slab.rgb + look_up(true, in_region, nodes).rgb, slab.a);
    }
    return of_length(slab, n);
}
