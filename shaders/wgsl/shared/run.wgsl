// What passes between walk and take. shaders/src/twin/run.rs is the same on the CPU.

// What a walk knows of a position before it is read.
struct Step {
    // Of the position, where that is known.
    code: f32,
    is_known: bool,
    // All positions up to the ray's exit from the cube about `center` are like this one.
    jumps: bool,
    center: vec3<f32>,
    half: f32,
    // The map says so: nothing is read.
    is_by_map: bool,
    // Nothing is taken here ...
    is_skip: bool,
    // ... and the next position is the one before.
    is_back: bool,
    // Deep in a region, as the texel says.
    is_deep: bool,
    // Deep in a region or in a cube of one value: no gradient.
    is_flat: bool,
}

// Nothing is known.
fn new_step() -> Step {
    return Step(0.0, false, false, vec3(0.0), 0.0, false, false, false, false, false);
}

// The first position behind the cube.
fn exit_of(ray: Ray, step: Step) -> f32 {
    return ceil(leaves(ray, step.center, step.half) / frame.step);
}

// Positions k .. k + n of one code: a sample, a leap, or a cube of one value. A sample is one step long (n = 1), or
// shorter where levels meet.
struct Run {
    k: f32,
    n: f32,
    // From the first of them to the last.
    within: f32,
    // Those of them that the brick owns.
    owns: f32,
    code: f32,
    in_region: bool,
    // Nothing in it has a gradient.
    is_flat: bool,
    // The position before it was taken: a slab lies between.
    follows: bool,
}
