// The transfer function for single samples: by loads and own interpolation, in the form a + (b - a) t, which returns
// equal ends unchanged. shaders/src/twin/classify.rs is the same on the CPU.
//
// There may be an entry for every code, more than a line of texels holds, and a filter's weights
// would tell apart no more than 256 places between two of them.
@group(0) @binding(1) var table: texture_2d<f32>;
@group(0) @binding(3) var region_table: texture_2d<f32>;

// Entries to a row, at most (node/src/gpu/tables.rs).
const TABLE_ROW: u32 = 1024u;

fn entry_at(entries: texture_2d<f32>, i: u32) -> vec4<f32> {
    return textureLoad(entries, vec2(i % TABLE_ROW, i / TABLE_ROW), 0);
}

fn classified(entries: texture_2d<f32>, first: f32, scale: f32, last: u32, code: f32) -> vec4<f32> {
    let entry = clamp((code - first) * scale, 0.0, f32(last));
    let i = min(u32(entry), last - 1u);
    let a = entry_at(entries, i);
    let b = entry_at(entries, i + 1u);
    return a + (b - a) * (entry - f32(i));
}

// Straight colour and opacity of one step.
fn classify(in_region: bool, code: f32) -> vec4<f32> {
    if REGIONS && in_region {
        return classified(region_table, frame.region_first, frame.region_scale, frame.region_last, code);
    }
    return classified(table, frame.table_first, frame.table_scale, frame.table_last, code);
}

// Does the view show samples of this kind?
fn is_shown(in_region: bool) -> bool {
    return !REGIONS || (frame.shown & select(SHOWS_RESIDUAL, SHOWS_REGIONS, in_region)) != 0u;
}
