// One brick into the accumulator, by rays that leap (Frey & Ertl 2009) and skip (Krueger & Westermann 2003): the plain
// loop of the flattened volume, several positions at once where they are known to have one value
// (docs/adr/0002-leaping.md). shaders/src/twin/accelerated.rs is the same on the CPU.
//
// One flat loop: a turn takes a skip, a leap or a sample. Loops within would each run at least once a turn where a
// driver does not branch around what no lane takes (software ones do not), and share less of what follows.

// Texels hold leaps.
override LEAP: bool;
// There is a macrocell map.
override MAP: bool;
// Samples in regions are hidden, shown alone, or have a table of their own.
override REGIONS: bool;

// By slot; one row.
@group(2) @binding(1) var means: texture_2d<f32>;
// Of MapTexel's bits.
@group(2) @binding(2) var map: texture_3d<u32>;
// 1 for texels of a region.
@group(2) @binding(3) var flags: texture_3d<u32>;

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
    let last_texel = vec3<i32>(brick.stored_dims) - 1;
    let last_cell = vec3<i32>(textureDimensions(map)) - 1;
    let cell_edge = f32(1u << brick.cell_shift);
    let far_corner = max(abs(ray.origin), vec3<f32>(brick.owned_hi));
    let margin = max(MARGIN, MARGIN_SHARE * max(max(far_corner.x, far_corner.y), far_corner.z));
    let asks_always = brick.map_mask > MAP_EMPTY;

    let k_out = first_outside(frame.step, owned.k, owned.t_out);
    var k = owned.k;
    var probes = ENTRY_PROBES;
    var last = NOTHING_YET;
    // The first sample at which the map may say something new, and whether it is asked there.
    var k_look = k;
    var look = MAP;
    // Reads of texels; jumps that read none; positions skipped and leapt.
    var reads = 0.0;
    var jumps_unread = 0.0;
    var skipped = 0.0;
    var leapt = 0.0;
    while k < k_out && sum.a < frame.stop_alpha {
        // Always the product, never accumulated: the same sample in every brick.
        let p = ray.origin + k * frame.step * ray.direction;
        let voxel = vec3<i32>(p);
        var code = 0.0;
        var is_empty = false;
        var is_alike = false;
        var is_leap = false;
        var is_inner = false;
        // The cube about `center` that one answer is good for.
        var center = vec3(0.0);
        var half = 0.0;
        if MAP && look {
            let cell = clamp((voxel >> vec3(brick.cell_shift)) - brick.cell_lo, vec3(0), last_cell);
            let texel = map_texel(textureLoad(map, cell, 0).x & brick.map_mask);
            let empty = texel.empty;
            // Cells know no regions: their samples may need different tables.
            let alike = select(texel.distance, 0u, REGIONS && brick.region_flags == 2u);
            is_empty = empty > 0u;
            is_alike = !is_empty && alike > 0u;
            code = texel.code;
            center = (vec3<f32>(cell + brick.cell_lo) + 0.5) * cell_edge;
            half = (f32(select(max(alike, 1u), empty, is_empty)) - 0.5) * cell_edge;
        }
        if LEAP && probes > 0u && !(is_empty || is_alike) {
            let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
            let texel = coded_texel(textureLoad(volume, at, 0).r);
            reads += 1.0;
            is_leap = texel.is_leap;
            is_inner = texel.is_inner;
            if is_leap {
                code = textureLoad(means, vec2<u32>(texel.slot, 0u), 0).r;
                center = vec3<f32>(voxel) + 0.5;
                half = f32(texel.distance) - 1.0 - margin;
            } else {
                code = texel.code;
            }
        }
        let jumps = is_empty || is_alike || is_leap;
        let k_exit = max(min(ceil(leaves(ray, center, half) / frame.step), k_out), k + 1.0);
        let n = select(1.0, k_exit - k, jumps);
        var in_region = is_leap || is_inner || brick.region_flags == 1u;
        if !(jumps || is_inner) {
            code = read_volume(reader, p) * brick.code_scale;
            reads += 1.0;
            if REGIONS && brick.region_flags == 2u {
                let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
                in_region = textureLoad(flags, at, 0).x != 0u;
                reads += 1.0;
            }
        }
        var sample = shown(reader, code, in_region);
        if is_no_data(code) {
            sample = vec4(0.0);
        }
        let opacity = select(opacity_of(sample.a, n), sample.a, n == 1.0);
        let weight = select((1.0 - sum.a) * opacity, 0.0, is_empty);
        sum += vec4(sample.rgb * weight, weight);
        if MAP {
            // A leap says nothing of its cell: the map may be asked again behind it.
            k_look = select(k_look, select(k_exit, k, is_leap), look);
            look = is_empty || (k + n >= k_look && (asks_always || sample.a == 0.0));
        }
        if LEAP {
            let is_equal = abs(code - last) <= NEARLY_EQUAL;
            let fewer = max(probes, 1u) - 1u;
            probes = select(max(fewer, select(0u, 1u, is_equal)), max(fewer, 1u), is_leap || is_inner);
            probes = select(probes, ENTRY_PROBES, is_empty);
            last = select(code, last, is_empty);
        }
        jumps_unread += select(0.0, 1.0, is_empty || is_alike);
        skipped += select(0.0, n, is_empty);
        leapt += select(0.0, n, is_leap || is_alike);
        k += n;
    }
    accumulator[slot] = sum;
    atomicAdd(&counters[4u * brick.counter], u32(reads));
    if MAP {
        atomicAdd(&counters[4u * brick.counter + 3u], u32(jumps_unread));
    }
    // Else every position is one read (layout.rs, `reads_every_position`).
    if LEAP || REGIONS || asks_always {
        atomicAdd(&counters[4u * brick.counter + 1u], u32(k - owned.k - skipped));
        atomicAdd(&counters[4u * brick.counter + 2u], u32(leapt));
    }
}
