//! Uniforms as both sides see them. `tests/layout.rs` compares names and offsets with the WGSL's.

use brickcast_volume::scene::{Filter, RegionView};
use brickcast_volume::transfer_function::TransferTable;
use brickcast_volume::visibility::KernelView;
use brickcast_volume::{OwnedBox, StoredBox};
use bytemuck::{Pod, Zeroable};
use glam::IVec3;

/// An accumulated opacity that no ray reaches: early termination switched off.
pub const NEVER: f32 = 2.0;

/// What all bricks of a frame share. Lengths along rays are in units of the smallest spacing, positions in global index
/// space.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FrameUniform {
    /// Where the ray through the picture's middle starts: the eye, or a whole number of steps from it.
    pub eye: [f32; 3],
    /// Delta: sample k lies at `t = k * step`, both counted from where rays start.
    pub step: f32,
    pub ray_forward: [f32; 3],
    /// Rays stop at this accumulated opacity; [`NEVER`] where early termination is off.
    pub stop_alpha: f32,
    pub ray_right: [f32; 3],
    pub inverse_width: f32,
    pub ray_up: [f32; 3],
    pub inverse_height: f32,
    pub voxels_per_unit: [f32; 3],
    /// 1 for parallel rays.
    pub parallel: u32,
    pub width: i32,
    pub height: i32,
    /// Code (0..=1) of the table's first entry.
    pub table_first: f32,
    /// Entries per code: `(entries - 1) / (c_last - c_first)`.
    pub table_scale: f32,
    /// How far apart rays start: see `KernelView`.
    pub fan: [f32; 3],
    /// Bit 0: samples outside regions are shown, bit 1: samples in regions are.
    pub shown: u32,
    /// As `table_first` and `table_scale` of the table for samples in regions; where there is none, the first table's.
    pub region_first: f32,
    pub region_scale: f32,
    /// The last entry of either table.
    pub table_last: u32,
    pub region_last: u32,
    /// 1: values are those of the nearest voxel, never between.
    pub nearest: u32,
    /// Of a step, the part by which positions may open and end a brick where levels meet: a power of two, 1 at most.
    pub finest: f32,
    /// What a position counts in a mean: the finest positions of the volume for which it stands, a power of two.
    pub weight: f32,
    pub reserved: u32,
}

/// [`FrameUniform::shown`] for samples outside regions.
pub const SHOWS_RESIDUAL: u32 = 1;
/// [`FrameUniform::shown`] for samples in regions.
pub const SHOWS_REGIONS: u32 = 2;

/// Entries of a transfer function's texture to a row, at most: no adapter takes all of them in one.
pub const TABLE_ROW: u32 = 1024;

/// What each dispatch counts, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Counter {
    /// Reads of texels.
    Reads = 0,
    /// Positions, where [`KernelKey::counts_positions`](crate::KernelKey::counts_positions); else reads are.
    Taken = 1,
    /// Positions that leaps covered.
    Leapt = 2,
    /// Jumps by the map alone.
    Jumps = 3,
}

/// Counters of a dispatch, u32 each.
pub const COUNTERS: u32 = 4;

/// Where a brick's region flags are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RegionFlags {
    NoVoxel = 0,
    EveryVoxel = 1,
    Texture = 2,
}

/// Multiplies a plain texel (0..=1): it is the code itself.
pub const PLAIN_SCALE: f32 = 1.0;
/// Multiplies a texel of leaps and densities (0..=1): 14 bits of density above the inner bit.
pub const CODED_SCALE: f32 = 65535.0 / 32766.0;

