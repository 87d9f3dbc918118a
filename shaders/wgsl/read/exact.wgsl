// The volume by loads and own interpolation, in the form a + (b - a) t, which returns equal ends
// unchanged. Weights come from the global position, so that they are the same in every brick.
@group(2) @binding(0) var volume: texture_3d<f32>;

// What does not change along a ray.
struct Reader {
    // Subtract from a global position + 0.5, rounded down, for the texel of the support's low corner.
    first_texel: vec3<i32>,
    last_corner: vec3<i32>,
}

fn new_reader(brick: BrickUniform) -> Reader {
    return Reader(brick.stored_lo + 1, vec3<i32>(brick.stored_dims) - 2);
}

fn load(texel: vec3<i32>, x: i32, y: i32, z: i32) -> f32 {
    return textureLoad(volume, texel + vec3(x, y, z), 0).r;
}

// The value code of the voxel that holds a global position; NO_DATA where it has none.
fn read_nearest(reader: Reader, p_voxel: vec3<f32>) -> f32 {
    let texel = clamp(vec3<i32>(p_voxel) + 1 - reader.first_texel, vec3(0), reader.last_corner + 1);
    let code = textureLoad(volume, texel, 0).r;
    return select(code, NO_DATA, HOLES && code == 0.0);
}

fn between(a: f32, b: f32, t: f32) -> f32 {
    return a + (b - a) * t;
}

// The value code, 0..=1, at a global position; NO_DATA where it has none.
fn read_volume(reader: Reader, p_voxel: vec3<f32>) -> f32 {
    if frame.nearest != 0u {
        return read_nearest(reader, p_voxel);
    }
    if HOLES {
        return read_with_holes(p_voxel);
    }
    // Half a voxel up in place of down: never negative, so that cutting off rounds down.
    let p = p_voxel + 0.5;
    let whole = vec3<i32>(p);
    let w = p - vec3<f32>(whole);
    let c = clamp(whole - reader.first_texel, vec3(0), reader.last_corner);
    let y0z0 = between(load(c, 0, 0, 0), load(c, 1, 0, 0), w.x);
    let y1z0 = between(load(c, 0, 1, 0), load(c, 1, 1, 0), w.x);
    let y0z1 = between(load(c, 0, 0, 1), load(c, 1, 0, 1), w.x);
    let y1z1 = between(load(c, 0, 1, 1), load(c, 1, 1, 1), w.x);
    return between(between(y0z0, y1z0, w.y), between(y0z1, y1z1, w.y), w.z);
}
