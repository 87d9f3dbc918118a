// A brick whose texels are all values.

struct CodeWalk {
    unused: f32,
}

fn enter_code(ray: Ray) -> CodeWalk {
    return CodeWalk(0.0);
}

// Returns the texels read.
fn ask_code(walk: ptr<function, CodeWalk>, step: ptr<function, Step>, p: vec3<f32>, last_texel: vec3<i32>) -> f32 {
    return 0.0;
}

fn leave_code(walk: ptr<function, CodeWalk>, step: Step, code: f32) {}

// Nowhere.
fn deep_at(p: vec3<f32>) -> vec2<f32> {
    return vec2(0.0);
}
