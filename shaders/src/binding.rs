//! The numbers by which pipelines bind what kernels read; `tests/shaders/layout.rs` compares them with the WGSL's.

/// Where a kernel finds something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binding {
    pub group: u32,
    pub number: u32,
    /// Names of it in the WGSL.
    pub names: &'static [&'static str],
}

macro_rules! bindings {
    ($($(#[$doc:meta])* $constant:ident = $group:literal, $number:literal: $($name:literal)*;)*) => {
        $($(#[$doc])* pub const $constant: Binding =
            Binding { group: $group, number: $number, names: &[$($name),*] };)*
        /// All that the loop of rays may bind.
        pub const MARCH: &[Binding] = &[$($constant),*];
    };
}

bindings! {
    /// The frame's uniform; that of the style behind it where there is one.
    SCENE = 0, 0: "frame_data" "scene_data";
    /// The transfer function of single samples.
    TABLE = 0, 1: "table";
    /// Linear between texels, clamped at the edge; in the hardware variant only.
    SAMPLER = 0, 2: "linear_clamped";
    /// As [`TABLE`], in regions.
    REGION_TABLE = 0, 3: "region_table";
    /// Slabs: what the front end's light counts for, or all of it.
    SLAB_FRONT = 0, 5: "slab_front";
    /// What the back end's light counts for.
    SLAB_BACK = 0, 6: "slab_back";
    /// As [`SLAB_FRONT`], in regions.
    REGION_SLAB_FRONT = 0, 7: "region_slab_front";
    /// As [`SLAB_BACK`], in regions.
    REGION_SLAB_BACK = 0, 8: "region_slab_back";
    /// Where codes stand among the nodes of slabs.
    WARP = 0, 9: "warp";
    /// As [`WARP`], in regions.
    REGION_WARP = 0, 10: "region_warp";
    /// One dispatch's uniform.
    BRICK = 1, 0: "brick_data";
    /// Pixels.
    ACCUMULATOR = 1, 1: "accumulator";
    /// Four for each dispatch.
    COUNTERS = 1, 2: "counters";
    /// The brick's texels.
    VOLUME = 2, 0: "volume";
    /// Means of regions by slot.
    MEANS = 2, 1: "means";
    /// The map of macrocells.
    MAP = 2, 2: "map";
    /// 1 for texels of a region.
    FLAGS = 2, 3: "flags";
}
