// A slab of one step between two nodes (x at its back, y at its front), through the adapter's linear filter.
fn slab_of(slabs: texture_2d<f32>, nodes: vec2<f32>) -> vec4<f32> {
    return textureSampleLevel(slabs, linear_clamped, (nodes + 0.5) / vec2<f32>(textureDimensions(slabs)), 0.0);
}
