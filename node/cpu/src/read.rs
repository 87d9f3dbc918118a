//! Reads one brick's texels at places side by side. The same as the twin's, lane by lane (`shaders/src/twin/read.rs`,
//! `holes.rs`).

use brickcast_shaders::layout::RegionFlags;
use brickcast_shaders::twin::bindings::{Bindings, SlabTable};
use brickcast_shaders::twin::holes::NO_DATA;

use super::lanes::{Floats, Ints, Lanes};
use super::ray::{Place, between};
use super::shown::ShownEntries;

const CODE: f32 = 1.0 / 65535.0;

/// What does not change along rays: the brick's texels, and how places become theirs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reader<'a> {
    codes: &'a [u16],
    /// Subtract from a global position + 0.5, rounded down, for the texel of the support's low corner.
    first_texel: [i32; 3],
    last_corner: [i32; 3],
    row: i32,
    slice: i32,
    code_scale: f32,
    is_nearest: bool,
    pub(crate) has_holes: bool,
    pub(crate) means: Option<&'a [f32]>,
    flags: &'a [u8],
    pub(crate) shown: ShownEntries,
    /// 1 where another level is drawn, of the 27 places around the brick.
    pub(crate) elsewhere: [u32; 27],
}

/// What a texel of a coded brick says.
pub(crate) struct Coded<L: Lanes> {
    pub(crate) is_leap: L::M,
    /// Of a leap: Chebyshev distance, and the mean code.
    pub(crate) distance: L::F,
    pub(crate) mean: L::F,
    /// Else: whether it is an inner guard, and its code.
    pub(crate) is_inner: L::M,
    pub(crate) code: L::F,
}

impl<'a> Reader<'a> {
    /// `None` for bricks that lanes cannot read: that lack texels, flags or parts of their map, have a single texel
    /// along an axis, or more than lanes can count.
    pub(crate) fn new(bound: &Bindings<'a>, shown: ShownEntries) -> Option<Self> {
        let (frame, brick, data) = (bound.scene.frame, bound.brick, bound.data);
        let dims = brick.stored_dims;
        let voxels = dims.iter().try_fold(1_usize, |n, &side| n.checked_mul(side as usize))?;
        let has_flags = brick.region_flags == RegionFlags::Texture as u32;
        let cells = |dims: [u32; 3]| dims.iter().map(|&n| n as usize).product::<usize>();
        let is_complete = data.texels.len() >= voxels
            && voxels <= i32::MAX as usize / 2
            && dims.iter().all(|side| (2..=1 << 24).contains(side))
            && (!has_flags || data.flags.len() >= voxels)
            && data.means.is_none_or(|means| !means.is_empty() && means.len() <= 1 << 15)
            && (data.means.is_some() || !bound.key.leaps)
            && (data.map.is_some() || !bound.key.has_map())
            && data
                .map
                .is_none_or(|(map, dims)| (1..=map.len()).contains(&cells(dims)) && map.len() <= i32::MAX as usize);
        let take = bound.key.take.slab_kind();
        let tables = bound.scene.tables;
        let can_classify =
            [Some(tables.table), tables.region].into_iter().flatten().all(|t| (2..=1 << 24).contains(&t.len()));
        let has_slabs = bound.scene.slabs.iter().flatten().all(|table| is_whole(table, take.has_weights()));
        let has_slabs = has_slabs && (bound.scene.slabs.is_some() || !take.preintegrated);
        (is_complete && can_classify && has_slabs).then(|| Self {
            codes: &data.texels[..voxels],
            first_texel: brick.stored_lo.map(|lo| lo + 1),
            last_corner: dims.map(|n| n as i32 - 2),
            row: dims[0] as i32,
            slice: (dims[0] * dims[1]) as i32,
            code_scale: brick.code_scale,
            is_nearest: frame.nearest != 0,
            has_holes: brick.holes != 0,
            means: if bound.key.leaps { data.means } else { None },
            flags: data.flags,
            shown,
            elsewhere: std::array::from_fn(|side| brick.borders >> side & 1),
        })
    }

    /// Are all values between voxels, and all of them data?
    pub(crate) fn is_plain(&self) -> bool {
        !self.is_nearest && !self.has_holes
    }

