// How far a ray may go at once. shaders/src/twin/jump.rs is the same on the CPU.

// The first sample that the brick does not own: the first k with k * step >= t_out.
fn first_outside(step: f32, k: f32, t_out: f32) -> f32 {
    var k_out = max(ceil(t_out / step), k + 1.0);
    // The quotient errs by a few units in the last place, the product decides.
    for (var i = 0; i < 2; i++) {
        if k_out > k + 1.0 && (k_out - 1.0) * step >= t_out {
            k_out -= 1.0;
        }
    }
    for (var i = 0; i < 2; i++) {
        if k_out * step < t_out {
            k_out += 1.0;
        }
    }
    return k_out;
}

// Where the ray leaves the cube about `center`; t.
fn leaves(ray: Ray, center: vec3<f32>, half: f32) -> f32 {
    let plane = center + half * sign(ray.direction);
    let t = select((plane - ray.origin) * ray.inverse, vec3(FAR), ray.direction == vec3(0.0));
    return min(min(t.x, t.y), t.z);
}

// The opacity of n samples of opacity alpha: by squaring, as exact as n single ones. What is left of n beyond whole
// numbers is a sum of halves of halves, and taken by square roots; only between levels is there any.
fn opacity_of(alpha: f32, n: f32) -> f32 {
    var clear = 1.0;
    var square = 1.0 - alpha;
    var left = u32(n);
    var root = square;
    var part = n - f32(left);
    while left > 0u {
        clear *= select(1.0, square, (left & 1u) == 1u);
        square *= square;
        left >>= 1u;
    }
    while BORDERS && part > 0.0 {
        root = sqrt(root);
        part *= 2.0;
        clear *= select(1.0, root, part >= 1.0);
        part -= select(0.0, 1.0, part >= 1.0);
    }
    return 1.0 - clear;
}
