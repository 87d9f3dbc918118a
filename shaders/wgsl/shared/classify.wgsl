// The transfer function for single samples: by loads and own interpolation, in the form a + (b - a) t, which returns
// equal ends unchanged. There may be an entry for every code, more than a line of texels holds, and a filter's weights
// would tell apart no more than 256 places between two of them.
@group(0) @binding(1) var table: texture_2d<f32>;
@group(0) @binding(3) var region_table: texture_2d<f32>;

fn entry_at(entries: texture_2d<f32>, i: u32) -> vec4<f32> {
    // 1,024 to a row (tables.rs).
    return textureLoad(entries, vec2(i & 1023u, i >> 10u), 0);
}

fn classified(entries: texture_2d<f32>, first: f32, scale: f32, last: u32, code: f32) -> vec4<f32> {
    let entry = clamp((code - first) * scale, 0.0, f32(last));
    let i = min(u32(entry), last - 1u);
    let a = entry_at(entries, i);
    let b = entry_at(entries, i + 1u);
    return a + (b - a) * (entry - f32(i));
}

// Straight colour and opacity of one step.
fn classify(reader: Reader, frame: FrameUniform, code: f32) -> vec4<f32> {
    return classified(table, frame.table_first, frame.table_scale, frame.table_last, code);
}

// The same by the table for samples in regions.
fn classify_region(reader: Reader, frame: FrameUniform, code: f32) -> vec4<f32> {
    return classified(region_table, frame.region_first, frame.region_scale, frame.region_last, code);
}
