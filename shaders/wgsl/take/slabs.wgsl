// What lies between samples adds (Lum, Wilson & Ma 2004), with light and isosurfaces (Krueger & Westermann 2003); and
// single samples under light or clips. shaders/src/twin/take/slabs.rs is the same on the CPU.
//
// Every run closes the slab that ends at its first position, and adds the slabs within it. So slab k, from t_k to
// t_(k+1), belongs to the owner of t_k, is closed once, and sees the same two values whatever the partition
// (docs/adr/0006-integral.md).

const TAKES_EMPTY: bool = false;

fn ends_beyond() -> bool {
    return PREINTEGRATED || SURFACES;
}

fn neutral_code() -> f32 {
    return 0.0;
}

struct Taking {
    // The position before the present one, where it was taken.
    front: End,
    front_in_region: bool,
    // The position by which the ray enters the volume, or what clips leave of it.
    k_entry: f32,
    // The first behind the cut by which clips let the ray in; -1 where nothing is lit as a cut.
    k_cut: f32,
}

fn enter_take(ray: Ray) -> Taking {
    let span = clip_span(ray);
    // As its brick computes it.
    let k_entry = select(-1.0, first_sample(frame.step, max(volume_entry(ray), span.x)), SURFACES);
    let k_cut = select(-1.0, first_behind_cut(ray, span.x), LIGHT != 0u);
    return Taking(End(0.0, 0.0, UNLIT, false, false), false, k_entry, k_cut);
}

// Adds a run; true where something of it may show.
fn take(
    taking: ptr<function, Taking>,
    reader: Reader,
    ray: Ray,
    p: vec3<f32>,
    run: Run,
    sum: ptr<function, vec4<f32>>,
) -> bool {
    var opacity = 0.0;
    let shows = is_shown(run.in_region);
    let is_cut = LIGHT != 0u && run.k == (*taking).k_cut;
    var back = End(run.code, run.k, UNLIT, run.is_flat, is_cut && run.within == 0.0);
    if ends_beyond() && run.follows && is_shown((*taking).front_in_region) {
        // A slab is of one kind, its front's: colours do not run from one kind into the other.
        var far = back;
        let is_same = !REGIONS || (*taking).front_in_region == run.in_region;
        far.code = select((*taking).front.code, far.code, is_same);
        var front = (*taking).front;
        opacity = close_slab(reader, ray, (*taking).front_in_region, &front, &far, sum);
        if PREINTEGRATED && is_same {
            back.light = far.light;
            back.is_lit = far.is_lit;
        }
    }
    if SURFACES && run.k == (*taking).k_entry && shows {
        for (var surface = 0u; surface < scene_data.style.surface_count; surface++) {
            if run.code >= scene_data.style.codes[surface].x {
                add(sum, surface_at(reader, ray, surface, run.k, true));
            }
        }
    }
    if PREINTEGRATED {
        // The slabs within the run.
        if run.within > 0.0 && shows {
            var within = run.within;
            if is_cut {
                let nodes = nodes_of(run.in_region, run.code, run.code);
                let slab = look_up(false, run.in_region, nodes);
                let first = min(within, 1.0);
                add(sum, of_length(cut_slab(ray, run.in_region, nodes, slab), first));
                within -= first;
            }
            add(sum, flat_slabs(run.in_region, run.code, within));
            opacity = 1.0;
        }
    } else if run.owns > 0.0 && shows {
        var sample = classify(run.in_region, run.code);
        opacity = max(opacity, sample.a);
        var rest = run.owns;
        if is_cut && sample.a > 0.0 {
            let color = lit_color(sample.rgb, light_of_entry(ray));
            let first = min(rest, 1.0);
            let alpha = select(opacity_of(sample.a, first), sample.a, first == 1.0);
            add(sum, vec4(color * alpha, alpha));
            rest -= first;
        }
        if sample.a > 0.0 && rest > 0.0 {
            if LIGHT != 0u && !run.is_flat {
                if !back.is_lit {
                    back.light = light_at(reader, ray, p);
                    back.is_lit = true;
                }
                sample = vec4(lit_color(sample.rgb, back.light), sample.a);
            }
            let alpha = select(opacity_of(sample.a, rest), sample.a, rest == 1.0);
            add(sum, vec4(sample.rgb * alpha, alpha));
        }
    }
    back.k = run.k + run.within;
    (*taking).front = back;
    (*taking).front_in_region = run.in_region;
    return opacity > 0.0;
}

// Closes the slab between two positions, isosurfaces in it; the opacity that it adds, surfaces and all.
fn close_slab(
    reader: Reader,
    ray: Ray,
    in_region: bool,
    front: ptr<function, End>,
    back: ptr<function, End>,
    sum: ptr<function, vec4<f32>>,
) -> f32 {
    var opacity = 0.0;
    if SURFACES {
        let first = *front;
        let last = *back;
        let count = scene_data.style.surface_count;
        let rises = last.code > first.code;
        for (var i = 0u; i < count; i++) {
            let surface = select(count - 1u - i, i, rises);
            let value = scene_data.style.codes[surface].x;
            var met = -1.0;
            if (first.code >= value) != (last.code >= value) {
                met = crossing(reader, ray, first, last, value);
            }
            if met >= 0.0 {
                var here = End(value, max(met, (*front).k), UNLIT, false, first.is_cut);
                if PREINTEGRATED {
                    let length = here.k - (*front).k;
                    add(sum, slab_between(reader, ray, in_region, front, &here, length));
                }
                add(sum, surface_at(reader, ray, surface, here.k, false));
                opacity = 1.0;
                *front = here;
            }
        }
    }
    if PREINTEGRATED {
        let length = select((*back).k - (*front).k, 1.0, opacity == 0.0 && !BORDERS);
        let rest = slab_between(reader, ray, in_region, front, back, length);
        add(sum, rest);
        opacity = max(opacity, rest.a);
    }
    return opacity;
}
