//! What a scene's style is to the kernels.

use std::sync::Arc;

use brickcast_shaders::twin::bindings::SlabTable;
use brickcast_shaders::{StyleUniform, TakeKind};
use brickcast_volume::Geometry;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::style::Style;

/// Everything of the style that both backends need.
#[derive(Debug, Clone)]
pub struct KernelStyle {
    pub uniform: StyleUniform,
    pub take: TakeKind,
    /// For slabs outside and inside regions, where slabs are pre-integrated; with light tables where light is
    /// interpolated.
    pub slabs: Option<[Arc<Preintegrated>; 2]>,
    /// As [`Style::reach`].
    pub reach: u32,
    /// The first of [`Style::surface_codes`].
    pub lowest_surface: Option<u16>,
}

impl KernelStyle {
    /// `None` where the plain kernels do. `range`: data units of codes 0 and 1; `slabs` where
    /// [`Style::integrates_slabs`].
    #[must_use]
    pub fn new(
        style: &Style,
        step: f64,
        geometry: &Geometry,
        range: (f64, f64),
        slabs: Option<[Arc<Preintegrated>; 2]>,
    ) -> Option<Self> {
        if style.is_plain() {
            return None;
        }
        Some(Self {
            uniform: StyleUniform::new(style, geometry, range),
            take: TakeKind::of(style),
            slabs,
            reach: style.reach(step),
            lowest_surface: style.surface_codes(range).first().copied(),
        })
    }

    /// For slabs outside and inside regions.
    pub(crate) fn slab_tables(&self) -> Option<[SlabTable<'_>; 2]> {
        self.slabs.as_ref().map(|kinds| kinds.each_ref().map(|s| SlabTable::new(s, self.slab_entries(s))))
    }

    /// The one or two tables that the kernel reads of `slabs`.
    pub(crate) fn slab_entries<'a>(&self, slabs: &'a Preintegrated) -> [&'a [[f32; 4]]; 2] {
        match &slabs.lit {
            Some(lit) if self.take.slab_kind().has_weights() => [&lit.front, &lit.back],
            _ => [&slabs.total, &[]],
        }
    }
}
