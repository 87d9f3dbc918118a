//! How exactly and how fast a picture is drawn.

use super::error::SceneError;
use crate::pixel::PixelKind;
use crate::visibility::PictureSize;
use crate::words::words;

pub use crate::filter::Filter;

words!(
    Filter,
    "filter",
    [
        (Hardware, "hardware", "The adapter's trilinear filter"),
        (Exact, "exact", "Eight loads with full-precision weights"),
        (
            Nearest,
            "nearest",
            "The value of the nearest voxel, never one between: for labels. Takes samples, without light and \
             isosurfaces"
        ),
    ]
);

/// How pixels travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transport {
    #[default]
    F16,
    F32,
    U8,
}

words!(Transport, "transport", [(F16, "f16", ""), (F32, "f32", ""), (U8, "u8", "")]);

impl Transport {
    /// May pixels of this kind travel so?
    #[must_use]
    pub const fn carries(self, kind: PixelKind) -> bool {
        matches!(self, Self::F32) || kind.may_be_rounded()
    }
}

/// What rays leap through, several sample positions at once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Leap {
    #[default]
    Off,
    /// Regions of the store (Frey & Ertl 2009): the picture is the plain raycast of V'.
    Regions,
    /// Macrocells whose values span at most this share of the store's range: the rival to regions, which needs no
    /// segmentation.
    Macrocells(f32),
}

/// A [`Leap`] without its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeapKind {
    Off,
    Regions,
    Macrocells,
}

words!(
    LeapKind,
    "leap",
    [
        (Off, "off", "Every sample for itself"),
        (Regions, "regions", "Through the store's regions"),
        (Macrocells, "macrocells", "Through homogeneous macrocells"),
    ]
);

impl Leap {
    #[must_use]
    pub const fn kind(self) -> LeapKind {
        match self {
            Self::Off => LeapKind::Off,
            Self::Regions => LeapKind::Regions,
            Self::Macrocells(_) => LeapKind::Macrocells,
        }
    }
}

/// Voxels per edge of a macrocell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum MacrocellEdge {
    #[default]
    Four,
    /// As in Krueger & Westermann 2003.
    Eight,
}

impl MacrocellEdge {
    pub const ALL: [Self; 2] = [Self::Four, Self::Eight];

    #[must_use]
    pub const fn voxels(self) -> u32 {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// The edge of so many voxels, if there is one.
    #[must_use]
    pub fn of_voxels(voxels: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|edge| edge.voxels() == voxels)
    }
}

/// How rays are shortened, early termination apart. Only leaping changes what a picture means, within its bound.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acceleration {
    /// Skip macrocells without opacity (Krueger & Westermann 2003).
    pub skip_empty: bool,
    pub leap: Leap,
    pub macrocell: MacrocellEdge,
    /// Bricks whose error bound under the current transfer function exceeds this do not leap; premultiplied, 0..=1.
    pub leap_tolerance: Option<f32>,
}

/// How many rays a pixel is the mean of: a regular square grid of them over its area.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum PixelSamples {
    #[default]
    One,
    Four,
    Nine,
    Sixteen,
}

impl PixelSamples {
    pub const ALL: [Self; 4] = [Self::One, Self::Four, Self::Nine, Self::Sixteen];

    /// Rays along a side of the pixel.
    #[must_use]
    pub const fn side(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Four => 2,
            Self::Nine => 3,
            Self::Sixteen => 4,
        }
    }

    /// Rays of a pixel.
    #[must_use]
    pub const fn count(self) -> u32 {
        self.side() * self.side()
    }

    /// So many rays, if that is one of them.
    #[must_use]
    pub fn of_count(count: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|samples| samples.count() == count)
    }

    /// The picture whose pixels are the rays of one with `width` x `height` pixels.
    ///
    /// # Errors
    /// It is over the limits of a picture.
    pub fn rays_of(self, width: u32, height: u32) -> Result<PictureSize, SceneError> {
        let along = |pixels: u32| pixels.saturating_mul(self.side());
        let rays = [along(width), along(height)];
        PictureSize::new(rays[0], rays[1]).map_err(|_| SceneError::Rays { size: [width, height], samples: self, rays })
    }
}

/// One half of an interval picture (docs/adr/0016-intervals.md): of each pixel, one end of what the pictures of V' and
/// of the volume can be, whatever the values in flattened regions. Pixels of both are joined as colours are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Extreme {
    /// The least colours, and the largest opacity.
    Lowest,
    /// The largest colours, and the least opacity.
    Highest,
}

words!(
    Extreme,
    "extreme",
    [
        (Lowest, "lowest", "The least colours, the largest opacity"),
        (Highest, "highest", "The largest colours, the least opacity")
    ]
);

/// How exactly and how fast a picture is drawn. The default is the command line's, without acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Sample distance in voxels of the smallest spacing.
    pub step: f64,
    /// Rays stop at this accumulated opacity, in (0, 1]; 1 switches early termination off.
    pub early_termination: f32,
    pub filter: Filter,
    /// One accumulator per chunk, joined at the merge tree's nodes in f32: the same bits for every assignment.
    pub exact: bool,
    pub acceleration: Acceleration,
    /// Of a pixel, averaged once the rays are joined and coloured.
    pub samples: PixelSamples,
    /// None: the picture itself. No manifest tells of another.
    pub extreme: Option<Extreme>,
}

impl Default for Quality {
    fn default() -> Self {
        Self {
            step: 0.5,
            early_termination: 0.999,
            filter: Filter::default(),
            exact: false,
            acceleration: Acceleration::default(),
            samples: PixelSamples::default(),
            extreme: None,
        }
    }
}

impl Quality {
    /// # Errors
    /// Early termination outside (0, 1], a step outside 0.01..=16, shares outside 0..=1.
    pub fn check(&self) -> Result<(), SceneError> {
        if !(self.early_termination > 0.0 && self.early_termination <= 1.0) {
            return Err(SceneError::EarlyTermination(self.early_termination));
        }
        if !(0.01..=16.0).contains(&self.step) {
            return Err(SceneError::Step(self.step));
        }
        if let Leap::Macrocells(range) = self.acceleration.leap
            && !(0.0..=1.0).contains(&range)
        {
            return Err(SceneError::MacrocellRange(range));
        }
        match self.acceleration.leap_tolerance {
            Some(tolerance) if !(0.0..=1.0).contains(&tolerance) => Err(SceneError::LeapTolerance(tolerance)),
            _ => Ok(()),
        }
    }
}
