// Reads of bricks in which some voxels hold no data, by loads in either variant: a filter would mix them in.
// shaders/src/twin/holes.rs is the same on the CPU.

// Texels of code 0 hold no data.
override HOLES: bool = false;

// What a place has in which a voxel of no data has weight; no code is below 0.
const NO_DATA: f32 = -1.0;

fn is_no_data(code: f32) -> bool {
    return HOLES && code < 0.0;
}

fn mixed(a: f32, b: f32, t: f32) -> f32 {
    return a + (b - a) * t;
}

// The value code, 0..=1, at a global position, or NO_DATA.
fn read_with_holes(p_voxel: vec3<f32>) -> f32 {
    // Half a voxel up in place of down: never negative, so that cutting off rounds down.
    let p = p_voxel + 0.5;
    let whole = vec3<i32>(p);
    let w = p - vec3<f32>(whole);
    let corner = clamp(whole - (brick.stored_lo + 1), vec3(0), vec3<i32>(brick.stored_dims) - 2);
    var codes = array<f32, 8>();
    var has_data = true;
    for (var i = 0u; i < 8u; i++) {
        let far = vec3<u32>(i & 1u, (i >> 1u) & 1u, i >> 2u);
        codes[i] = textureLoad(volume, corner + vec3<i32>(far), 0).r;
        // The near corner always has weight: fractions are below 1.
        let counts = all((far == vec3(0u)) | (w > vec3(0.0)));
        has_data = has_data && !(counts && codes[i] == 0.0);
    }
    if !has_data {
        return NO_DATA;
    }
    let near = mixed(mixed(codes[0], codes[1], w.x), mixed(codes[2], codes[3], w.x), w.y);
    let far_side = mixed(mixed(codes[4], codes[5], w.x), mixed(codes[6], codes[7], w.x), w.y);
    return mixed(near, far_side, w.z);
}
