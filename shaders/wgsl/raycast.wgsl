// One brick into the accumulator: one invocation a pixel. shaders/src/twin/raycast.rs is the same on the CPU.
@group(0) @binding(0) var<uniform> frame: FrameUniform;
@group(1) @binding(0) var<uniform> brick: BrickUniform;
// Premultiplied colour and opacity.
@group(1) @binding(1) var<storage, read_write> accumulator: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;

@compute @workgroup_size(16, 16)
fn raycast(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= brick.rect_size) {
        return;
    }
    let pixel = vec2<i32>(brick.rect_lo + id.xy);
    let ray = pixel_ray(frame, pixel.x, pixel.y);
    let owned = owned_segment(frame, brick, ray);
    if owned.k * frame.step >= owned.t_out {
        return;
    }
    let slot = brick.accumulator_base + id.y * brick.accumulator_stride + id.x;
    var sum = accumulator[slot];
    if sum.a >= frame.stop_alpha {
        return;
    }
    let reader = new_reader(brick);
    var k = owned.k;
    loop {
        // Always the product, never accumulated: the same sample in every brick.
        let t = k * frame.step;
        if t >= owned.t_out || sum.a >= frame.stop_alpha {
            break;
        }
        let code = read_volume(reader, ray.origin + t * ray.direction);
        let sample = classify(reader, frame, code);
        let weight = (1.0 - sum.a) * sample.a;
        sum += vec4(sample.rgb * weight, weight);
        k += 1.0;
    }
    accumulator[slot] = sum;
    atomicAdd(&counters[brick.counter], u32(k - owned.k));
}
