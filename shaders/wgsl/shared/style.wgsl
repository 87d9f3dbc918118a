// What a scene's style is to the integral kernel; shaders/src/style.rs says what the members mean.
struct StyleUniform {
    volume_hi: vec3<i32>,
    surface_count: u32,
    light: vec3<f32>,
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    plane_count: u32,
    light_from: f32,
    reserved: array<u32, 3>,
    codes: array<vec4<f32>, 8>,
    colors: array<vec4<f32>, 8>,
    planes: array<vec4<f32>, 12>,
}

// The other kernels bind its beginning: not all adapters have a buffer to spare.
struct SceneUniform {
    frame: FrameUniform,
    style: StyleUniform,
}

@group(0) @binding(0) var<storage, read> scene_data: SceneUniform;

fn load_frame() -> FrameUniform {
    return scene_data.frame;
}

// Slabs by node of the back value (x) and of the front value (y): premultiplied colour and opacity of one step. With
// interpolated light the first is the front end's, with the whole opacity, the second the back end's, with its part of
// it.
@group(0) @binding(5) var slab_front: texture_2d<f32>;
@group(0) @binding(6) var slab_back: texture_2d<f32>;
// The same for slabs in regions.
@group(0) @binding(7) var region_slab_front: texture_2d<f32>;
@group(0) @binding(8) var region_slab_back: texture_2d<f32>;
// By block of codes: the node coordinate at its start (r), and what it grows by to its end (g).
@group(0) @binding(9) var warp: texture_2d<f32>;
@group(0) @binding(10) var region_warp: texture_2d<f32>;
