// Uniforms; shaders/src/layout.rs says what the members mean, shaders/tests/layout.rs compares the two.
struct FrameUniform {
    eye: vec3<f32>,
    step: f32,
    ray_forward: vec3<f32>,
    stop_alpha: f32,
    ray_right: vec3<f32>,
    inverse_width: f32,
    ray_up: vec3<f32>,
    inverse_height: f32,
    voxels_per_unit: vec3<f32>,
    parallel: u32,
    width: i32,
    height: i32,
    table_first: f32,
    table_scale: f32,
    fan: vec3<f32>,
    shown: u32,
    region_first: f32,
    region_scale: f32,
    table_last: u32,
    region_last: u32,
    nearest: u32,
    finest: f32,
    weight: f32,
    reserved: u32,
}

struct BrickUniform {
    owned_lo: vec3<i32>,
    accumulator_base: u32,
    owned_hi: vec3<i32>,
    accumulator_stride: u32,
    stored_lo: vec3<i32>,
    counter: u32,
    stored_dims: vec3<u32>,
    region_flags: u32,
    rect_lo: vec2<u32>,
    rect_size: vec2<u32>,
    cell_lo: vec3<i32>,
    cell_shift: u32,
    code_scale: f32,
    holes: u32,
    borders: u32,
    reserved: u32,
}

// FrameUniform.shown: samples outside regions, in regions.
const SHOWS_RESIDUAL: u32 = 1u;
const SHOWS_REGIONS: u32 = 2u;
// BrickUniform.region_flags: every voxel is in a region, or a texture says which are.
const FLAGS_EVERY_VOXEL: u32 = 1u;
const FLAGS_TEXTURE: u32 = 2u;
