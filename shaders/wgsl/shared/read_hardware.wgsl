// Volume and transfer function through the adapter's linear filters. The ghost layer keeps every support inside the
// texture.
// One dimension: two reads an entry where a flat picture takes four.
@group(0) @binding(1) var table: texture_1d<f32>;
@group(0) @binding(2) var linear_clamped: sampler;
@group(0) @binding(3) var region_table: texture_1d<f32>;
@group(2) @binding(0) var volume: texture_3d<f32>;

// What does not change along a ray.
struct Reader {
    first_voxel: vec3<f32>,
    texels_inverse: vec3<f32>,
    entry_inverse: f32,
}

fn new_reader(brick: BrickUniform) -> Reader {
    return Reader(
        vec3<f32>(brick.stored_lo),
        1.0 / vec3<f32>(brick.stored_dims),
        1.0 / f32(textureDimensions(table)),
    );
}

// The value code, 0..=1, at a global position; NO_DATA where it has none.
fn read_volume(reader: Reader, p_voxel: vec3<f32>) -> f32 {
    if HOLES {
        return read_with_holes(p_voxel);
    }
    return textureSampleLevel(volume, linear_clamped, (p_voxel - reader.first_voxel) * reader.texels_inverse, 0.0).r;
}

// Straight colour and opacity of one step.
fn classify(reader: Reader, frame: FrameUniform, code: f32) -> vec4<f32> {
    let entry = (code - frame.table_first) * frame.table_scale;
    return textureSampleLevel(table, linear_clamped, (entry + 0.5) * reader.entry_inverse, 0.0);
}

// The same by the table for samples in regions.
fn classify_region(reader: Reader, frame: FrameUniform, code: f32) -> vec4<f32> {
    let entry = (code - frame.region_first) * frame.region_scale;
    return textureSampleLevel(region_table, linear_clamped, (entry + 0.5) / f32(textureDimensions(region_table)), 0.0);
}
