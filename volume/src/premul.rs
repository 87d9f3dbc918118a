//! Premultiplied colour, and the only `over` of the project.

use bytemuck::{Pod, Zeroable};

/// Premultiplied RGBA, f32. A type of its own, so that a straight colour cannot be blended by mistake.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Premul {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

impl Premul {
    pub const CLEAR: Self = Self { r: 0.0, g: 0.0, b: 0.0, a: 0.0 };

    #[must_use]
    pub fn to_array(self) -> [f32; 4] {
        [self.r, self.g, self.b, self.a]
    }

    #[must_use]
    pub fn from_array([r, g, b, a]: [f32; 4]) -> Self {
        Self { r, g, b, a }
    }

    /// True where nothing was accumulated in any channel.
    #[must_use]
    pub fn is_clear(self) -> bool {
        self == Self::CLEAR
    }
}

/// `front over back`, premultiplied (Porter & Duff 1984). Blending with [`Premul::CLEAR`] on either side returns the
/// other side's very bits, so layers that have nothing to say may be left out.
#[must_use]
#[inline]
pub fn over(front: Premul, back: Premul) -> Premul {
    let through = 1.0 - front.a;
    Premul {
        r: front.r + back.r * through,
        g: front.g + back.g * through,
        b: front.b + back.b * through,
        a: front.a + back.a * through,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clear_is_the_identity_to_the_bit() {
        let p = Premul { r: 0.1, g: 0.2, b: 0.3, a: 0.7 };
        assert_eq!(over(p, Premul::CLEAR), p);
        assert_eq!(over(Premul::CLEAR, p), p);
    }
}
