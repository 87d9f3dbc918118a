//! Which kernel a brick takes in a scene: the one place where that is decided, for both backends, tests and counters.

use brickcast_volume::PixelKind;
use brickcast_volume::style::{Lighting, Style};

/// What a run of positions adds to a pixel: a file of `wgsl/take/`, and what of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TakeKind {
    /// Single samples, colours as they are.
    #[default]
    Sampled,
    /// What lies between samples, and all that is lit or clipped.
    Slabs(SlabKind),
    /// Codes, joined as pixels of this kind are.
    Projection(PixelKind),
}

/// What of slabs a scene takes; each costs something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SlabKind {
    /// Slabs come from a table over both of their ends, else they are single samples.
    pub preintegrated: bool,
    pub light: Option<Lighting>,
    /// There are isosurfaces.
    pub surfaces: bool,
}

impl SlabKind {
    /// The kernel's `LIGHT`: 0 without light, else one more than the lighting's place among its kind; named in
    /// `slab.wgsl`.
    #[must_use]
    pub const fn light_number(self) -> u32 {
        match self.light {
            None => 0,
            Some(lighting) => lighting as u32 + 1,
        }
    }

    /// True where slabs come from two tables, weighted by either end.
    #[must_use]
    pub const fn has_weights(self) -> bool {
        match self.light {
            None => false,
            Some(lighting) => lighting.needs_weights(),
        }
    }
}

impl TakeKind {
    #[must_use]
    pub fn of(style: &Style) -> Self {
        let pixel = style.mode.pixel_kind();
        if style.is_plain() {
            Self::Sampled
        } else if pixel.is_projection() {
            Self::Projection(pixel)
        } else {
            Self::Slabs(SlabKind {
                preintegrated: style.integrates_slabs(),
                light: style.shading.map(|phong| phong.lighting),
                surfaces: !style.surfaces.is_empty(),
            })
        }
    }

    /// What it leaves in the accumulator.
    #[must_use]
    pub const fn pixel_kind(self) -> PixelKind {
        match self {
            Self::Sampled | Self::Slabs(_) => PixelKind::Over,
            Self::Projection(pixel) => pixel,
        }
    }

    #[must_use]
    pub const fn is_projection(self) -> bool {
        matches!(self, Self::Projection(_))
    }

    /// True where a brick also visits the first position beyond its own: the one that its last slab ends at.
    #[must_use]
    pub const fn ends_beyond(self) -> bool {
        matches!(self, Self::Slabs(kind) if kind.preintegrated || kind.surfaces)
    }

    /// What of slabs; nothing for all that has none.
    #[must_use]
    pub const fn slab_kind(self) -> SlabKind {
        match self {
            Self::Slabs(kind) => kind,
            Self::Sampled | Self::Projection(_) => SlabKind { preintegrated: false, light: None, surfaces: false },
        }
    }
}

/// What of a scene says which kernel its bricks take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LookTraits {
    pub take: TakeKind,
    /// It matters which samples are in regions.
    pub tells_regions_apart: bool,
}

/// What of a brick, as a backend has it and the scene sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrickTraits {
    /// Texels hold leaps.
    pub leaps: bool,
    /// Some voxels hold no data.
    pub holes: bool,
    /// It has macrocells, and the scene skips what is empty.
    pub may_skip: bool,
    /// Enough of them are empty for a map that says nothing else.
    pub skipping_pays: bool,
    /// It has macrocells that are leapt through where they are of nearly one value.
    pub cubes: bool,
    /// Another level is drawn next to it.
    pub borders: bool,
}

/// Which kernel a brick takes in a scene; what it can do beyond sampling costs something, so each brick gets the one
/// that does what it needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct KernelKey {
    /// The map says what is empty, and that is skipped.
    pub skips: bool,
    /// The map says which cubes have one value, and these are leapt through.
    pub cubes: bool,
    /// Texels hold leaps.
    pub leaps: bool,
    /// Samples in regions are hidden, shown alone, or have a table of their own.
    pub regions: bool,
    /// Some voxels hold no data.
    pub holes: bool,
    /// Runs begin and end where those of other levels do.
    pub borders: bool,
    pub take: TakeKind,
}

impl KernelKey {
    /// Nothing but samples, one after the other.
    pub const PLAIN: Self = Self {
        skips: false,
        cubes: false,
        leaps: false,
        regions: false,
        holes: false,
        borders: false,
        take: TakeKind::Sampled,
    };

    #[must_use]
    pub const fn of(look: LookTraits, brick: BrickTraits) -> Self {
        // Where the map is asked anyway, all that it says is heard.
        let skips = brick.may_skip && (brick.skipping_pays || brick.cubes);
        Self {
            // In a projection what is skipped counts as samples of no weight; a place without data is no sample.
            skips: skips && !(brick.holes && look.take.is_projection()),
            cubes: brick.cubes,
            leaps: brick.leaps,
            regions: look.tells_regions_apart,
            holes: brick.holes,
            // An extreme does not ask how long a run is.
            borders: brick.borders && !look.take.is_projection(),
            take: look.take,
        }
    }

    /// There is a map to ask.
    #[must_use]
    pub const fn has_map(self) -> bool {
        self.skips || self.cubes
    }

    /// False where each position is one read: the kernel then counts reads only.
    #[must_use]
    pub const fn counts_positions(self) -> bool {
        self.leaps || self.cubes || self.regions || self.borders || !matches!(self.take, TakeKind::Sampled)
    }
}
