// One brick into the accumulator, by rays that leap (Frey & Ertl 2009) and skip (Krueger & Westermann 2003): the plain loop
// of the flattened volume, several positions at once where they are known to have one value
// (docs/adr/0002-leaping.md). shaders/src/twin/accelerated.rs is the same on the CPU.
//
// Three loops take turns, so that each is short where neighbouring rays do alike: the map, probes, samples.

// Texels hold leaps.
override LEAP: bool;
// There is a macrocell map.
override MAP: bool;
// Samples in regions are hidden, shown alone, or have a table of their own.
override REGIONS: bool;

// By slot; one row.
@group(2) @binding(1) var means: texture_2d<f32>;
// 8 bits distance to the nearest cell that is not empty; 8 bits distance and 16 bits value of the homogeneous cube.
@group(2) @binding(2) var map: texture_3d<u32>;
// 1 for texels of a region.
@group(2) @binding(3) var flags: texture_3d<u32>;

// Samples of a brick, or after a skip, that are probed whatever their values.
const ENTRY_PROBES: u32 = 2u;
// Filtered values that differ by less may both come from guards: 1.25 of 16383.
const NEARLY_EQUAL: f32 = 1.25 / 16383.0;
// Voxels that a leap ends before the last place that is known; more where positions are large numbers.
const MARGIN: f32 = 1e-3;
const MARGIN_SHARE: f32 = 1e-6;
// Turns of a loop before the others have theirs: rays that wait for a neighbour do not wait for long.
const PROBE_TURNS: u32 = 4u;
const SAMPLE_TURNS: f32 = 32.0;

// The first sample that the brick does not own: the first k with k * step >= t_out.
fn first_outside(step: f32, k: f32, t_out: f32) -> f32 {
    var k_out = max(ceil(t_out / step), k + 1.0);
    // The quotient errs by a few units in the last place, the product decides.
    for (var i = 0; i < 2; i++) {
        if k_out > k + 1.0 && (k_out - 1.0) * step >= t_out {
            k_out -= 1.0;
        }
    }
    for (var i = 0; i < 2; i++) {
        if k_out * step < t_out {
            k_out += 1.0;
        }
    }
    return k_out;
}

// Where the ray leaves the cube about `center`; t.
fn leaves(ray: Ray, center: vec3<f32>, half: f32) -> f32 {
    let plane = center + half * sign(ray.direction);
    let t = select((plane - ray.origin) * ray.inverse, vec3(FAR), ray.direction == vec3(0.0));
    return min(min(t.x, t.y), t.z);
}

// The opacity of n samples of opacity alpha: by squaring, as exact as n single ones.
fn opacity_of(alpha: f32, n: f32) -> f32 {
    var clear = 1.0;
    var square = 1.0 - alpha;
    var left = u32(n);
    while left > 0u {
        clear *= select(1.0, square, (left & 1u) == 1u);
        square *= square;
        left >>= 1u;
    }
    return 1.0 - clear;
}

// Straight colour and opacity of one step, hidden where the view hides it.
fn shown(reader: Reader, code: f32, in_region: bool) -> vec4<f32> {
    if REGIONS {
        var sample = classify(reader, frame, code);
        if in_region {
            sample = classify_region(reader, frame, code);
        }
        if (frame.shown & select(1u, 2u, in_region)) == 0u {
            sample.a = 0.0;
        }
        return sample;
    }
    return classify(reader, frame, code);
}

