// A brick without a map of macrocells: any position may show something.

const HAS_MAP: bool = false;

struct MapWalk {
    unused: f32,
}

fn enter_map(k: f32) -> MapWalk {
    return MapWalk(k);
}

fn ask_map(walk: ptr<function, MapWalk>, p: vec3<f32>, follows: bool) -> Step {
    return new_step();
}

fn leave_map(walk: ptr<function, MapWalk>, step: Step, k: f32, n: f32, k_exit: f32, shows: bool) {}
