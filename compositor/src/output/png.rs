//! PNG: 8-bit straight RGBA, or opaque RGB over a background.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use brickcast_volume::{PictureSize, Premul, small_file};

use super::atomic::AtomicFile;
use super::error::OutputError;
use super::limits::MAX_FILE_BYTES;
use super::reel::Reel;
use crate::picture::Picture;

/// Writes `picture` as straight RGBA, or as opaque RGB over `background` (display-referred, each channel in 0..=1).
///
/// # Errors
/// A missing folder, a full disk.
pub fn write(path: &Path, picture: &Picture, background: Option<[f32; 3]>) -> Result<PathBuf, OutputError> {
    let file = AtomicFile::create(path)?;
    let mut writer = file.writer()?;
    let encode = |e: ::png::EncodingError| encoding(path, e);
    let mut png = encoder(&mut writer, picture.size(), background).write_header().map_err(encode)?;
    png.write_image_data(&bytes(picture.pixels(), background)).map_err(encode)?;
    png.finish().map_err(encode)?;
    writer.flush().map_err(|e| file.error(e))?;
    drop(writer);
    file.commit()
}

pub(super) fn encoder<W: Write>(
    writer: W,
    size: PictureSize,
    background: Option<[f32; 3]>,
) -> ::png::Encoder<'static, W> {
    let mut encoder = ::png::Encoder::new(writer, size.width(), size.height());
    encoder.set_color(if background.is_some() { ::png::ColorType::Rgb } else { ::png::ColorType::Rgba });
    encoder.set_depth(::png::BitDepth::Eight);
    // A sequence's files are made beside its next frames: the tighter ways cost as much as some frames.
    encoder.set_compression(::png::Compression::Fast);
    encoder
}

pub(super) fn encoding(path: &Path, error: ::png::EncodingError) -> OutputError {
    match error {
        ::png::EncodingError::IoError(error) => OutputError::Write { path: path.to_owned(), error },
        other => OutputError::Encode { path: path.to_owned(), problem: other.to_string() },
    }
}

/// The file's samples: RGBA, or RGB where there is a background.
pub(super) fn bytes(pixels: &[Premul], background: Option<[f32; 3]>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(pixels.len() * 4);
    match background {
        None => pixels.iter().for_each(|p| bytes.extend_from_slice(&straight(*p))),
        Some(background) => {
            // Most pixels of most pictures.
            let clear = opaque(Premul::CLEAR, background);
            let of = |p: &Premul| if *p == Premul::CLEAR { clear } else { opaque(*p, background) };
            pixels.iter().for_each(|p| bytes.extend_from_slice(&of(p)));
        }
    }
    bytes
}

/// `C / A` and A in 8 bits, rounded to nearest; all zero where A rounds to 0.
#[must_use]
pub fn straight(p: Premul) -> [u8; 4] {
    match to_byte(p.a) {
        0 => [0; 4],
        a => [to_byte(p.r / p.a), to_byte(p.g / p.a), to_byte(p.b / p.a), a],
    }
}

/// `C + (1 - A) background` in 8 bits, rounded to nearest.
#[must_use]
pub fn opaque(p: Premul, background: [f32; 3]) -> [u8; 3] {
    let through = 1.0 - p.a;
    let [r, g, b] = background;
    [p.r + r * through, p.g + g * through, p.b + b * through].map(to_byte)
}

/// As `(v * 255).round()`, which is a call on processors of the oldest kind. Casts saturate, and NaN becomes 0.
fn to_byte(v: f32) -> u8 {
    let v = v * 255.0;
    let whole = v as u8;
    whole.saturating_add(u8::from(v - f32::from(whole) >= 0.5))
}

/// A decoded file: its frames as straight RGBA (alpha 255 where the file has none).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decoded {
    pub size: PictureSize,
    /// One of a still picture; row-major.
    pub frames: Vec<Vec<[u8; 4]>>,
    pub has_alpha: bool,
}

/// The most bytes that a file may unfold to, over all frames.
const MAX_DECODED: usize = 2 << 30;

