//! JPEG: grey, and colour whose samples are equal.

use brickcast_volume::format::VoxelType;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::grey::colour;
use crate::slice::Shape;
use crate::wrong::Wrong;

/// The most pixels along an edge.
const MOST_EDGE: usize = 1 << 16;
/// How much a picture of that many bytes can be at most: 64 pixels take two bits at least.
const MOST_RATIO: usize = 1024;

type Opened<'a> = (JpegDecoder<ZCursor<&'a [u8]>>, Shape, bool);

/// Its headers read, and whether it is grey.
fn decoder(bytes: &[u8]) -> Result<Opened<'_>, Wrong> {
    let options = DecoderOptions::default().set_max_width(MOST_EDGE).set_max_height(MOST_EDGE).set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| Wrong::broken("header", format!("{e:?}")))?;
    let info = decoder.info().ok_or_else(|| Wrong::broken("header", "it says no size"))?;
    let is_grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let pixels = usize::from(info.width) * usize::from(info.height);
    if pixels > bytes.len().saturating_mul(MOST_RATIO) {
        return Err(Wrong::broken("size", format!("{} bytes hold no {pixels} pixels", bytes.len())));
    }
    let size = [info.width.into(), info.height.into()];
    Ok((decoder, Shape { size, voxel_type: VoxelType::U8 }, is_grey))
}

pub(super) fn shape(bytes: &[u8]) -> Result<Shape, Wrong> {
    decoder(bytes).map(|(_, shape, _)| shape)
}

pub(super) fn decoded(bytes: &[u8]) -> Result<(Shape, Vec<u8>), Wrong> {
    let (mut decoder, shape, is_grey) = decoder(bytes)?;
    let wanted = if is_grey { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(DecoderOptions::default().set_strict_mode(true).jpeg_set_out_colorspace(wanted));
    let data = decoder.decode().map_err(|e| Wrong::broken("pixels", format!("{e:?}")))?;
    if is_grey {
        return Ok((shape, data));
    }
    // Rounded on the way to red, green and blue.
    let is_near = |p: &[u8]| p[0].abs_diff(p[1]) <= 2 && p[1].abs_diff(p[2]) <= 2;
    match data.chunks_exact(3).all(is_near) {
        true => Ok((shape, data.chunks_exact(3).map(|p| p[1]).collect())),
        false => Err(colour()),
    }
}
