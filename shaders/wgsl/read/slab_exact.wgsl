// A slab of one step between two nodes (x at its back, y at its front), by loads and own interpolation.
fn slab_of(slabs: texture_2d<f32>, nodes: vec2<f32>) -> vec4<f32> {
    let last = vec2<i32>(textureDimensions(slabs)) - 1;
    let entry = clamp(nodes, vec2(0.0), vec2<f32>(last));
    let i = min(vec2<i32>(entry), last - 1);
    let w = entry - vec2<f32>(i);
    let a = textureLoad(slabs, i, 0);
    let b = textureLoad(slabs, i + vec2(1, 0), 0);
    let c = textureLoad(slabs, i + vec2(0, 1), 0);
    let d = textureLoad(slabs, i + vec2(1, 1), 0);
    let near = a + (b - a) * w.x;
    let far = c + (d - c) * w.x;
    return near + (far - near) * w.y;
}