    /// The same, of one that is plain, as constants.
    #[inline(always)]
    pub(crate) fn whole(self) -> Self {
        Self { is_nearest: false, has_holes: false, ..self }
    }

    /// The same, of one without leaps.
    #[inline(always)]
    pub(crate) fn plain(self) -> Self {
        Self { means: None, ..self.whole() }
    }

    #[inline(always)]
    fn texel<L: Lanes>(&self, l: L, [x, y, z]: [L::I; 3]) -> L::I {
        x + y * l.splat_int(self.row) + z * l.splat_int(self.slice)
    }

    /// The weight of the far corner along an axis, and the near one, in texels from the brick's first.
    #[inline(always)]
    fn corner<L: Lanes>(&self, l: L, p: L::F, a: usize) -> (L::F, L::I) {
        // Half a voxel up in place of down: never negative, so that cutting off rounds down.
        let q = p + l.splat(0.5);
        let whole = q.cut_off();
        let corner = (whole - l.splat_int(self.first_texel[a])).larger(l.splat_int(0));
        let corner = corner.smaller(l.splat_int(self.last_corner[a]));
        let texels = match a {
            0 => corner,
            1 => corner * l.splat_int(self.row),
            _ => corner * l.splat_int(self.slice),
        };
        (q - whole.floats(), texels)
    }

    /// The index along an axis of the voxel that holds a place.
    #[inline(always)]
    fn voxel<L: Lanes>(&self, l: L, p: L::F, a: usize) -> L::I {
        let at = p.cut_off() + l.splat_int(1 - self.first_texel[a]);
        at.smaller(l.splat_int(self.last_corner[a] + 1)).larger(l.splat_int(0))
    }

    /// The trilinear code in every lane, negative where there is no data; supports must be free of leap voxels.
    #[inline(always)]
    pub(crate) fn read<L: Lanes>(&self, l: L, p: Place<L>) -> L::F {
        if self.is_nearest {
            let texel = self.nearest(l, self.nearest_index(l, p));
            let code = texel * l.splat(CODE);
            let is_hole = texel.same(l.splat(0.0));
            let code = if self.has_holes { L::F::select(is_hole, l.splat(NO_DATA), code) } else { code };
            return code * l.splat(self.code_scale);
        }
        let corners = [self.corner(l, p[0], 0), self.corner(l, p[1], 1), self.corner(l, p[2], 2)];
        self.between_corners(l, corners)
    }

    /// What lies ahead of places along each axis, and what behind: the codes at places that have one coordinate of
    /// `ahead` or `behind` in place of their own. What the other two say is found once.
    #[inline(always)]
    pub(crate) fn around<L: Lanes>(&self, l: L, p: Place<L>, ahead: Place<L>, behind: Place<L>) -> [[L::F; 2]; 3] {
        macro_rules! along {
            ($axis:literal, $read:ident, $here:expr) => {{
                let (mut further, mut back) = ($here, $here);
                further[$axis] = $read!(ahead, $axis);
                back[$axis] = $read!(behind, $axis);
                (further, back)
            }};
        }
        if self.is_nearest {
            macro_rules! place {
                ($of:ident, $axis:literal) => {
                    $of[$axis]
                };
            }
            let (x, y, z) = (along!(0, place, p), along!(1, place, p), along!(2, place, p));
            return [
                [self.read(l, x.0), self.read(l, x.1)],
                [self.read(l, y.0), self.read(l, y.1)],
                [self.read(l, z.0), self.read(l, z.1)],
            ];
        }
        macro_rules! corner {
            ($of:ident, $axis:literal) => {
                self.corner(l, $of[$axis], $axis)
            };
        }
        let here = [corner!(p, 0), corner!(p, 1), corner!(p, 2)];
        let (x, y, z) = (along!(0, corner, here), along!(1, corner, here), along!(2, corner, here));
        [
            [self.between_corners(l, x.0), self.between_corners(l, x.1)],
            [self.between_corners(l, y.0), self.between_corners(l, y.1)],
            [self.between_corners(l, z.0), self.between_corners(l, z.1)],
        ]
    }

