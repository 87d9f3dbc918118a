// One brick into the accumulator, sample by sample. shaders/src/twin/raycast.rs is the same on the CPU.
@compute @workgroup_size(64, 4)
fn raycast(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
) {
    load_uniforms();
    // Within the rectangle.
    let place = workgroup.xy * 16u + pixel_of_lane(lane.xy);
    if any(place >= brick.rect_size) {
        return;
    }
    let pixel = vec2<i32>(brick.rect_lo + place);
    let ray = pixel_ray(frame, pixel.x, pixel.y);
    let owned = owned_segment(frame, brick, ray);
    if owned.k * frame.step >= owned.t_out {
        return;
    }
    let slot = brick.accumulator_base + place.y * brick.accumulator_stride + place.x;
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
    atomicAdd(&counters[4u * brick.counter], u32(k - owned.k));
}
