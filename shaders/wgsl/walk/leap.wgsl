// Where next, by texels that hold leaps (Frey & Ertl 2009): what is drawn is the flattened volume, several positions
// at once where they are known to have one value (docs/adr/0002-leaping.md). shaders/src/twin/walk/leap.rs is the same
// on the CPU.

// Samples of a brick, or after a skip, that are probed whatever their values.
const ENTRY_PROBES: u32 = 2u;
// Filtered values that differ by less may both come from guards: 1.25 of 16383.
const NEARLY_EQUAL: f32 = 1.25 / 16383.0;
// Voxels that a leap ends before the last place that is known; more where positions are large numbers.
const MARGIN: f32 = 1e-3;
// Of the largest coordinate: what positions and planes may round by, with room.
const MARGIN_SHARE: f32 = 1e-6;
// The last value where there is none: far from all codes, so that nothing is like it.
const NOTHING_YET: f32 = 9.0;

// By slot; one row.
@group(2) @binding(1) var means: texture_2d<f32>;

struct CodeWalk {
    margin: f32,
    // Positions that are probed from here on, whatever their values.
    probes: u32,
    // The last value taken.
    last: f32,
}

fn enter_code(ray: Ray) -> CodeWalk {
    let far_corner = max(abs(ray.origin), vec3<f32>(brick.owned_hi));
    let margin = max(MARGIN, MARGIN_SHARE * max(max(far_corner.x, far_corner.y), far_corner.z));
    return CodeWalk(margin, ENTRY_PROBES, NOTHING_YET);
}

// Returns the texels read.
fn ask_code(walk: ptr<function, CodeWalk>, step: ptr<function, Step>, p: vec3<f32>, last_texel: vec3<i32>) -> f32 {
    if (*walk).probes == 0u || (*step).is_known {
        return 0.0;
    }
    let voxel = vec3<i32>(p);
    let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
    let texel = coded_texel(textureLoad(volume, at, 0).r);
    if texel.is_leap {
        (*step).code = textureLoad(means, vec2<u32>(texel.slot, 0u), 0).r;
        (*step).center = vec3<f32>(voxel) + 0.5;
        (*step).half = f32(texel.distance) - 1.0 - (*walk).margin;
        (*step).jumps = true;
    } else {
        (*step).code = texel.code;
    }
    (*step).is_known = texel.is_leap || texel.is_inner;
    (*step).is_deep = (*step).is_known;
    (*step).is_flat = (*step).is_known;
    return 1.0;
}

fn leave_code(walk: ptr<function, CodeWalk>, step: Step, code: f32) {
    let is_equal = abs(code - (*walk).last) <= NEARLY_EQUAL;
    let fewer = max((*walk).probes, 1u) - 1u;
    let needed = select(0u, 1u, is_equal || step.is_deep);
    (*walk).probes = select(max(fewer, needed), ENTRY_PROBES, step.is_by_map);
    (*walk).last = code;
}

// The mean of the region that a place is deep inside of in x; y = 1 where it is.
fn deep_at(p: vec3<f32>) -> vec2<f32> {
    let last_texel = vec3<i32>(brick.stored_dims) - 1;
    let at = clamp(vec3<i32>(p) - brick.stored_lo, vec3(0), last_texel);
    let texel = coded_texel(textureLoad(volume, at, 0).r);
    if texel.is_leap {
        return vec2(textureLoad(means, vec2<u32>(texel.slot, 0u), 0).r, 1.0);
    }
    return vec2(texel.code, select(0.0, 1.0, texel.is_inner));
}
