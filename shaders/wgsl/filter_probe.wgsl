// Start-up self-test of the adapter's trilinear filter: one invocation a probe reads the texture through the sampler.
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(1) var linear_clamped: sampler;
// Positions in texels (x, y, z, unused); answers beside them.
@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
// (filtered value, value of the texel that holds the position).
@group(0) @binding(3) var<storage, read_write> answers: array<vec2<f32>>;

@compute @workgroup_size(64)
fn filter_probe(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&positions) {
        return;
    }
    let p = positions[id.x].xyz;
    let filtered = textureSampleLevel(volume, linear_clamped, p / vec3<f32>(textureDimensions(volume)), 0.0).r;
    answers[id.x] = vec2(filtered, textureLoad(volume, vec3<i32>(p), 0).r);
}
