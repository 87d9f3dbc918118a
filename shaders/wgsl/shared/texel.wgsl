// What the bits of texels say. volume/src/macrocell.rs and volume/src/regions/code.rs are the same on the CPU.

// Bits of a map's texel that hold the distance to the nearest cell that is not empty.
const MAP_EMPTY: u32 = 0xffu;

// A texel of a macrocell map.
struct MapTexel {
    // 8 bits: cells to the nearest that is not empty.
    empty: u32,
    // 8 bits: that of the homogeneous cube.
    distance: u32,
    // 16 bits: its code, 0..=1.
    code: f32,
}

fn map_texel(texel: u32) -> MapTexel {
    return MapTexel(texel & MAP_EMPTY, (texel >> 8u) & 0xffu, f32(texel >> 16u) * (1.0 / 65535.0));
}

// A texel of a coded brick: a leap, or a density.
struct CodedTexel {
    is_leap: bool,
    // Of a leap: Chebyshev distance, and the slot of its mean.
    distance: u32,
    slot: u32,
    // Else: whether it is an inner guard, and its code, 0..=1.
    is_inner: bool,
    code: f32,
}

// Of a texel as it is read, 0..=1.
fn coded_texel(read: f32) -> CodedTexel {
    let texel = u32(read * 65535.0 + 0.5);
    let is_leap = (texel & 0x8000u) != 0u;
    let is_inner = (texel & 0x8001u) == 1u;
    return CodedTexel(is_leap, (texel >> 7u) & 0xffu, texel & 0x7fu, is_inner, f32(texel >> 1u) * (1.0 / 16383.0));
}
