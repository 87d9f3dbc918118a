// Where next, by a map of macrocells (Krueger & Westermann 2003): over what is empty, and through cubes of one value.
// shaders/src/twin/walk/map.rs is the same on the CPU.
//
// Where slabs matter one is left out iff both of its ends lie in empty cells. So a run of empty positions that follows
// a value is entered by one sample, and one that a value follows is left by going back to its last position.

const HAS_MAP: bool = true;

// The map says what is empty.
override SKIPS: bool;
// The map says which cubes have one value.
override CUBES: bool;

// Of MapTexel's bits.
@group(2) @binding(2) var map: texture_3d<u32>;

struct MapWalk {
    last_cell: vec3<i32>,
    // Voxels of a cell, per axis.
    edge: f32,
    // The first position at which the map may say something new, and whether it is asked at the present one.
    k_look: f32,
    looks: bool,
    // The positions just before were skipped: where the present one is not empty, the last of them must be read.
    has_skipped: bool,
    // The present position lies in an empty cell, and is read all the same; and the one before.
    reads_empty: bool,
    front_is_empty: bool,
}

fn enter_map(k: f32) -> MapWalk {
    let last_cell = vec3<i32>(textureDimensions(map)) - 1;
    return MapWalk(last_cell, f32(1u << brick.cell_shift), k, true, false, false, false);
}

fn ask_map(walk: ptr<function, MapWalk>, p: vec3<f32>, follows: bool) -> Step {
    var step = new_step();
    if (*walk).looks {
        let cell = clamp((vec3<i32>(p) >> vec3(brick.cell_shift)) - brick.cell_lo, vec3(0), (*walk).last_cell);
        let texel = map_texel(textureLoad(map, cell, 0).x);
        let empty = select(0u, texel.empty, SKIPS);
        // Cells know no regions: their samples may need different tables.
        let alike = select(0u, texel.distance, CUBES && !has_flags());
        let is_empty = empty > 0u;
        let is_alike = !is_empty && alike > 0u;
        step.center = (vec3<f32>(cell + brick.cell_lo) + 0.5) * (*walk).edge;
        step.half = (f32(select(max(alike, 1u), empty, is_empty)) - 0.5) * (*walk).edge;
        if TAKES_EMPTY {
            // Nothing there changes the pixel: a run of the code that says so.
            step.is_known = is_empty;
            step.code = neutral_code();
        } else {
            // Both ends of all slabs up to the one that leaves.
            step.is_skip = is_empty && (!ends_beyond() || !follows || (*walk).front_is_empty);
            // The slab that enters what shows starts in the empty.
            step.is_back = !is_empty && (*walk).has_skipped;
            (*walk).reads_empty = is_empty && !step.is_skip;
        }
        step.jumps = step.is_skip || step.is_known;
        step.is_skip = step.is_skip || step.is_back;
        if is_alike && !step.is_back {
            step.code = texel.code;
            step.is_flat = true;
            step.jumps = true;
        }
        step.is_by_map = step.jumps || step.is_back;
        step.is_known = step.is_by_map;
    }
    return step;
}

fn leave_map(walk: ptr<function, MapWalk>, step: Step, k: f32, n: f32, k_exit: f32, shows: bool) {
    // A leap says nothing of its cell, nor does an empty one of the next position where this one is read.
    let is_short = step.is_deep && step.jumps || (*walk).reads_empty;
    let is_asked = (*walk).looks && !step.is_skip;
    (*walk).k_look = select((*walk).k_look, select(k_exit, k + 1.0, is_short), is_asked);
    (*walk).looks = select(k + n >= (*walk).k_look && (CUBES || !shows), !step.is_back, step.is_skip);
    (*walk).has_skipped = ends_beyond() && step.is_skip && !step.is_back;
    (*walk).front_is_empty = (*walk).reads_empty;
    (*walk).reads_empty = step.is_back;
}
