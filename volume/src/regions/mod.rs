//! Regions: connected voxels of nearly one value (Frey & Ertl 2009), which rays leap through.
//!
//! The invariant that everything here serves (`docs/adr/0002-leaping.md`): the accelerated picture *is* the plain
//! raycast of the flattened volume V', in which each voxel of a region has the region's mean and every other voxel its
//! own value. V' is fixed when the store is made; bricks, nodes, steps and entry points change nothing of it.

pub(crate) mod block;
pub(crate) mod bound;
pub mod code;
pub(crate) mod components;
pub(crate) mod distance;
mod drawn;
pub(crate) mod flood;
pub(crate) mod given;
mod reach;
pub(crate) mod runs;
mod spans;
mod table;
mod texels;
pub(crate) mod windows;

pub use code::{Density, density_of_code, guard_width};
pub use drawn::{Drawn, SceneTables, drawn, longest_chord};
pub use flood::MAX_FLOOD_VOXELS;
pub use reach::within_reach;
pub use spans::{CodeSpans, INNER_BIT, code_spans, codes_of_region};
pub use table::{BrickFacts, BrickRegions, MAX_REGIONS, NO_REGION, Region, RegionTable};
pub use texels::{RegionTexels, RegionTexelsError, region_texels};
pub use windows::{Windows, window_width};
