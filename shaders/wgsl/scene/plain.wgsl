// A scene without clips, whose rays visit no position but those that bricks own. shaders/src/twin/scene/plain.rs is the
// same on the CPU.

@group(0) @binding(0) var<storage, read> frame_data: FrameUniform;

fn load_frame() -> FrameUniform {
    return frame_data;
}

// What clips leave of what the brick owns.
fn clipped(ray: Ray, owned: Segment) -> Segment {
    return owned;
}

// The place at k steps; index space.
fn place_at(ray: Ray, k: f32) -> vec3<f32> {
    return ray.origin + k * frame.step * ray.direction;
}
