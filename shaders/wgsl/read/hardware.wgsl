// The volume through the adapter's linear filter. The ghost layer keeps every support inside the texture.
@group(0) @binding(2) var linear_clamped: sampler;
@group(2) @binding(0) var volume: texture_3d<f32>;

// What does not change along a ray.
struct Reader {
    first_voxel: vec3<f32>,
    texels_inverse: vec3<f32>,
}

fn new_reader(brick: BrickUniform) -> Reader {
    return Reader(vec3<f32>(brick.stored_lo), 1.0 / vec3<f32>(brick.stored_dims));
}

// The value code, 0..=1, at a global position; NO_DATA where it has none.
fn read_volume(reader: Reader, p_voxel: vec3<f32>) -> f32 {
    if HOLES {
        return read_with_holes(p_voxel);
    }
    return textureSampleLevel(volume, linear_clamped, (p_voxel - reader.first_voxel) * reader.texels_inverse, 0.0).r;
}
