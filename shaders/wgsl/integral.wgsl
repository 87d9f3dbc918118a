// One brick into the accumulator, by rays that integrate between samples (Lum, Wilson & Ma 2004), light what they meet,
// find isosurfaces (Krueger & Westermann 2003), project, and are clipped; with leaps and skips.
// shaders/src/twin/integral.rs is the same on the CPU, and says what holds.

// There is a macrocell map.
override MAP: bool;
// Of MapTexel's bits.
@group(2) @binding(2) var map: texture_3d<u32>;
// 1 for texels of a region.
@group(2) @binding(3) var flags: texture_3d<u32>;

// What clipping leaves of a ray: from x to below y.
fn clipped(ray: Ray) -> vec2<f32> {
    var span = vec2(0.0, FAR);
    for (var i = 0u; i < scene_data.style.plane_count; i++) {
        let plane = scene_data.style.planes[i];
        let inside = dot(plane.xyz, ray.origin) - plane.w;
        let along = dot(plane.xyz, ray.direction);
        if along == 0.0 {
            if inside < 0.0 {
                return vec2(FAR, -1.0);
            }
            continue;
        }
        let t = -inside / along;
        if along > 0.0 {
            span.x = max(span.x, t);
        } else {
            span.y = min(span.y, t);
        }
    }
    return span;
}

// Clips that end no deeper in the volume than this count as its own faces; in units of t.
const LEAST_CUT: f32 = 1e-3;

// Where the ray enters the volume, were it endless; t.
fn volume_entry(ray: Ray) -> f32 {
    let flat = ray.direction == vec3(0.0);
    let at_lo = (vec3(0.0) - ray.origin) * ray.inverse;
    let at_hi = (volume_hi - ray.origin) * ray.inverse;
    let enter = select(min(at_lo, at_hi), vec3(-FAR), flat);
    return max(max(max(enter.x, enter.y), enter.z), 0.0);
}

// The first sample behind the cut by which clipping lets the ray in at t_lo; -1 where the volume's own face does, or
// nothing.
fn first_behind_cut(ray: Ray, t_lo: f32) -> f32 {
    if t_lo <= volume_entry(ray) + LEAST_CUT {
        return -1.0;
    }
    return first_sample(frame, t_lo);
}

