// One brick into the accumulator: the only loop of rays. Where next is the *walk* (walk/), what a place holds the
// *read* (read/), what a run of positions adds the *take* (take/), which part of a ray there is the *scene* (scene/),
// and at which positions a brick begins and ends the *positions* (positions/): of each the files that a kernel needs
// are joined to this one (shaders/src/lib.rs). shaders/src/twin/march.rs is the same on the CPU.
//
// The invariant: a brick visits the positions that it owns and, where what lies between matters, the first one beyond.
// Every turn takes one run of positions that have one code, or jumps over some that add nothing
// (docs/adr/0014-one-loop.md).
//
// One flat loop: loops within would each run at least once a turn where a driver does not branch around what no lane
// takes (software ones do not), and share less of what follows.

// Samples in regions are hidden, shown alone, or have a table of their own.
override REGIONS: bool;
// Not every position is one read: they are counted by themselves.
override COUNTS_POSITIONS: bool;

// 1 for texels of a region.
@group(2) @binding(3) var flags: texture_3d<u32>;

// Where the brick says of each voxel whether it is in a region.
fn has_flags() -> bool {
    return REGIONS && brick.region_flags == FLAGS_TEXTURE;
}

@compute @workgroup_size(64, 4)
fn march(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_id) lane: vec3<u32>,
) {
    load_uniforms();
    // Within the rectangle.
    let place = workgroup.xy * WORKGROUP_PIXELS + pixel_of_lane(lane.xy);
    if any(place >= brick.rect_size) {
        return;
    }
    let pixel = vec2<i32>(brick.rect_lo + place);
    let ray = pixel_ray(frame, pixel.x, pixel.y);
    let whole = segment_of(ray);
    // Most rays of a workgroup miss most bricks.
    if whole.k * frame.step >= whole.t_out {
        return;
    }
    let owned = clipped(ray, whole);
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
    let at = positions_of(ray, owned);
    var by_map = enter_map(owned.k);
    var by_code = enter_code(ray);
    var taking = enter_take(ray);
    var k = owned.k;
    // The position before k was taken.
    var follows = false;
    // Reads of texels; jumps that read none; positions taken, and leapt.
    var reads = 0.0;
    var jumps_unread = 0.0;
    var positions = 0.0;
    var leapt = 0.0;
    while k < at.k_end && sum.a < frame.stop_alpha {
        // Always the product, never accumulated: the same sample in every brick.
        let p = place_at(ray, k);
        var step = ask_map(&by_map, p, follows);
        reads += ask_code(&by_code, &step, p, last_texel);
        let k_exit = ends_at(at, k, exit_of(ray, step));
        let k_next = select(select(behind(at, k), k_exit, step.jumps), before(at, k), step.is_back);
        let n = k_next - k;
        var code = step.code;
        var in_region = step.is_deep || brick.region_flags == FLAGS_EVERY_VOXEL;
        if !step.is_known {
            code = read_volume(reader, p) * brick.code_scale;
            reads += 1.0;
            if has_flags() {
                let at = clamp(vec3<i32>(p) - brick.stored_lo, vec3(0), last_texel);
                in_region = textureLoad(flags, at, 0).x != 0u;
                reads += 1.0;
            }
        }
        // A place without data is no sample, and no slab ends or starts there.
        let is_taken = !(step.is_skip || is_no_data(code));
        let owns = select(n, max(min(n, at.k_out - k), 0.0), ends_beyond());
        var shows = false;
        if is_taken {
            let within = before(at, k_next) - k;
            let run = Run(k, n, within, owns, code, in_region, step.is_flat, follows);
            shows = take(&taking, reader, ray, p, run, &sum);
        }
        leave_map(&by_map, step, k, n, k_exit, shows);
        leave_code(&by_code, step, code);
        jumps_unread += select(0.0, 1.0, step.is_by_map);
        positions += select(owns, 0.0, step.is_skip);
        leapt += select(0.0, n, step.jumps && step.is_flat);
        follows = is_taken;
        k = k_next;
    }
    accumulator[slot] = sum;
    count(COUNT_READS, reads);
    if HAS_MAP {
        count(COUNT_JUMPS, jumps_unread);
    }
    // Else every position is one read.
    if COUNTS_POSITIONS {
        count(COUNT_TAKEN, positions);
        count(COUNT_LEAPT, leapt);
    }
}
