// What the kernels that build macrocell maps share. Distances are capped at 8 bits.
const MAX_CELL_DISTANCE: u32 = 255u;

// (smallest code | largest code << 16) of each cell.
@group(0) @binding(0) var ranges: texture_3d<u32>;