@compute @workgroup_size(64, 4)
fn accelerated(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
) {
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
    let last_texel = vec3<i32>(brick.stored_dims) - 1;
    let last_cell = vec3<i32>(textureDimensions(map)) - 1;
    let cell_edge = f32(1u << brick.cell_shift);
    let far_corner = max(abs(ray.origin), vec3<f32>(brick.owned_hi));
    let margin = max(MARGIN, MARGIN_SHARE * max(max(far_corner.x, far_corner.y), far_corner.z));
    let asks_always = brick.map_mask > 0xffu;

    let k_out = first_outside(frame.step, owned.k, owned.t_out);
    var k = owned.k;
    var probes = ENTRY_PROBES;
    // The last value, at first far from all others: nothing is like it.
    var last = 9.0;
    // The first sample at which the map may say something new, and whether it is asked there.
    var k_look = k;
    var look = MAP;
    // Reads of texels; positions skipped and leapt.
    var reads = 0.0;
    var skipped = 0.0;
    var leapt = 0.0;
    while k < k_out && sum.a < frame.stop_alpha {
        if MAP {
            while look && k < k_out && sum.a < frame.stop_alpha {
                let p = ray.origin + k * frame.step * ray.direction;
                let cell = clamp((vec3<i32>(p) >> vec3(brick.cell_shift)) - brick.cell_lo, vec3(0), last_cell);
                let texel = textureLoad(map, cell, 0).x & brick.map_mask;
                let empty = texel & 0xffu;
                var alike = (texel >> 8u) & 0xffu;
                if REGIONS && brick.region_flags == 2u {
                    // Cells know no regions: their samples may need different tables.
                    alike = 0u;
                }
                let reach = f32(select(max(alike, 1u), empty, empty > 0u)) - 0.5;
                let center = (vec3<f32>(cell + brick.cell_lo) + 0.5) * cell_edge;
                let t_exit = leaves(ray, center, reach * cell_edge);
                let k_exit = max(min(ceil(t_exit / frame.step), k_out), k + 1.0);
                if empty > 0u {
                    skipped += k_exit - k;
                    k = k_exit;
                    probes = ENTRY_PROBES;
                } else {
                    k_look = k_exit;
                    look = alike > 0u;
                    if alike > 0u {
                        let n = k_exit - k;
                        let sample = shown(reader, f32(texel >> 16u) * (1.0 / 65535.0), brick.region_flags == 1u);
                        let weight = (1.0 - sum.a) * opacity_of(sample.a, n);
                        sum += vec4(sample.rgb * weight, weight);
                        k = k_exit;
                        leapt += n;
                    }
                }
            }
        }
        // The filter may read here.
        var safe = !LEAP || probes == 0u;
        if LEAP {
            for (var turn = 0u; turn < PROBE_TURNS; turn++) {
                if safe || look || k >= k_out || sum.a >= frame.stop_alpha {
                    break;
                }
                let p = ray.origin + k * frame.step * ray.direction;
                let voxel = vec3<i32>(p);
                let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
                let texel = u32(textureLoad(volume, at, 0).r * 65535.0 + 0.5);
                reads += 1.0;
                let is_leap = (texel & 0x8000u) != 0u;
                safe = (texel & 0x8001u) == 0u;
                if !safe {
                    let reach = f32((texel >> 7u) & 0xffu) - 1.0 - margin;
                    let t_exit = leaves(ray, vec3<f32>(voxel) + 0.5, reach);
                    let far = max(min(ceil(t_exit / frame.step), k_out) - k, 1.0);
                    let n = select(1.0, far, is_leap);
                    let mean = textureLoad(means, vec2<u32>(texel & 0x7fu, 0u), 0).r;
                    let code = select(f32(texel >> 1u) * (1.0 / 16383.0), mean, is_leap);
                    let sample = shown(reader, code, true);
                    let weight = (1.0 - sum.a) * opacity_of(sample.a, n);
                    sum += vec4(sample.rgb * weight, weight);
                    k += n;
                    leapt += select(0.0, n, is_leap);
                    last = code;
                    probes = max(probes, 2u) - 1u;
                    if MAP {
                        look = k >= k_look && (asks_always || sample.a == 0.0);
                    }
                }
            }
        }
        if safe && !look && k < k_out && sum.a < frame.stop_alpha {
            let k_first = k;
            let k_turn = min(k + SAMPLE_TURNS, k_out);
            loop {
                let p = ray.origin + k * frame.step * ray.direction;
                let code = read_volume(reader, p) * brick.code_scale;
                var in_region = false;
                if REGIONS {
                    in_region = brick.region_flags == 1u;
                    if brick.region_flags == 2u {
                        let at = clamp(vec3<i32>(p) - brick.stored_lo, vec3(0), last_texel);
                        in_region = textureLoad(flags, at, 0).x != 0u;
                        reads += 1.0;
                    }
                }
                let sample = shown(reader, code, in_region);
                let weight = (1.0 - sum.a) * sample.a;
                sum += vec4(sample.rgb * weight, weight);
                k += 1.0;
                if LEAP {
                    let is_equal = abs(code - last) <= NEARLY_EQUAL;
                    probes = max(max(probes, 1u) - 1u, select(0u, 1u, is_equal));
                    last = code;
                }
                if MAP {
                    look = k >= k_look && (asks_always || sample.a == 0.0);
                }
                if k >= k_turn || sum.a >= frame.stop_alpha || (LEAP && probes > 0u) || (MAP && look) {
                    break;
                }
            }
            reads += k - k_first;
        }
    }
    accumulator[slot] = sum;
    atomicAdd(&counters[4u * brick.counter], u32(reads));
    // Else every position is one read (layout.rs, `reads_every_position`).
    if LEAP || REGIONS || asks_always {
        atomicAdd(&counters[4u * brick.counter + 1u], u32(k - owned.k - skipped));
        atomicAdd(&counters[4u * brick.counter + 2u], u32(leapt));
    }
}
