//! What a ray reads, as the kernels find it at module scope; and what it counts.

use brickcast_volume::preintegration::Preintegrated;

use super::ray::Ray;
use super::read::Reader;
use crate::key::KernelKey;
use crate::layout::{BrickUniform, FrameUniform, RegionFlags};
use crate::style::StyleUniform;

/// Group 0: what all bricks of a frame share.
#[derive(Debug, Clone, Copy)]
pub struct SceneData<'a> {
    pub frame: &'a FrameUniform,
    /// [`StyleUniform::PLAIN`] where the scene has none.
    pub style: &'a StyleUniform,
    /// For single samples.
    pub tables: Tables<'a>,
    /// For slabs outside and inside regions, where these are pre-integrated.
    pub slabs: Option<[SlabTable<'a>; 2]>,
}

/// Tables that a ray may read; `region` is for samples in regions.
#[derive(Debug, Clone, Copy)]
pub struct Tables<'a> {
    pub table: &'a [[f32; 4]],
    pub region: Option<&'a [[f32; 4]]>,
}

/// Pre-integrated slabs: by node of the front value, then of the back value.
#[derive(Debug, Clone, Copy)]
pub struct SlabTable<'a> {
    /// Nodes each way.
    pub size: usize,
    /// Premultiplied colour and opacity of one step. With interpolated light, what the front end's light counts for,
    /// and the opacity.
    pub front: &'a [[f32; 4]],
    /// What the back end's light counts for, and the part of the opacity that goes with it; empty without interpolated
    /// light.
    pub back: &'a [[f32; 4]],
    /// [`Preintegrated::shown_before`].
    pub shown_before: &'a [u32],
    /// [`Preintegrated::warp`].
    pub warp: &'a [[f32; 2]],
    /// Blocks of the warp per code (0..=1).
    pub scale: f32,
}

/// Group 2: what a brick holds.
#[derive(Debug, Clone, Copy)]
pub struct BrickData<'a> {
    /// Of the stored box, x fastest.
    pub texels: &'a [u16],
    /// True where texels hold leaps: mean codes (0..=1) by slot.
    pub means: Option<&'a [f32]>,
    /// Macrocell map, x fastest, and its cells per axis.
    pub map: Option<(&'a [u32], [u32; 3])>,
    /// 1 for texels of a region; read where the uniform says so.
    pub flags: &'a [u8],
}

/// All that one brick's rays read.
#[derive(Debug, Clone, Copy)]
pub struct Bindings<'a> {
    pub scene: &'a SceneData<'a>,
    pub brick: &'a BrickUniform,
    pub data: BrickData<'a>,
    /// The kernel's overrides.
    pub key: KernelKey,
}

/// One ray in one brick: what does not change along it.
#[derive(Debug)]
pub struct Along<'a> {
    pub bound: &'a Bindings<'a>,
    pub ray: &'a Ray,
    pub reader: Reader<'a>,
}

/// What a ray took from a brick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// Reads of texels: values, codes and region flags.
    pub samples: u32,
    /// Sample positions integrated; a leap counts all of its.
    pub positions: u32,
    /// Positions that leaps covered.
    pub leapt: u32,
    /// Jumps by the map alone: turns of the loop that read no texel.
    pub skips: u32,
}

impl RayCounts {
    /// Of two rays, or more.
    #[must_use]
    pub const fn plus(self, more: Self) -> Self {
        Self {
            samples: self.samples.saturating_add(more.samples),
            positions: self.positions.saturating_add(more.positions),
            leapt: self.leapt.saturating_add(more.leapt),
            skips: self.skips.saturating_add(more.skips),
        }
    }
}

impl<'a> SlabTable<'a> {
    /// `tables`: front and back, of `slabs`.
    #[must_use]
    pub fn new(slabs: &'a Preintegrated, [front, back]: [&'a [[f32; 4]]; 2]) -> Self {
        let (size, shown_before, warp) = (slabs.size, &slabs.shown_before[..], &slabs.warp[..]);
        // All blocks are 65,536 codes.
        Self { size, front, back, shown_before, warp, scale: warp.len() as f32 * (65535.0 / 65536.0) }
    }
}

impl Bindings<'_> {
    /// Where the brick says of each voxel whether it is in a region.
    #[inline(always)]
    pub(crate) fn has_flags(&self) -> bool {
        self.key.regions && self.brick.region_flags == RegionFlags::Texture as u32
    }
}

impl<'a> Along<'a> {
    #[must_use]
    pub fn new(bound: &'a Bindings<'a>, ray: &'a Ray) -> Self {
        Self { bound, ray, reader: Reader::new(bound.scene.frame, bound.brick, bound.data.texels) }
    }

    #[inline(always)]
    pub(crate) fn frame(&self) -> &'a FrameUniform {
        self.bound.scene.frame
    }

    #[inline(always)]
    pub(crate) fn style(&self) -> &'a StyleUniform {
        self.bound.scene.style
    }
}
