//! A curve as a picture.

use std::path::Path;

use brickcast_volume::PictureSize;

use super::canvas::Canvas;
use super::plot::{Plot, short};
use crate::cli::failure::Failure;
use crate::output::png;

const SIZE: (u32, u32) = (800, 440);
/// Where the curve is drawn: left, top, width, height.
const FRAME: (usize, usize, usize, usize) = (80, 16, 700, 340);
/// Top and height of the bar of colours.
const BAR: (usize, usize) = (366, 28);
/// Top of the numbers below.
const NUMBERS: usize = 408;

const GREY: [f64; 3] = [0.82; 3];
const DARK: [f64; 3] = [0.1; 3];
const LINE: usize = 2;

/// The area below the curve in its colours, over the histogram in grey; the colours once more below, without opacity.
///
/// # Errors
/// A missing folder, a full disk.
pub(super) fn write(path: &Path, plot: &Plot<'_>) -> Result<(), Failure> {
    let size = PictureSize::new(SIZE.0, SIZE.1)?;
    let mut canvas = Canvas::new(size);
    let (left, top, width, height) = FRAME;
    let pixels = |share: f64| (share.clamp(0.0, 1.0) * height as f64).round() as usize;
    for i in 0..width {
        let x = left + i;
        let color = plot.function.color(plot.x((i as f64 + 0.5) / width as f64));
        let mut column = |from: usize, to: usize, rgb, opacity| {
            canvas.fill((x, top + height - to), (1, to - from), rgb, opacity);
        };
        column(0, pixels(plot.voxels(i, width)), GREY, 1.0);
        if let Some([low, high]) = plot.curve(i, width) {
            column(0, pixels(high), color, 0.75);
            let end = pixels(high).max(LINE);
            column(pixels(low).min(end - LINE), end, DARK, 1.0);
        }
        canvas.fill((x, BAR.0), (1, BAR.1), color, 1.0);
    }
    canvas.fill((left - 1, top), (1, height), DARK, 1.0);
    canvas.fill((left - 1, top + height), (width + 1, 1), DARK, 1.0);
    if plot.has_opacities {
        for (share, y) in [(1.0, top), (0.5, top + height / 2), (0.0, top + height)] {
            let text = short(plot.top * share);
            canvas.fill((left - 6, y), (5, 1), DARK, 1.0);
            canvas.number((left.saturating_sub(12 + Canvas::width_of(&text)), y.saturating_sub(4)), &text);
        }
    }
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let x = left + (share * (width - 1) as f64) as usize;
        let text = short(plot.x(share));
        canvas.fill((x, BAR.0 + BAR.1), (1, 6), DARK, 1.0);
        let start = x.saturating_sub(Canvas::width_of(&text) / 2);
        canvas.number((start.min(SIZE.0 as usize - 4 - Canvas::width_of(&text)), NUMBERS), &text);
    }
    png::write(path, &canvas.into_picture()?, Some([1.0; 3]))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::plot::tests::function;
    use super::*;

    #[test]
    fn the_picture_has_the_curve_and_its_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let f = function(&[(0.0, 0.0), (100.0, 1.0)]);
        write(&path, &Plot::new(&f, true, None)).unwrap();
        let picture = png::read(&path).unwrap();
        assert_eq!((picture.size.width(), picture.size.height()), SIZE);
        let at = |x: usize, y: usize| {
            let [r, g, b, _] = picture.frames[0][y * SIZE.0 as usize + x];
            [r, g, b]
        };
        let (left, top, width, height) = FRAME;
        // Red to blue in the bar; above the ramp white, below it coloured, on it dark.
        let [red, _, blue] = at(left + 1, BAR.0 + 5);
        assert!(red > 250 && blue < 5, "{red} {blue}");
        let [red, _, blue] = at(left + width - 2, BAR.0 + 5);
        assert!(red < 5 && blue > 250, "{red} {blue}");
        assert_eq!(at(left + width / 4, top + height / 2), [255; 3]);
        let [red, green, blue] = at(left + 3 * width / 4, top + height / 2);
        assert!(blue > red && red > green, "{red} {green} {blue}");
        let on_line = (0..height).filter(|y| at(left + width / 2, top + y).iter().all(|v| *v < 40)).count();
        assert!((1..=4).contains(&on_line), "{on_line}");
        // Numbers: some ink where the labels are.
        assert!((0..24).any(|i| at(left + i / 2, NUMBERS + i % 10) != [255; 3]));
    }
}