    /// The trilinear code by the weights and near corners of each axis, in texels of the brick.
    #[inline(always)]
    fn between_corners<L: Lanes>(&self, l: L, [(wx, x), (wy, y), (wz, z)]: [(L::F, L::I); 3]) -> L::F {
        let at = x + y + z;
        let (row, slice) = (l.splat_int(self.row), l.splat_int(self.slice));
        let codes = self.codes.as_ptr();
        // SAFETY: corners were clamped to dims - 2, so that they and the next texel along each axis lie within the
        // brick, of which `codes` holds all.
        let [(a0, b0), (a1, b1), (a2, b2), (a3, b3)] = unsafe {
            let far = at + slice;
            [l.pairs(codes, at), l.pairs(codes, at + row), l.pairs(codes, far), l.pairs(codes, far + row)]
        };
        let near = between(between(a0, b0, wx), between(a1, b1, wx), wy);
        let far = between(between(a2, b2, wx), between(a3, b3, wx), wy);
        let code = between(near, far, wz) * l.splat(CODE);
        if !self.has_holes {
            return code * l.splat(self.code_scale);
        }
        let zero = l.splat(0.0);
        let (hx, hy, hz) = (zero.lt(wx), zero.lt(wy), zero.lt(wz));
        // The near corner always has weight: fractions are below 1.
        let is_hole = (a0.same(zero) | (b0.same(zero) & hx))
            | ((a1.same(zero) | (b1.same(zero) & hx)) & hy)
            | ((a2.same(zero) | (b2.same(zero) & hx)) & hz)
            | ((a3.same(zero) | (b3.same(zero) & hx)) & hy & hz);
        L::F::select(is_hole, l.splat(NO_DATA), code) * l.splat(self.code_scale)
    }

    /// Of the voxels that hold places; indices.
    #[inline(always)]
    pub(crate) fn nearest_index<L: Lanes>(&self, l: L, p: Place<L>) -> L::I {
        self.texel(l, [self.voxel(l, p[0], 0), self.voxel(l, p[1], 1), self.voxel(l, p[2], 2)])
    }

    /// The texels at indices, as numbers.
    #[inline(always)]
    fn nearest<L: Lanes>(&self, l: L, at: L::I) -> L::F {
        // Two texels are read at once, so not from the last one on.
        let from = at.smaller(l.splat_int(self.codes.len() as i32 - 2));
        // SAFETY: indices were clamped to the brick's texels, of which `codes` holds all, and there are eight or more.
        let (near, far) = unsafe { l.pairs(self.codes.as_ptr(), from) };
        L::F::select(at.same(from), near, far)
    }

    /// Are the voxels at indices in a region?
    #[inline(always)]
    pub(crate) fn flagged<L: Lanes>(&self, l: L, at: L::I) -> L::M {
        let at = l.store_int(at);
        let mut bits = 0;
        for (lane, &at) in at[..L::N].iter().enumerate() {
            bits |= u32::from(self.flags[at as usize] != 0) << lane;
        }
        l.mask(bits)
    }

    /// What the texels of places say, of a brick of leaps.
    #[inline(always)]
    pub(crate) fn coded<L: Lanes>(&self, l: L, p: Place<L>) -> Coded<L> {
        let texel = self.nearest(l, self.nearest_index(l, p)).cut_off();
        let zero = l.splat_int(0);
        let is_leap = (texel & l.splat_int(0x8000)).gt(zero);
        let is_inner = (texel & l.splat_int(1)).gt(zero) & !is_leap;
        let slot = texel & l.splat_int(0x7f);
        let means = self.means.unwrap_or(&[0.0]);
        let known = slot.smaller(l.splat_int(means.len() as i32 - 1));
        // SAFETY: slots were clamped to those there are, and none is negative.
        let mean = unsafe { l.words(means.as_ptr().cast(), known) }.as_bits();
        Coded {
            is_leap,
            distance: (texel.shift_right(7) & l.splat_int(0xff)).floats(),
            mean: L::F::select(slot.same(known), mean, l.splat(0.0)),
            is_inner,
            code: texel.shift_right(1).floats() / l.splat(16383.0),
        }
    }
}

/// Can lanes read a table? They do not ask while they do.
fn is_whole(table: &SlabTable<'_>, has_weights: bool) -> bool {
    let entries = table.size.saturating_mul(table.size);
    (2..=1 << 14).contains(&table.size)
        && table.front.len() >= entries
        && (!has_weights || table.back.len() >= entries)
        && (1..=1 << 24).contains(&table.warp.len())
        && table.shown_before.len() > table.size
}
