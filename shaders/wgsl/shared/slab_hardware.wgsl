// A slab of one step between two codes, through the adapter's linear filter.
fn slab_of(slabs: texture_2d<f32>, first: f32, scale: f32, front: f32, back: f32) -> vec4<f32> {
    let entry = (vec2(back, front) - first) * scale;
    return textureSampleLevel(slabs, linear_clamped, (entry + 0.5) / vec2<f32>(textureDimensions(slabs)), 0.0);
}
