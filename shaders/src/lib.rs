//! The WGSL kernels, their Rust-side layouts, and a CPU twin of every kernel.
//!
//! Kernels are concatenated from `wgsl/` (no module system: under ten kernels need none). A twin has its kernel's name
//! and order of operations, so that the two can be read side by side.

pub mod key;
pub mod layout;
pub mod style;
pub mod twin;

pub use key::{BrickTraits, KernelKey, LookTraits, SlabKind, TakeKind};
pub use layout::{BrickUniform, FrameUniform};
pub use style::StyleUniform;

/// Pixels that a workgroup of the raycast kernel covers, per axis.
pub const WORKGROUP_PIXELS: u32 = 16;

/// How the raycast kernel reads volume and transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RaycastVariant {
    /// The adapter's linear filters; needs filterable textures.
    Hardware,
    /// Loads and own interpolation: no 8-bit weights, and textures need not be filterable.
    Exact,
}

/// The kernel that only samples; entry point `raycast`.
#[must_use]
pub fn raycast_wgsl(variant: RaycastVariant) -> String {
    with_shared(variant, &[include_str!("../wgsl/shared/frame.wgsl"), include_str!("../wgsl/raycast.wgsl")].concat())
}

/// The kernel that also leaps, skips, tells regions apart and knows voxels without data, as its overrides `LEAP`,
/// `MAP`, `REGIONS` and `HOLES` say; entry point `accelerated`.
#[must_use]
pub fn accelerated_wgsl(variant: RaycastVariant) -> String {
    with_shared(
        variant,
        &[
            include_str!("../wgsl/shared/frame.wgsl"),
            include_str!("../wgsl/shared/jump.wgsl"),
            include_str!("../wgsl/shared/texel.wgsl"),
            include_str!("../wgsl/accelerated.wgsl"),
        ]
        .concat(),
    )
}

/// The kernel that integrates between samples, lights, finds isosurfaces, projects and clips, as its overrides say
/// (those of [`accelerated_wgsl`], and `PREINTEGRATED`, `LIGHT`, `SURFACES`, `MODE`); entry point `integral`.
#[must_use]
pub fn integral_wgsl(variant: RaycastVariant) -> String {
    let slab = match variant {
        RaycastVariant::Hardware => include_str!("../wgsl/shared/slab_hardware.wgsl"),
        RaycastVariant::Exact => include_str!("../wgsl/shared/slab_exact.wgsl"),
    };
    let (style, light) = (include_str!("../wgsl/shared/style.wgsl"), include_str!("../wgsl/shared/light.wgsl"));
    let (jump, texel) = (include_str!("../wgsl/shared/jump.wgsl"), include_str!("../wgsl/shared/texel.wgsl"));
    let (between, surface) = (include_str!("../wgsl/shared/slab.wgsl"), include_str!("../wgsl/shared/surface.wgsl"));
    let kernel = include_str!("../wgsl/integral.wgsl");
    let shared = with_shared(variant, kernel);
    [&shared, style, jump, texel, slab, light, between, surface].concat()
}

fn with_shared(variant: RaycastVariant, kernel: &str) -> String {
    let read = match variant {
        RaycastVariant::Hardware => include_str!("../wgsl/shared/read_hardware.wgsl"),
        RaycastVariant::Exact => include_str!("../wgsl/shared/read_exact.wgsl"),
    };
    let holes = include_str!("../wgsl/shared/holes.wgsl");
    let (layout, ray) = (include_str!("../wgsl/shared/layout.wgsl"), include_str!("../wgsl/shared/ray.wgsl"));
    let (dispatch, classify) =
        (include_str!("../wgsl/shared/dispatch.wgsl"), include_str!("../wgsl/shared/classify.wgsl"));
    [layout, ray, dispatch, holes, read, classify, kernel].concat()
}

/// Which macrocells are empty; entry point `macrocell`.
#[must_use]
pub fn macrocell_wgsl() -> String {
    [include_str!("../wgsl/shared/cells.wgsl"), include_str!("../wgsl/macrocell.wgsl")].concat()
}

/// One pass of the distance transform over macrocells, along the axis of its override `AXIS`; entry point `distance`.
#[must_use]
pub fn distance_wgsl() -> String {
    [include_str!("../wgsl/shared/cells.wgsl"), include_str!("../wgsl/distance.wgsl")].concat()
}

/// The start-up self-test of the adapter's filter; entry point `filter_probe`.
#[must_use]
pub fn filter_probe_wgsl() -> &'static str {
    include_str!("../wgsl/filter_probe.wgsl")
}
