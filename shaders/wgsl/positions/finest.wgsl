// A brick next to some of another level: positions are whole steps, and one more where a ray comes from another level,
// and where it goes to one, as exactly as by `finest` parts of a step. shaders/src/twin/positions.rs is the same on the
// CPU, and says why.

const BORDERS: bool = true;

// Which positions of a ray a brick visits: from `start` to below `k_end`; it owns those below `k_out`.
struct Positions {
    start: f32,
    k_out: f32,
    k_end: f32,
}

// Is another level drawn where the ray is at t, in or around the brick?
fn is_elsewhere(ray: Ray, t: f32) -> bool {
    let at_lo = (vec3<f32>(brick.owned_lo) - ray.origin) * ray.inverse;
    let at_hi = (vec3<f32>(brick.owned_hi) - ray.origin) * ray.inverse;
    let moves = ray.direction != vec3(0.0);
    let comes = moves & (vec3(t) < min(at_lo, at_hi));
    let goes = moves & (vec3(t) >= max(at_lo, at_hi));
    let forward = select(vec3(-1), vec3(1), ray.direction > vec3(0.0));
    let away = select(select(vec3(0), forward, goes), -forward, comes);
    let side = 13 + away.x + 3 * away.y + 9 * away.z;
    return ((brick.borders >> u32(side)) & 1u) == 1u;
}

// Empty where k * step >= t_out.
fn segment_of(ray: Ray) -> Segment {
    let fine = owned_segment(frame.step * frame.finest, brick, ray);
    let k = fine.k * frame.finest;
    if k * frame.step >= fine.t_out {
        return Segment(0.0, -1.0);
    }
    let comes = (fine.k - 1.0) * frame.finest * frame.step;
    if fine.k > 0.0 && is_elsewhere(ray, comes) {
        return Segment(k, fine.t_out);
    }
    return Segment(ceil(k), fine.t_out);
}

fn positions_of(ray: Ray, owned: Segment) -> Positions {
    let first = first_outside(frame.step * frame.finest, owned.k / frame.finest, owned.t_out);
    var k_out = first * frame.finest;
    let whole = ceil(k_out);
    while k_out < whole && !is_elsewhere(ray, k_out * frame.step) {
        k_out += frame.finest;
    }
    return Positions(owned.k, k_out, select(k_out, k_out + 1.0, ends_beyond()));
}

// The position behind k.
fn behind(at: Positions, k: f32) -> f32 {
    return select(at.k_out + 1.0, min(floor(k) + 1.0, at.k_out), k < at.k_out);
}

// The position before k.
fn before(at: Positions, k: f32) -> f32 {
    return select(max(ceil(k) - 1.0, at.start), at.k_out, k > at.k_out);
}

// The position at which a jump from k ends that may go to the whole position x.
fn ends_at(at: Positions, k: f32, x: f32) -> f32 {
    return max(select(x, at.k_end, x > at.k_out), behind(at, k));
}