/// One brick's dispatch over the pixels of one rectangle.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BrickUniform {
    /// Voxels that the brick integrates, global, half-open.
    pub owned_lo: [i32; 3],
    /// Index of the rectangle's first pixel in the accumulator.
    pub accumulator_base: u32,
    pub owned_hi: [i32; 3],
    /// Pixels from one accumulator row to the next.
    pub accumulator_stride: u32,
    /// First voxel of the texture, global; beyond the volume's edge voxels repeat the edge.
    pub stored_lo: [i32; 3],
    /// Which counter takes the samples.
    pub counter: u32,
    /// Voxels of the texture.
    pub stored_dims: [u32; 3],
    /// A [`RegionFlags`].
    pub region_flags: u32,
    /// Pixels `[rect_lo, rect_lo + rect_size)`.
    pub rect_lo: [u32; 2],
    pub rect_size: [u32; 2],
    /// First macrocell of the map, in cells of the global grid.
    pub cell_lo: [i32; 3],
    /// Binary logarithm of the voxels per edge of a macrocell.
    pub cell_shift: u32,
    /// Code of a texel of 1: [`PLAIN_SCALE`] or [`CODED_SCALE`].
    pub code_scale: f32,
    /// 1 where texels of code 0 hold no data.
    pub holes: u32,
    /// Where another level draws: a bit for each of the 27 places around the brick and itself, x fastest, from -1 to 1
    /// on every axis.
    pub borders: u32,
    pub reserved: u32,
}

impl FrameUniform {
    /// `early_termination` in (0, 1]; 1 switches it off: not even rays of opacity 1 stop.
    #[must_use]
    pub fn new(view: &KernelView, table: &TransferTable, early_termination: f32) -> Self {
        let last = table.entries.len().saturating_sub(1) as u32;
        Self {
            eye: view.eye.into(),
            step: view.step,
            ray_forward: view.ray_forward.into(),
            stop_alpha: if early_termination < 1.0 { early_termination } else { NEVER },
            ray_right: view.ray_right.into(),
            inverse_width: 1.0 / view.width as f32,
            ray_up: view.ray_up.into(),
            inverse_height: 1.0 / view.height as f32,
            voxels_per_unit: view.voxels_per_unit.into(),
            parallel: u32::from(view.parallel),
            width: view.width as i32,
            height: view.height as i32,
            table_first: table.c_first,
            table_scale: table.scale(),
            fan: view.fan.into(),
            shown: SHOWS_RESIDUAL | SHOWS_REGIONS,
            region_first: table.c_first,
            region_scale: table.scale(),
            table_last: last,
            region_last: last,
            nearest: 0,
            finest: 1.0,
            weight: 1.0,
            reserved: 0,
        }
    }

    /// With values read as `filter` says, as far as that is the kernels' business and not their variant's.
    #[must_use]
    pub const fn with_filter(mut self, filter: Filter) -> Self {
        self.nearest = matches!(filter, Filter::Nearest) as u32;
        self
    }

    /// Of one of several levels: where bricks meet those of others, positions are counted in `finest` parts of a step;
    /// each counts as `weight` of the finest ones.
    #[must_use]
    pub const fn of_level(mut self, finest: f32, weight: f32) -> Self {
        (self.finest, self.weight) = (finest, weight);
        self
    }

    /// With what it shows of regions, and by which table.
    #[must_use]
    pub fn with_regions(mut self, view: RegionView, table: Option<&TransferTable>) -> Self {
        self.shown = match view {
            RegionView::All => SHOWS_RESIDUAL | SHOWS_REGIONS,
            RegionView::Regions => SHOWS_REGIONS,
            RegionView::Residual => SHOWS_RESIDUAL,
        };
        if let Some(table) = table {
            self.region_first = table.c_first;
            self.region_scale = table.scale();
            self.region_last = table.entries.len().saturating_sub(1) as u32;
        }
        self
    }
}

impl BrickUniform {
    /// With `bounds`, a part of its owned box, in place of that.
    #[must_use]
    pub fn within(mut self, bounds: &OwnedBox) -> Self {
        (self.owned_lo, self.owned_hi) = (bounds.lo.as_ivec3().into(), bounds.hi.as_ivec3().into());
        self
    }

    /// The voxels that it integrates.
    #[must_use]
    pub fn owned(&self) -> OwnedBox {
        OwnedBox { lo: IVec3::from(self.owned_lo).as_uvec3(), hi: IVec3::from(self.owned_hi).as_uvec3() }
    }

    /// The brick's boxes; rectangle, accumulator and counter still zero.
    #[must_use]
    pub fn of_boxes(owned: &OwnedBox, stored: &StoredBox) -> Self {
        Self {
            owned_lo: owned.lo.as_ivec3().into(),
            owned_hi: owned.hi.as_ivec3().into(),
            stored_lo: stored.lo.into(),
            stored_dims: stored.dims().into(),
            code_scale: PLAIN_SCALE,
            ..Self::zeroed()
        }
    }
}
