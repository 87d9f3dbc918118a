// What single samples add, colours as they are. shaders/src/twin/take/sampled.rs is the same on the CPU.

const TAKES_EMPTY: bool = false;

fn ends_beyond() -> bool {
    return false;
}

fn neutral_code() -> f32 {
    return 0.0;
}

struct Taking {
    unused: f32,
}

fn enter_take(ray: Ray) -> Taking {
    return Taking(0.0);
}

// Adds a run; true where something of it shows.
fn take(
    taking: ptr<function, Taking>,
    reader: Reader,
    ray: Ray,
    p: vec3<f32>,
    run: Run,
    sum: ptr<function, vec4<f32>>,
) -> bool {
    var sample = classify(run.in_region, run.code);
    sample.a = select(0.0, sample.a, is_shown(run.in_region));
    let alpha = select(opacity_of(sample.a, run.n), sample.a, run.n == 1.0);
    let weight = (1.0 - (*sum).a) * alpha;
    *sum += vec4(sample.rgb * weight, weight);
    return sample.a > 0.0;
}
