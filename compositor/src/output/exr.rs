//! OpenEXR: premultiplied RGBA in 32-bit float, the very bits of the picture.

use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use ::exr::image::read::read as read_image;
use ::exr::prelude::{
    Compression, Encoding, Image, Layer, LayerAttributes, MetaData, SpecificChannels, Vec2, WritableImage as _,
};
use ::exr::prelude::{ReadChannels as _, ReadLayers as _};
use brickcast_volume::{PictureSize, Premul, small_file};

use super::atomic::AtomicFile;
use super::error::OutputError;
use super::limits::MAX_FILE_BYTES;
use crate::picture::Picture;

/// Writes channels R, G, B, A of 32 bits, losslessly compressed.
///
/// # Errors
/// A missing folder, a full disk.
pub fn write(path: &Path, picture: &Picture) -> Result<PathBuf, OutputError> {
    let file = AtomicFile::create(path)?;
    let mut writer = file.writer()?;
    let (size, pixels) = (picture.size(), picture.pixels());
    let width = size.width() as usize;
    let channels = SpecificChannels::rgba(|Vec2(x, y): Vec2<usize>| {
        let p = pixels[y * width + x];
        (p.r, p.g, p.b, p.a)
    });
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::SMALL_LOSSLESS };
    let layer = Layer::new((width, size.height() as usize), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut writer).map_err(|error| match error {
        ::exr::error::Error::Io(error) => file.error(error),
        other => OutputError::Encode { path: path.to_owned(), problem: other.to_string() },
    })?;
    writer.flush().map_err(|e| file.error(e))?;
    drop(writer);
    file.commit()
}

/// Reads the first layer's R, G, B, A as they are.
///
/// # Errors
/// No such file, no EXR with these channels, a picture over the limits.
pub fn read(path: &Path) -> Result<Picture, OutputError> {
    let problem = |problem: String| OutputError::Decode { path: path.to_owned(), problem };
    let file = small_file::read("picture", path, MAX_FILE_BYTES)?;
    // Memory is asked for by what the header says: looked at first.
    let about = MetaData::read_from_buffered(Cursor::new(&file), false).map_err(|e| problem(e.to_string()))?;
    let side = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    for header in &about.headers {
        let Vec2(width, height) = header.layer_size;
        PictureSize::new(side(width), side(height)).map_err(|e| problem(e.to_string()))?;
    }
    let image = read_image()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![Premul::CLEAR; size.area()]),
            |(width, pixels): &mut (usize, Vec<Premul>), at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = Premul { r, g, b, a };
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(file))
        .map_err(|e| problem(e.to_string()))?;
    let Vec2(width, height) = image.layer_data.size;
    let size = PictureSize::new(side(width), side(height)).map_err(|e| problem(e.to_string()))?;
    Ok(Picture::new(size, image.layer_data.channel_data.pixels.1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_survives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Any finite bit pattern, subnormals and -0 included.
            let v = f32::from_bits(state);
            if v.is_finite() { v } else { -0.0 }
        };
        for (w, h) in [(1, 1), (17, 5), (61, 97)] {
            let size = PictureSize::new(w, h).unwrap();
            let pixels: Vec<_> =
                (0..w * h).map(|_| Premul { r: random(), g: random(), b: random(), a: random() }).collect();
            let picture = Picture::new(size, pixels).unwrap();
            write(&path, &picture).unwrap();
            let back = read(&path).unwrap();
            assert_eq!(back.size(), size);
            let bits =
                |p: &Picture| -> Vec<[u32; 4]> { p.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect() };
            assert!(bits(&back) == bits(&picture), "{w}x{h}");
        }
    }

    #[test]
    fn what_is_no_exr_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        assert!(read(&path).unwrap_err().to_string().contains("a.exr"));
        std::fs::write(&path, vec![7; 300]).unwrap();
        assert!(matches!(read(&path), Err(OutputError::Decode { .. })));
    }
}
