// One pass of the Chebyshev distance transform over macrocells: along one axis the smallest of what lies there, no less
// than how far it lies. Cells outside count as empty. shaders/src/twin/macrocell.rs is the same on the CPU.
override AXIS: u32;

@group(0) @binding(1) var before: texture_3d<u32>;
// Joined to the last pass: bits 8.. of the map's texels, or a single cell of zero.
@group(0) @binding(2) var homogeneous: texture_3d<u32>;
@group(0) @binding(3) var after: texture_storage_3d<r32uint, write>;

@compute @workgroup_size(4, 4, 4)
fn distance(@builtin(global_invocation_id) cell: vec3<u32>) {
    let dims = textureDimensions(ranges);
    if any(cell >= dims) {
        return;
    }
    var along = vec3(0u);
    along[AXIS] = 1u;
    let at = cell[AXIS];
    var best = textureLoad(before, cell, 0).x;
    for (var away = 1u; away < best; away++) {
        if away > at && at + away >= dims[AXIS] {
            break;
        }
        if away <= at {
            best = min(best, max(textureLoad(before, cell - away * along, 0).x, away));
        }
        if at + away < dims[AXIS] {
            best = min(best, max(textureLoad(before, cell + away * along, 0).x, away));
        }
    }
    if AXIS == 2u && all(cell < textureDimensions(homogeneous)) {
        best |= textureLoad(homogeneous, cell, 0).x;
    }
    textureStore(after, cell, vec4(best));
}
