//! A frame as a kernel sees it.

use std::sync::Arc;

use brickcast_shaders::twin::bindings::{SceneData, Tables};
use brickcast_shaders::{FrameUniform, LookTraits, StyleUniform, TakeKind};
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::scene::{Filter, RegionView};
use brickcast_volume::transfer_function::TransferTable;
use brickcast_volume::{PixelKind, View};

use super::occupied::Occupied;
use super::style::KernelStyle;

/// What a kernel needs to know of a frame.
#[derive(Debug, Clone)]
pub struct KernelScene {
    pub view: View,
    pub table: Arc<TransferTable>,
    /// In (0, 1]; 1 is off.
    pub early_termination: f32,
    pub filter: Filter,
    /// Use the macrocells of bricks that have them. What a brick leaps through is its recipe's business.
    pub skip_empty: bool,
    /// Bricks without region flags (see [`Recipe::region_flags`](super::recipe::Recipe::region_flags)) count as free of
    /// regions.
    pub region_view: RegionView,
    /// For samples whose nearest voxel is in a region.
    pub region_table: Option<Arc<TransferTable>>,
    /// What the plain kernels do not do; none where the scene asks for nothing of it.
    pub style: Option<KernelStyle>,
    /// As [`FrameUniform::finest`]: 1 where no brick meets another level.
    pub finest: f32,
    /// As [`FrameUniform::weight`]: 1 where one level is drawn.
    pub weight: f32,
}

impl KernelScene {
    /// Without skipping, and regions like all else.
    #[must_use]
    pub fn plain(view: View, table: Arc<TransferTable>, early_termination: f32, filter: Filter) -> Self {
        let (skip_empty, region_view, region_table, style) = (false, RegionView::All, None, None);
        let (finest, weight) = (1.0, 1.0);
        Self { view, table, early_termination, filter, skip_empty, region_view, region_table, style, finest, weight }
    }

    /// What is left in accumulators.
    #[must_use]
    pub fn pixel_kind(&self) -> PixelKind {
        self.take().pixel_kind()
    }

    /// What its rays add to their pixels.
    #[must_use]
    pub fn take(&self) -> TakeKind {
        self.style.as_ref().map_or(TakeKind::Sampled, |style| style.take)
    }

    /// What of it says which kernel a brick takes.
    #[must_use]
    pub fn look(&self) -> LookTraits {
        LookTraits { take: self.take(), tells_regions_apart: self.tells_regions_apart() }
    }

    /// The uniform of the frame.
    #[must_use]
    pub fn frame_uniform(&self) -> FrameUniform {
        let stop = if self.pixel_kind().may_end_early() { self.early_termination } else { 1.0 };
        FrameUniform::new(&self.view.kernel(), &self.table, stop)
            .with_regions(self.region_view, self.region_table.as_deref())
            .with_filter(self.filter)
            .of_level(self.finest, self.weight)
    }

    /// What rays on the processor read of it.
    pub(crate) fn data<'a>(&'a self, frame: &'a FrameUniform) -> SceneData<'a> {
        let style = self.style.as_ref();
        let region = self.region_table.as_ref().map(|table| &table.entries[..]);
        SceneData {
            frame,
            style: style.map_or(&StyleUniform::PLAIN, |style| &style.uniform),
            tables: Tables { table: &self.table.entries, region },
            slabs: style.and_then(KernelStyle::slab_tables),
        }
    }

    /// The box to which rays are clipped in a brick, and whether empty-space skipping pays within it. The box is the
    /// part of `owned` that holds all samples and slabs that show, where all that is not empty lies in `occupied`: a
    /// slab that shows starts or ends there. For a projection it is all of `owned`: every sample counts.
    pub(crate) fn bounds(&self, occupied: Occupied, owned: &OwnedBox) -> (OwnedBox, bool) {
        let Occupied { bounds, skips, skips_uncut } = occupied;
        if self.pixel_kind().is_projection() {
            return (*owned, skips_uncut);
        }
        if bounds.voxel_count() == 0 {
            return (OwnedBox { lo: owned.lo, hi: owned.lo }, skips);
        }
        let reach = glam::UVec3::splat(self.style.as_ref().map_or(0, |style| style.reach));
        let lo = bounds.lo.saturating_sub(reach).max(owned.lo);
        (OwnedBox { lo, hi: (bounds.hi + reach).min(owned.hi).max(lo) }, skips)
    }

    /// True where it matters which samples are in regions.
    #[must_use]
    pub fn tells_regions_apart(&self) -> bool {
        self.region_view != RegionView::All || self.region_table.is_some()
    }
}
