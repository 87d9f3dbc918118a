// Which macrocells are empty; shaders/src/twin/macrocell.rs is the same on the CPU.
// By code, 256 to a row: (opaque entries before the first that it may read, those up to the last).
@group(0) @binding(1) var counts: texture_2d<u32>;
@group(0) @binding(2) var occupancy: texture_storage_3d<r32uint, write>;

fn counts_of(code: u32) -> vec2<u32> {
    return textureLoad(counts, vec2(code & 255u, code >> 8u), 0).xy;
}

@compute @workgroup_size(4, 4, 4)
fn macrocell(@builtin(global_invocation_id) cell: vec3<u32>) {
    if any(cell >= textureDimensions(ranges)) {
        return;
    }
    let range = textureLoad(ranges, cell, 0).x;
    // The first above the second: nothing there holds data.
    let lacks_data = (range & 0xffffu) > (range >> 16u);
    let is_empty = lacks_data || counts_of(range >> 16u).y == counts_of(range & 0xffffu).x;
    textureStore(occupancy, cell, vec4(select(0u, MAX_CELL_DISTANCE, is_empty)));
}
