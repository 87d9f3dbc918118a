//! Joining, checking and colouring of every kind.

use super::*;
use crate::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

const ALL: [PixelKind; 4] = [PixelKind::Over, PixelKind::Largest, PixelKind::Smallest, PixelKind::Mean];

fn joined(kind: PixelKind, pixels: impl Iterator<Item = RawPixel>) -> RawPixel {
    let join = |front: RawPixel, back: RawPixel| {
        let mut back = [back];
        kind.join(&[front], &mut back);
        back[0]
    };
    pixels.reduce(join).unwrap()
}

/// Whatever the order in which layers are joined.
#[test]
fn projections_join_to_the_extremes_and_the_sum() {
    let pixel = |code: f32, n: f32| [code, n, 0.0, 1.0];
    for (kind, want) in [(PixelKind::Largest, 0.75), (PixelKind::Smallest, 0.25), (PixelKind::Mean, 0.25)] {
        let parts = [pixel(0.25, 1.0), [0.0; 4], pixel(0.75, 2.0), pixel(0.5, 3.0)];
        for pixel in [joined(kind, parts.into_iter()), joined(kind, parts.into_iter().rev())] {
            assert_eq!(kind.code(pixel), Some(want), "{kind}");
        }
        assert_eq!(kind.code([0.0; 4]), None);
    }
    let (a, b) = ([0.25, 0.5, 0.0, 1.0], [0.5, 0.25, 0.0, 0.5]);
    let want = over(Premul::from_array(b), Premul::from_array(a)).to_array();
    assert_eq!(joined(PixelKind::Over, [b, a].into_iter()), want);
    assert_eq!(PixelKind::Over.code(a), None);
}

/// Tiles leave clear pixels out, by their bits.
#[test]
fn clear_is_all_zero_and_changes_no_bit() {
    fn check<P: Pixel>() {
        assert_eq!((size_of::<P>(), bytemuck::cast::<_, [u32; 4]>(P::CLEAR)), (16, [0; 4]));
        let pixel: P = bytemuck::cast([0.25_f32, 3.0, 0.5, 1.0]);
        assert!(P::join(pixel, P::CLEAR) == pixel && P::join(P::CLEAR, pixel) == pixel);
        assert!(P::CLEAR.is_valid() && P::CLEAR.code().is_none());
    }
    for kind in ALL {
        of_kind!(kind, P => check::<P>());
        assert_eq!(of_kind!(kind, P => P::KIND), kind);
    }
}

/// Sample by sample, or part by part: the same.
#[test]
fn what_is_taken_is_what_is_joined() {
    let codes = [0.5, 0.125, 0.75, 0.25];
    for (kind, want) in [(PixelKind::Largest, 0.75), (PixelKind::Smallest, 0.125), (PixelKind::Mean, 0.40625)] {
        let mut whole = [0.0; 4];
        codes.iter().for_each(|code| kind.take(&mut whole, *code, 1.0));
        let parts = codes.map(|code| {
            let mut part = [0.0; 4];
            kind.take(&mut part, code, 1.0);
            part
        });
        assert_eq!(joined(kind, parts.into_iter()), whole);
        assert_eq!(kind.code(whole), Some(want));
    }
    let mut mean = [0.0; 4];
    PixelKind::Mean.take(&mut mean, 0.5, 3.0);
    PixelKind::Mean.take(&mut mean, 0.0, 1.0);
    assert_eq!((mean, PixelKind::Mean.code(mean)), ([1.5, 4.0, 0.0, 1.0], Some(0.375)));
    let mut color = [0.25; 4];
    PixelKind::Over.take(&mut color, 1.0, 1.0);
    assert_eq!(color, [0.25; 4]);
}

#[test]
fn what_no_ray_leaves_behind_is_not_valid() {
    use PixelKind::{Largest, Mean, Over, Smallest};
    let good = [
        (Over, [2.0, 0.5, 0.0, 1.0]),
        (Over, [0.0, 0.0, 0.0, 1.0005]),
        (Largest, [1.0, 0.0, 0.0, 1.0]),
        (Smallest, [0.0, 0.0, 0.0, 1.0]),
        // Rounded on its way through a filter.
        (Largest, [1.000_000_1, 0.0, 0.0, 1.0]),
        (Mean, [712.5, 1000.0, 0.0, 1.0]),
        (Mean, [0.0, 16_777_218.0, 0.0, 1.0]),
        (Mean, [0.0, 0.0, 0.0, 1.0]),
    ];
    for (kind, pixel) in good {
        assert!(kind.is_valid(pixel), "{kind} {pixel:?}: {}", kind.rule());
    }
    let bad = [
        (Over, [0.0, 0.0, 0.0, 1.1]),
        (Over, [0.0, 0.0, 0.0, -0.1]),
        (Largest, [0.5, 0.0, 0.0, 0.5]),
        (Largest, [1.1, 0.0, 0.0, 1.0]),
        (Smallest, [-0.1, 0.0, 0.0, 1.0]),
        (Mean, [-1.0, 3.0, 0.0, 1.0]),
        (Mean, [1.0, 2.5, 0.0, 1.0]),
        (Mean, [1.0, -2.0, 0.0, 1.0]),
        (Mean, [1.0, 2.0, 0.0, 2.0]),
    ];
    for (kind, pixel) in bad {
        assert!(!kind.is_valid(pixel), "{kind} {pixel:?}");
    }
    for (kind, channel) in ALL.into_iter().flat_map(|kind| (0..4).map(move |channel| (kind, channel))) {
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut pixel = [0.0, 0.0, 0.0, 1.0];
            pixel[channel] = odd;
            assert!(!kind.is_valid(pixel), "{kind} {pixel:?}");
        }
    }
}

#[test]
fn two_kinds_are_told_apart_by_name() {
    let (colors, codes) = (Pixels::of(vec![Premul::CLEAR; 3]), Pixels::clear(PixelKind::Mean, 3));
    assert_eq!((colors.kind_with(&colors), colors.len()), (Ok(PixelKind::Over), 3));
    let error = colors.kind_with(&codes).unwrap_err();
    assert_eq!(error, KindError { got: PixelKind::Mean, want: PixelKind::Over });
    assert!(error.to_string().contains("`mean`") && error.to_string().contains("`over`"), "{error}");
    assert_eq!(codes.typed::<Mean>(), Ok(&[Mean::CLEAR; 3][..]));
    assert_eq!(codes.typed::<Premul>(), Err(error));
}

#[test]
fn codes_become_colours_by_the_transfer_function_and_colours_stay() {
    let colors = vec![ColorPoint { x: 10.0, rgb: [0.0, 0.5, 1.0] }, ColorPoint { x: 20.0, rgb: [1.0, 0.5, 0.0] }];
    let opacities = vec![OpacityPoint { x: 10.0, opacity: 0.0 }, OpacityPoint { x: 20.0, opacity: 1.0 }];
    let coloring = Coloring::new(TransferFunction::new(colors, opacities).unwrap(), (10.0, 20.0));
    let quarter = Mean { sum: 1.0, count: 4.0, unused: 0.0, presence: 1.0 };
    let want = [Premul::from_array([0.0625, 0.125, 0.1875, 0.25]), Premul::CLEAR];
    assert_eq!(coloring.colors(&Pixels::of(vec![quarter, Mean::CLEAR])), want);
    assert_eq!(coloring.colors(&Pixels::of(want.to_vec())), want);
}
