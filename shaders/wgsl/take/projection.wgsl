// What a run adds to a projection: pixels carry codes until a frame is joined. shaders/src/twin/take/projection.rs is
// the same on the CPU.

// What is skipped counts: as a run of the code that changes no extreme and adds nothing to a sum.
const TAKES_EMPTY: bool = true;

// What the accumulator holds (PixelKind of volume/src/pixel.rs): the largest code, the smallest, or sum and number.
override MODE: u32;
const MODE_LARGEST: u32 = 1u;
const MODE_SMALLEST: u32 = 2u;
const MODE_MEAN: u32 = 3u;

fn ends_beyond() -> bool {
    return false;
}

fn neutral_code() -> f32 {
    return select(0.0, 1.0, MODE == MODE_SMALLEST);
}

struct Taking {
    unused: f32,
}

fn enter_take(ray: Ray) -> Taking {
    return Taking(0.0);
}

// Adds a run; false, so that the map is asked again behind it.
fn take(
    taking: ptr<function, Taking>,
    reader: Reader,
    ray: Ray,
    p: vec3<f32>,
    run: Run,
    sum: ptr<function, vec4<f32>>,
) -> bool {
    if is_shown(run.in_region) {
        let is_first = (*sum).a == 0.0;
        if MODE == MODE_LARGEST {
            (*sum).r = select(max((*sum).r, run.code), run.code, is_first);
        } else if MODE == MODE_SMALLEST {
            (*sum).r = select(min((*sum).r, run.code), run.code, is_first);
        } else {
            let weight = run.n * frame.weight;
            (*sum).r += run.code * weight;
            (*sum).g += weight;
        }
        (*sum).a = 1.0;
    }
    return false;
}
