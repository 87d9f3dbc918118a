// What the loop of rays binds, and which pixel is whose: one invocation a pixel. Storage, not uniform buffers:
// lavapipe compiles a kernel anew for the values of uniforms that its branches depend on, again and again for other
// bricks and views.
@group(1) @binding(0) var<storage, read> brick_data: BrickUniform;
// Copies: read once, not in loops.
var<private> frame: FrameUniform;
var<private> brick: BrickUniform;
// Premultiplied colour and opacity.
@group(1) @binding(1) var<storage, read_write> accumulator: array<vec4<f32>>;
// COUNTERS for each dispatch: reads of texels, positions, positions leapt, jumps that read none.
@group(1) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;

const COUNTERS: u32 = 4u;
const COUNT_READS: u32 = 0u;
const COUNT_TAKEN: u32 = 1u;
const COUNT_LEAPT: u32 = 2u;
const COUNT_JUMPS: u32 = 3u;

fn load_uniforms() {
    frame = load_frame();
    brick = brick_data;
}

// Pixels that a workgroup covers, per axis.
const WORKGROUP_PIXELS: u32 = 16u;

// Adds to one of a dispatch's counters.
fn count(which: u32, number: f32) {
    atomicAdd(&counters[COUNTERS * brick.counter + which], u32(number));
}

// Neighbouring lanes are neighbouring pixels: 4 x 2 for every 8 lanes, 8 x 8 for every 64, 16 x 16 for the workgroup.
// Rays that end together then run together.
fn pixel_of_lane(lane: vec2<u32>) -> vec2<u32> {
    let x = (lane.x & 3u) | ((lane.x >> 1u) & 4u);
    let y = ((lane.x >> 2u) & 1u) | ((lane.x >> 3u) & 6u);
    return vec2(x, y) + 8u * vec2(lane.y & 1u, lane.y >> 1u);
}
