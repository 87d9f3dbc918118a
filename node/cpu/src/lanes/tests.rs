//! Every operation of every set that is here, against one number at a time.

use super::portable::Portable;
use super::*;

/// Numbers without order, and those with a meaning of their own.
fn numbers(seed: u64) -> impl Iterator<Item = f32> {
    let special = [0.0, -0.0, 1.0, -1.0, 0.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-40, -1e-40, 3e9, -3e9];
    let special = special.into_iter().chain([f32::MAX, f32::MIN_POSITIVE, 16_777_216.0, 2_147_483_648.0, -7.5, 7.5]);
    let mut state = seed;
    let any = std::iter::repeat_with(move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f32::from_bits((state >> 32) as u32)
    });
    let special: Vec<f32> = special.collect();
    any.enumerate().map(move |(i, x)| if i % 3 == 0 { special[(i / 3 + seed as usize) % special.len()] } else { x })
}

struct Operations<'a> {
    a: &'a [f32; WIDEST],
    b: &'a [f32; WIDEST],
}

/// By lane: what each operation gave, as bits.
impl Task for Operations<'_> {
    type Output = Vec<Vec<u32>>;

    fn run<L: Lanes>(self, l: L) -> Self::Output {
        let (a, b) = (l.load(self.a), l.load(self.b));
        let (i, j) = (a.bits(), b.bits());
        let (small, other) = (i & l.splat_int(63), j & l.splat_int(63));
        let floats = [
            a + b,
            a - b,
            a * b,
            a / b,
            -a,
            a.larger(b),
            a.smaller(b),
            a.sqrt(),
            a.abs(),
            L::F::select(a.lt(b), a, b),
            L::F::select(a.le(b) & !a.same(b), a, b),
            L::F::select(a.same(b) | b.lt(a), a, b),
            L::F::select(l.mask(0b0101_1010_0110_1001), a, b),
            i.floats(),
            i.as_bits(),
            a.only(a.lt(b)),
        ];
        let ints = [
            i + j,
            i - j,
            i * j,
            i & j,
            a.cut_off(),
            i.larger(j),
            i.smaller(j),
            i.shift_right(7),
            i.shift_right_unsigned(7),
            i.shift_left(23),
            L::I::select(small.gt(other), i, j),
            L::I::select(small.same(other), i, j),
            i.count(a.lt(b)),
        ];
        let bits = l.splat_int(a.lt(b).bits() as i32);
        let all = floats.map(|x| l.store(x).map(f32::to_bits)).into_iter();
        let all = all.chain(ints.into_iter().chain([bits]).map(|x| l.store_int(x).map(|i| i as u32)));
        all.map(|lanes| lanes[..L::N].to_vec()).collect()
    }
}

/// What is not a number is one, whatever its bits: those are the processor's business.
fn same(a: u32, b: u32) -> bool {
    let is_nan = |bits| f32::from_bits(bits).is_nan();
    a == b || (is_nan(a) && is_nan(b))
}

#[test]
fn operations_are_those_of_single_numbers() {
    for &set in InstructionSet::ALL.iter().filter(|set| set.is_here()) {
        let (mut first, mut second) = (numbers(3), numbers(11));
        let mut differing = 0;
        for _ in 0..400 {
            let a: [f32; WIDEST] = std::array::from_fn(|_| first.next().unwrap_or_default());
            let b: [f32; WIDEST] = std::array::from_fn(|_| second.next().unwrap_or_default());
            let got = set.enter(Operations { a: &a, b: &b });
            for lane in 0..set.width() {
                let alone = Portable::<1>.enter(Operations { a: &[a[lane]; WIDEST], b: &[b[lane]; WIDEST] });
                for (op, (got, want)) in got.iter().zip(&alone).enumerate() {
                    // The mask of places, and the bits of all lanes, are not a lane's own.
                    if op == 12 || op == 29 {
                        continue;
                    }
                    assert!(same(got[lane], want[0]), "{}, operation {op}: {} {}", set.name(), a[lane], b[lane]);
                    differing += u32::from(got[lane] != got[0]);
                }
            }
            let by_place: Vec<u32> = (0..set.width())
                .map(|i| if 0b0101_1010_0110_1001 >> i & 1 == 1 { a[i] } else { b[i] }.to_bits())
                .collect();
            assert!(got[12].iter().zip(&by_place).all(|(a, b)| same(*a, *b)), "{}", set.name());
            let less = (0..set.width()).map(|i| u32::from(a[i] < b[i]) << i).sum::<u32>();
            assert_eq!(got[29][0], less, "{}", set.name());
        }
        assert!(differing > 10_000, "{differing}");
    }
}

struct Reads<'a> {
    codes: &'a [u16],
    rows: &'a [[f32; 4]],
    at: [f32; WIDEST],
    weights: [f32; WIDEST],
}

impl Task for Reads<'_> {
    type Output = Vec<Vec<u32>>;

    fn run<L: Lanes>(self, l: L) -> Self::Output {
        let (at, w) = (l.load(&self.at).cut_off(), l.load(&self.weights));
        let v = l.splat(1.0) - w;
        let words: &[u32] = &[7, 1 << 31, u32::MAX, 5];
        // SAFETY: places are below 3, and all hold more than five (codes and rows), or four (words).
        let (pairs, words, twos, rows, among) = unsafe {
            (
                l.pairs(self.codes.as_ptr(), at),
                l.words(words.as_ptr(), at),
                l.twos(self.rows.as_ptr().cast(), at),
                l.between_rows(self.rows.as_ptr(), at, w),
                l.among_rows(self.rows.as_ptr(), at, 2, [w, v]),
            )
        };
        let floats = [pairs.0, pairs.1, words.as_bits(), twos.0, twos.1].into_iter().chain(rows).chain(among);
        floats.map(|x| l.store(x)[..L::N].iter().map(|x| x.to_bits()).collect()).collect()
    }
}

#[test]
fn reads_are_those_of_single_places() {
    let codes = [3, 65535, 0, 40_000, 1, 9];
    let rows: Vec<[f32; 4]> = (0..6).map(|i| std::array::from_fn(|c| (i * 7 + c) as f32 * 0.37 - 2.0)).collect();
    let at: [f32; WIDEST] = std::array::from_fn(|i| (i * 5 % 3) as f32);
    let weights: [f32; WIDEST] = std::array::from_fn(|i| i as f32 / 16.0);
    for &set in InstructionSet::ALL.iter().filter(|set| set.is_here()) {
        let got = set.enter(Reads { codes: &codes, rows: &rows, at, weights });
        for lane in 0..set.width() {
            let (at, weights) = ([at[lane]; WIDEST], [weights[lane]; WIDEST]);
            let want = Portable::<1>.enter(Reads { codes: &codes, rows: &rows, at, weights });
            let got: Vec<u32> = got.iter().map(|lanes| lanes[lane]).collect();
            assert_eq!(got, want.iter().map(|lanes| lanes[0]).collect::<Vec<_>>(), "{}, lane {lane}", set.name());
        }
    }
}

#[test]
fn sets_have_names() {
    for &set in InstructionSet::ALL {
        assert_eq!(InstructionSet::named(set.name()), Some(set));
    }
    assert_eq!(InstructionSet::named("mmx"), None);
    assert!(InstructionSet::best().is_here());
}