@compute @workgroup_size(64, 4)
fn integral(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
) {
    load_uniforms();
    volume_hi = vec3<f32>(scene_data.style.volume_hi);
    // Within the rectangle.
    let place = workgroup.xy * 16u + pixel_of_lane(lane.xy);
    if any(place >= brick.rect_size) {
        return;
    }
    let pixel = vec2<i32>(brick.rect_lo + place);
    let ray = pixel_ray(frame, pixel.x, pixel.y);
    var owned = owned_segment(frame, brick, ray);
    if owned.k * frame.step >= owned.t_out {
        return;
    }
    let span = clipped(ray);
    owned.t_out = min(owned.t_out, span.y);
    if span.x > 0.0 {
        owned.k = max(owned.k, first_sample(frame, span.x));
    }
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
    let has_slabs = MODE == 0u && (PREINTEGRATED || SURFACES);

    let k_out = first_outside(frame.step, owned.k, owned.t_out);
    let k_last = select(k_out - 1.0, k_out, has_slabs);
    var k_entry = -1.0;
    if SURFACES {
        // As its brick computes it.
        k_entry = first_sample(frame, max(volume_entry(ray), span.x));
    }
    var k_cut = -1.0;
    if LIGHT != 0u && MODE == 0u {
        k_cut = first_behind_cut(ray, span.x);
    }
    var k = owned.k;
    var probes = ENTRY_PROBES;
    var last = NOTHING_YET;
    // The first sample at which the map may say something new, and whether it is asked there.
    var k_look = k;
    var look = MAP;
    // The position before the present one.
    var front = End(0.0, k, vec2(0.0), false, false);
    var has_front = false;
    var front_in_region = false;
    var front_is_empty = false;
    // The positions just before k were skipped: where k is not empty, the last of them must be read.
    var has_skipped = false;
    // The position at k lies in an empty cell, and is read all the same.
    var reads_empty = false;
    // Reads of texels; jumps that read none; positions taken, and leapt.
    var reads = 0.0;
    var jumps_unread = 0.0;
    var positions = 0.0;
    var leapt = 0.0;
    while k <= k_last && sum.a < frame.stop_alpha {
        let p = place_at(ray, k);
        let voxel = vec3<i32>(p);
        var code = 0.0;
        var n = 0.0;
        var in_region = brick.region_flags == 1u;
        // Deep in a region or a homogeneous cube: no gradient.
        var is_flat = false;
        if MAP && look {
            let cell = clamp((voxel >> vec3(brick.cell_shift)) - brick.cell_lo, vec3(0), last_cell);
            let texel = map_texel(textureLoad(map, cell, 0).x & brick.map_mask);
            let empty = texel.empty;
            // Cells know no regions: their samples may need different tables.
            let alike = select(texel.distance, 0u, REGIONS && brick.region_flags == 2u);
            let center = (vec3<f32>(cell + brick.cell_lo) + 0.5) * cell_edge;
            let half = (f32(select(max(alike, 1u), empty, empty > 0u)) - 0.5) * cell_edge;
            let k_exit = max(min(ceil(leaves(ray, center, half) / frame.step), k_last + 1.0), k + 1.0);
            if empty > 0u && MODE != 0u {
                // Nothing there changes the projection: a run of the code that says so.
                code = select(0.0, 1.0, MODE == 2u);
                n = k_exit - k;
                jumps_unread += 1.0;
            } else if empty > 0u && (!has_slabs || !has_front || front_is_empty) {
                // Both ends of all slabs up to the one that leaves.
                jumps_unread += 1.0;
                k = k_exit;
                has_front = false;
                has_skipped = has_slabs;
                probes = ENTRY_PROBES;
                last = NOTHING_YET;
                continue;
            } else if empty == 0u && has_skipped {
                // The slab that enters what shows starts in the empty.
                jumps_unread += 1.0;
                k -= 1.0;
                has_skipped = false;
                look = false;
                reads_empty = true;
                continue;
            } else {
                reads_empty = empty > 0u;
                k_look = select(k_exit, k + 1.0, reads_empty);
                if !reads_empty && alike > 0u {
                    code = texel.code;
                    n = k_exit - k;
                    is_flat = true;
                    leapt += n;
                    jumps_unread += 1.0;
                }
            }
        }
        if LEAP && n == 0.0 && probes > 0u {
            let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
            let texel = coded_texel(textureLoad(volume, at, 0).r);
            reads += 1.0;
            if texel.is_leap {
                let half = f32(texel.distance) - 1.0 - margin;
                let k_exit = ceil(leaves(ray, vec3<f32>(voxel) + 0.5, half) / frame.step);
                n = max(min(k_exit, k_last + 1.0) - k, 1.0);
                code = textureLoad(means, vec2<u32>(texel.slot, 0u), 0).r;
                in_region = true;
                is_flat = true;
                leapt += n;
                probes = max(probes, 2u) - 1u;
            } else if texel.is_inner {
                n = 1.0;
                code = texel.code;
                in_region = true;
                is_flat = true;
                probes = max(probes, 2u) - 1u;
            }
        }
        if n == 0.0 {
            code = read_volume(reader, p) * brick.code_scale;
            n = 1.0;
            reads += 1.0;
            if REGIONS && brick.region_flags == 2u {
                let at = clamp(voxel - brick.stored_lo, vec3(0), last_texel);
                in_region = textureLoad(flags, at, 0).x != 0u;
                reads += 1.0;
            }
            if LEAP {
                let is_equal = abs(code - last) <= NEARLY_EQUAL;
                probes = max(max(probes, 1u) - 1u, select(0u, 1u, is_equal));
            }
        }
        last = code;
        // Positions that the brick owns.
        let taken = max(min(n, k_out - k), 0.0);
        positions += taken;
        if is_no_data(code) {
            // No sample, and no slab ends or starts here.
            k += n;
            has_front = false;
            front_is_empty = false;
            reads_empty = false;
            look = MAP && k >= k_look;
            continue;
        }
        var opacity = 0.0;
        let shows = !REGIONS || is_shown(in_region);
        if MODE != 0u {
            let is_first = sum.a == 0.0;
            if MODE == 1u {
                sum.r = select(max(sum.r, code), code, is_first);
            } else if MODE == 2u {
                sum.r = select(min(sum.r, code), code, is_first);
            } else {
                sum.r += code * n;
                sum.g += n;
            }
            sum.a = 1.0;
            look = MAP && k + n >= k_look;
            k += n;
            continue;
        }
        let is_cut = LIGHT != 0u && k == k_cut;
        var back = End(code, k, UNLIT, is_flat, is_cut && n == 1.0);
        if has_slabs && has_front && (!REGIONS || is_shown(front_in_region)) {
            // A slab is of one kind, its front's: colours do not run from one kind into the other.
            var far = back;
            let is_same = front_in_region == in_region;
            if REGIONS && !is_same {
                far.code = front.code;
            }
            let first = front.code;
            if SURFACES {
                let rises = far.code > first;
                let end = far;
                let start = front;
                for (var i = 0u; i < scene_data.style.surface_count; i++) {
                    let surface = select(scene_data.style.surface_count - 1u - i, i, rises);
                    let value = scene_data.style.codes[surface].x;
                    var met = -1.0;
                    if (first >= value) != (end.code >= value) {
                        met = crossing(reader, ray, start, end, value);
                    }
                    if met >= 0.0 {
                        var here = End(value, max(met, front.k), UNLIT, false, start.is_cut);
                        if PREINTEGRATED {
                            let before =
                                slab_between(reader, ray, front_in_region, &front, &here, here.k - front.k);
                            sum += before * (1.0 - sum.a);
                        }
                        sum += surface_at(reader, ray, surface, here.k, false) * (1.0 - sum.a);
                        opacity = 1.0;
                        front = here;
                    }
                }
            }
            if PREINTEGRATED {
                let length = select(far.k - front.k, 1.0, opacity == 0.0);
                let rest = slab_between(reader, ray, front_in_region, &front, &far, length);
                sum += rest * (1.0 - sum.a);
                opacity = max(opacity, rest.a);
                if !REGIONS || is_same {
                    back.light = far.light;
                    back.is_lit = far.is_lit;
                }
            }
        }
        if SURFACES && k == k_entry && shows {
            for (var surface = 0u; surface < scene_data.style.surface_count; surface++) {
                if code >= scene_data.style.codes[surface].x {
                    sum += surface_at(reader, ray, surface, k, true) * (1.0 - sum.a);
                }
            }
        }
        if PREINTEGRATED {
            // The slabs within the run.
            if n > 1.0 && shows {
                var within = n - 1.0;
                if is_cut {
                    let nodes = nodes_of(in_region, code, code);
                    let slab = look_up(false, in_region, nodes);
                    sum += cut_slab(ray, in_region, nodes, slab) * (1.0 - sum.a);
                    within -= 1.0;
                }
                sum += flat_slabs(in_region, code, within) * (1.0 - sum.a);
                opacity = 1.0;
            }
        } else if taken > 0.0 && shows {
            var sample = vec4(0.0);
            if REGIONS && in_region {
                sample = classify_region(reader, frame, code);
            } else {
                sample = classify(reader, frame, code);
            }
            opacity = max(opacity, sample.a);
            var rest = taken;
            if is_cut && sample.a > 0.0 {
                let color = lit_color(sample.rgb, light_of_entry(ray));
                sum += vec4(color, 1.0) * (sample.a * (1.0 - sum.a));
                rest -= 1.0;
            }
            if sample.a > 0.0 && rest > 0.0 {
                if LIGHT != 0u && !is_flat {
                    if !back.is_lit {
                        back.light = light_at(reader, ray, p);
                        back.is_lit = true;
                    }
                    sample = vec4(lit_color(sample.rgb, back.light), sample.a);
                }
                let alpha = select(opacity_of(sample.a, rest), sample.a, rest == 1.0);
                let weight = (1.0 - sum.a) * alpha;
                sum += vec4(sample.rgb * weight, weight);
            }
        }
        k += n;
        back.k = k - 1.0;
        front = back;
        has_front = has_slabs;
        front_in_region = in_region;
        front_is_empty = reads_empty;
        reads_empty = false;
        look = MAP && k >= k_look && (asks_always || opacity == 0.0);
    }
    accumulator[slot] = sum;
    atomicAdd(&counters[4u * brick.counter], u32(reads));
    atomicAdd(&counters[4u * brick.counter + 1u], u32(positions));
    atomicAdd(&counters[4u * brick.counter + 2u], u32(leapt));
    if MAP {
        atomicAdd(&counters[4u * brick.counter + 3u], u32(jumps_unread));
    }
}
