// A brick among those of its own level: positions are whole steps. shaders/src/twin/positions.rs is the same on the
// CPU.

const BORDERS: bool = false;

// Which positions of a ray a brick visits: from `start` to below `k_end`; it owns those below `k_out`.
struct Positions {
    start: f32,
    k_out: f32,
    k_end: f32,
}

// Empty where k * step >= t_out.
fn segment_of(ray: Ray) -> Segment {
    return owned_segment(frame.step, brick, ray);
}

fn positions_of(ray: Ray, owned: Segment) -> Positions {
    let k_out = first_outside(frame.step, owned.k, owned.t_out);
    return Positions(owned.k, k_out, select(k_out, k_out + 1.0, ends_beyond()));
}

// The position behind k.
fn behind(at: Positions, k: f32) -> f32 {
    return k + 1.0;
}

// The position before k.
fn before(at: Positions, k: f32) -> f32 {
    return k - 1.0;
}

// The position at which a jump from k ends that may go to the whole position x.
fn ends_at(at: Positions, k: f32, x: f32) -> f32 {
    return max(min(x, at.k_end), k + 1.0);
}