/// Reads back what this module and [`super::animation`] write.
///
/// # Errors
/// No such file, no PNG, another pixel format than 8-bit RGB or RGBA, a picture over the limits.
pub fn read(path: &Path) -> Result<Decoded, OutputError> {
    let problem = |problem: String| OutputError::Decode { path: path.to_owned(), problem };
    let file = small_file::read("picture", path, MAX_FILE_BYTES)?;
    let mut reader = ::png::Decoder::new(Cursor::new(file)).read_info().map_err(|e| problem(e.to_string()))?;
    let info = reader.info();
    let size = PictureSize::new(info.width, info.height).map_err(|e| problem(e.to_string()))?;
    let channels = match (info.color_type, info.bit_depth) {
        (::png::ColorType::Rgba, ::png::BitDepth::Eight) => 4,
        (::png::ColorType::Rgb, ::png::BitDepth::Eight) => 3,
        (color, depth) => {
            return Err(problem(format!("{color:?} of {depth:?} bits is not read, only 8-bit RGB or RGBA")));
        }
    };
    let frame_count = info.animation_control().map_or(1, |a| a.num_frames as usize);
    if size.pixel_count().saturating_mul(4).saturating_mul(frame_count) > MAX_DECODED {
        return Err(problem(format!("{frame_count} frames unfold to more than {MAX_DECODED} bytes")));
    }
    let mut frames = Vec::new();
    let mut buffer = vec![0; size.pixel_count() * channels];
    for _ in 0..frame_count {
        let frame = reader.next_frame(&mut buffer).map_err(|e| problem(e.to_string()))?;
        if (frame.width, frame.height) != (size.width(), size.height()) {
            return Err(problem(format!("a frame of {}x{} is only a part of the picture", frame.width, frame.height)));
        }
        let pixel = |p: &[u8]| [p[0], p[1], p[2], p.get(3).copied().unwrap_or(255)];
        frames.push(buffer.chunks_exact(channels).map(pixel).collect());
    }
    Ok(Decoded { size, frames, has_alpha: channels == 4 })
}

/// What the streaming writers hold.
pub(super) type Stream = ::png::Writer<Reel>;

#[cfg(test)]
mod tests {
    use super::*;

    fn premul(r: f32, g: f32, b: f32, a: f32) -> Premul {
        Premul { r, g, b, a }
    }

    #[test]
    fn straight_bytes_divide_by_alpha_and_round_to_nearest() {
        assert_eq!(straight(premul(0.25, 0.125, 0.0, 0.5)), [128, 64, 0, 128]);
        assert_eq!(straight(premul(1.0, 1.0, 1.0, 1.0)), [255; 4]);
        assert_eq!(straight(premul(0.3 / 255.0, 0.0, 0.0, 0.49 / 255.0)), [0; 4]);
        assert_eq!(straight(premul(0.6 / 255.0, 0.0, 0.0, 0.6 / 255.0)), [255, 0, 0, 1]);
        // Rounding above 1 and below 0 must not wrap.
        assert_eq!(straight(premul(1.01, -0.01, f32::NAN, 1.0)), [255, 0, 0, 255]);
        assert_eq!(straight(Premul::CLEAR), [0; 4]);
    }

    #[test]
    fn bytes_are_rounded_as_numbers_are() {
        for i in -1000..600_000 {
            let v = i as f32 / 500_000.0;
            assert_eq!(to_byte(v), (v * 255.0).round() as u8, "{v}");
        }
        for v in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e30, -1e30, 254.5 / 255.0, 0.5 / 255.0] {
            assert_eq!(to_byte(v), (v * 255.0).round() as u8, "{v}");
        }
    }

    #[test]
    fn a_background_shines_through_by_one_minus_alpha() {
        assert_eq!(opaque(Premul::CLEAR, [1.0, 0.5, 0.0]), [255, 128, 0]);
        assert_eq!(opaque(premul(0.2, 0.2, 0.2, 1.0), [1.0; 3]), [51; 3]);
        assert_eq!(opaque(premul(0.1, 0.0, 0.0, 0.5), [0.2, 0.4, 1.0]), [51, 51, 128]);
    }

    /// Straight alpha in place of premultiplied, swapped rows or channels would show here.
    #[test]
    fn files_read_back_as_written_with_and_without_background() {
        let folder = tempfile::tempdir().unwrap();
        for (w, h) in [(1, 1), (17, 5), (64, 3)] {
            let size = PictureSize::new(w, h).unwrap();
            let pixels: Vec<_> = (0..w * h)
                .map(|i| {
                    let a = (i % 11) as f32 / 10.0;
                    premul(a * (i % w) as f32 / w as f32, a * 0.5, a * (i / w) as f32 / h as f32, a)
                })
                .collect();
            let picture = Picture::new(size, pixels.clone()).unwrap();
            let path = folder.path().join("a.png");
            write(&path, &picture, None).unwrap();
            let back = read(&path).unwrap();
            assert_eq!((back.size, back.has_alpha), (size, true));
            assert_eq!(back.frames, [pixels.iter().map(|p| straight(*p)).collect::<Vec<_>>()]);
            let grey = [0.2, 0.4, 0.6];
            write(&path, &picture, Some(grey)).unwrap();
            let back = read(&path).unwrap();
            assert!(!back.has_alpha);
            let want: Vec<_> = pixels.iter().map(|p| opaque(*p, grey)).map(|[r, g, b]| [r, g, b, 255]).collect();
            assert_eq!(back.frames, [want]);
        }
    }

    #[test]
    fn what_is_no_png_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(read(&path).unwrap_err().to_string().contains("a.png"));
        std::fs::write(&path, b"P5 1 1 255 x").unwrap();
        assert!(matches!(read(&path), Err(OutputError::Decode { .. })));
    }
}
