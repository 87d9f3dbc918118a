// Isosurfaces (Krueger & Westermann 2003). shaders/src/twin/surface.rs is the same on the CPU.

// Halvings of a slab in which an isosurface lies: to 1/64 step, before the last interpolation.
const BISECTIONS: i32 = 6;

// Where the ray has `value` between two samples on either side of it, in steps: bisection, then a line. Negative where
// a place between holds no data.
fn crossing(reader: Reader, ray: Ray, front: End, back: End, value: f32) -> f32 {
    var lo = 0.0;
    var hi = 1.0;
    var at_lo = front.code;
    var at_hi = back.code;
    let is_above = at_lo >= value;
    for (var i = 0; i < BISECTIONS; i++) {
        let middle = 0.5 * (lo + hi);
        let code = value_at(reader, place_at(ray, front.k + middle));
        if is_no_data(code) {
            return -1.0;
        }
        if (code >= value) == is_above {
            lo = middle;
            at_lo = code;
        } else {
            hi = middle;
            at_hi = code;
        }
    }
    let rise = at_hi - at_lo;
    let part = select(clamp((value - at_lo) / select(1.0, rise, rise != 0.0), 0.0, 1.0), 0.5, rise == 0.0);
    return front.k + lo + (hi - lo) * part;
}

// An isosurface that the ray meets at k steps, or with its entry, premultiplied.
fn surface_at(reader: Reader, ray: Ray, surface: u32, k: f32, is_entry: bool) -> vec4<f32> {
    let shown = scene_data.style.colors[surface];
    var color = shown.rgb;
    if LIGHT != 0u {
        var light = UNLIT;
        if is_entry {
            light = light_of_entry(ray);
        } else {
            light = light_at(reader, ray, place_at(ray, k));
        }
        color = lit_color(color, light);
    }
    return vec4(color * shown.a, shown.a);
}
