//! The 16-bit texel that holds either a density or a leap, and the guard width that keeps the two apart.

/// A voxel's value in 14 bits over the whole range of the store: `round(16383 code / 65535)`.
pub type Density = u16;

pub const MAX_DENSITY: Density = 16383;
/// The most regions with leap voxels in one brick's stored box.
pub const MAX_SLOTS: usize = 127;
/// Distances are cut off here: 8 bits.
pub const MAX_DISTANCE: u8 = 255;

/// Half up, in integers: the same on every machine.
#[must_use]
pub const fn density_of_code(code: u16) -> Density {
    ((code as u32 * MAX_DENSITY as u32 + 32767) / 65535) as Density
}

/// The same by shifts and sums alone, which processors do for many codes at once.
#[inline(always)]
pub(crate) const fn density_by_shifts(code: u16) -> u32 {
    let numerator = ((code as u32) << 14) - code as u32 + 32767;
    // n / 65535 for all n below 65535 * 65536.
    (numerator + 1 + (numerator >> 16)) >> 16
}

/// The 16-bit code of a density: `round(65535 density / 16383)`.
#[must_use]
pub const fn code_of_density(density: Density) -> u16 {
    ((density as u32 * 65535 + 8191) / MAX_DENSITY as u32) as u16
}

/// What a texel of a coded brick says. `shaders/wgsl/shared/texel.wgsl` takes the same bits apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CodedTexel {
    /// A leap voxel: the most significant bit, 8 bits Chebyshev distance, 7 bits slot of the brick's table of means.
    Leap { distance: u8, slot: u8 },
    /// A voxel's value: 14 bits density, and a bit that marks inner guards.
    Value { density: Density, inner: bool },
}

impl CodedTexel {
    const LEAP: u16 = 0x8000;

    #[must_use]
    #[inline]
    pub const fn pack(self) -> u16 {
        match self {
            Self::Leap { distance, slot } => Self::LEAP | (distance as u16) << 7 | (slot & 0x7f) as u16,
            Self::Value { density, inner } => density << 1 | inner as u16,
        }
    }

    #[must_use]
    #[inline(always)]
    pub const fn unpack(texel: u16) -> Self {
        if texel & Self::LEAP != 0 {
            Self::Leap { distance: (texel >> 7 & 0xff) as u8, slot: (texel & 0x7f) as u8 }
        } else {
            Self::Value { density: texel >> 1, inner: texel & 1 != 0 }
        }
    }
}

/// A voxel is a leap voxel iff all voxels within this Chebyshev distance have its label: wide enough that a ray of
/// steps up to `step` voxels meets two samples among guards alone before any support holds a leap voxel, whatever its
/// direction. `g = max(2 (1 + r), ceil(2 + r + 2 s) - 1)` (derived in `docs/adr/0002-leaping.md`); `gradient_radius` r
/// is 0 for density alone, 1 with central differences.
#[must_use]
pub fn guard_width(step: f64, gradient_radius: u32) -> u32 {
    let by_step = (2.0 + f64::from(gradient_radius) + 2.0 * step).ceil() as u32 - 1;
    by_step.max(2 * (1 + gradient_radius))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_by_shifts_are_those_of_the_definition() {
        for code in 0..=u16::MAX {
            assert_eq!(density_by_shifts(code), u32::from(density_of_code(code)), "{code}");
        }
    }

    #[test]
    fn densities_stretch_over_the_whole_range_and_come_back() {
        assert_eq!((density_of_code(0), density_of_code(u16::MAX)), (0, MAX_DENSITY));
        for density in 0..=MAX_DENSITY {
            assert_eq!(density_of_code(code_of_density(density)), density);
        }
        for code in 0..=u16::MAX {
            let back = f64::from(density_of_code(code)) / 16383.0;
            assert!((back - f64::from(code) / 65535.0).abs() <= 0.5 / 16383.0 + 1e-12);
        }
    }

    #[test]
    fn every_texel_is_packed_again_as_it_was() {
        assert_eq!(CodedTexel::Leap { distance: 255, slot: 0 }.pack(), 0xff80);
        assert_eq!(CodedTexel::Value { density: MAX_DENSITY, inner: true }.pack(), 0x7fff);
        for texel in 0..=u16::MAX {
            assert_eq!(CodedTexel::unpack(texel).pack(), texel);
        }
    }

    #[test]
    fn guards_grow_with_step_and_gradient() {
        for (step, r, want) in [(0.25, 0, 2), (0.5, 0, 2), (1.0, 0, 3), (2.0, 0, 5), (0.5, 1, 4), (1.0, 1, 4)] {
            assert_eq!(guard_width(step, r), want, "step {step}, r {r}");
        }
    }
}
