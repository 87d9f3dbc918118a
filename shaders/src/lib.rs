//! The WGSL kernels, their Rust-side layouts, and a CPU twin of every kernel.
//!
//! Kernels are concatenated from `wgsl/` (no module system: under ten kernels need none). A twin has its kernel's
//! files, names and order of operations, so that the two can be read side by side.

#![forbid(unsafe_code)]

pub mod binding;
pub mod interval;
pub mod key;
pub mod layout;
pub mod style;
pub mod twin;

pub use key::{BrickTraits, KernelKey, LookTraits, SlabKind, TakeKind};
pub use layout::{BrickUniform, FrameUniform};
pub use style::StyleUniform;

/// Pixels that a workgroup of [`march_wgsl`] covers, per axis.
pub const WORKGROUP_PIXELS: u32 = 16;

/// How the loop of rays reads volume and transfer function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RaycastVariant {
    /// The adapter's linear filters; needs filterable textures.
    Hardware,
    /// Loads and own interpolation: no 8-bit weights, and textures need not be filterable.
    Exact,
}

macro_rules! parts {
    ($($path:literal),* $(,)?) => { [$(include_str!(concat!("../wgsl/", $path))),*] };
}

/// The loop of rays with the walk and the take of a key; entry point `march`. [`overrides`] are the rest of the key.
#[must_use]
pub fn march_wgsl(variant: RaycastVariant, key: KernelKey) -> String {
    let mut parts = parts![
        "shared/layout.wgsl",
        "shared/ray.wgsl",
        "shared/dispatch.wgsl",
        "shared/holes.wgsl",
        "shared/classify.wgsl",
        "shared/run.wgsl",
        "shared/jump.wgsl",
        "shared/texel.wgsl",
        "march.wgsl",
    ]
    .to_vec();
    parts.extend(match variant {
        RaycastVariant::Hardware => parts!["read/hardware.wgsl"],
        RaycastVariant::Exact => parts!["read/exact.wgsl"],
    });
    parts.extend(if key.borders { parts!["positions/finest.wgsl"] } else { parts!["positions/whole.wgsl"] });
    parts.extend(if key.has_map() { parts!["walk/map.wgsl"] } else { parts!["walk/unmapped.wgsl"] });
    parts.extend(if key.leaps { parts!["walk/leap.wgsl"] } else { parts!["walk/uncoded.wgsl"] });
    match key.take {
        TakeKind::Sampled => parts.extend(parts!["scene/plain.wgsl", "take/sampled.wgsl"]),
        TakeKind::Projection(_) => parts.extend(parts!["scene/styled.wgsl", "take/projection.wgsl"]),
        TakeKind::Slabs(_) => {
            parts.extend(parts!["scene/styled.wgsl", "take/slabs.wgsl"]);
            parts.extend(parts!["shared/slab.wgsl", "shared/light.wgsl", "shared/surface.wgsl"]);
            parts.extend(match variant {
                RaycastVariant::Hardware => parts!["read/slab_hardware.wgsl"],
                RaycastVariant::Exact => parts!["read/slab_exact.wgsl"],
            });
        }
    }
    parts.concat()
}

/// The overrides of [`march_wgsl`] for a key: all that the module has, and no other.
#[must_use]
pub fn overrides(key: KernelKey) -> Vec<(&'static str, f64)> {
    let KernelKey { skips, cubes, regions, holes, take, .. } = key;
    let on = f64::from;
    let mut all =
        vec![("REGIONS", on(regions)), ("HOLES", on(holes)), ("COUNTS_POSITIONS", on(key.counts_positions()))];
    if key.has_map() {
        all.extend([("SKIPS", on(skips)), ("CUBES", on(cubes))]);
    }
    match take {
        TakeKind::Sampled => {}
        TakeKind::Projection(pixel) => all.push(("MODE", f64::from(pixel as u8))),
        TakeKind::Slabs(kind) => all.extend([
            ("PREINTEGRATED", on(kind.preintegrated)),
            ("LIGHT", f64::from(kind.light_number())),
            ("SURFACES", on(kind.surfaces)),
        ]),
    }
    all
}

/// Which macrocells are empty; entry point `macrocell`.
#[must_use]
pub fn macrocell_wgsl() -> String {
    parts!["shared/cells.wgsl", "macrocell.wgsl"].concat()
}

/// One pass of the distance transform over macrocells, along the axis of its override `AXIS`; entry point `distance`.
#[must_use]
pub fn distance_wgsl() -> String {
    parts!["shared/cells.wgsl", "distance.wgsl"].concat()
}

/// The start-up self-test of the adapter's filter; entry point `filter_probe`.
#[must_use]
pub fn filter_probe_wgsl() -> &'static str {
    include_str!("../wgsl/filter_probe.wgsl")
}
