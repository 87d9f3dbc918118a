//! Tiles as they travel: runs of active pixels, byte planes, LZ4 where it is smaller, and a crc32c.

use brickcast_volume::scene::Transport;
use brickcast_volume::{PixelKind, Pixels, RawPixel};
use bytes::Bytes;
use glam::UVec2;
use half::f16;

use crate::tile_rect::TILE;

/// Pixels of a whole tile.
pub(crate) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The active pixels of one tile. Shape is valid by construction: runs fit a tile and agree with the payload's length.
/// The checksum, the kind and the values are verified by [`decode_tile`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedTile {
    /// None where the message left it out.
    pub(crate) kind: Option<PixelKind>,
    pub(crate) format: Transport,
    /// Skipped and kept pixel counts in turn, starting with skipped (may be 0), ending with kept.
    pub(crate) runs: Vec<u32>,
    pub(crate) lz4: bool,
    pub(crate) payload: Bytes,
    pub(crate) crc32c: u32,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TileError {
    #[error("tile runs: {0}")]
    Runs(String),
    #[error("tile runs cover {covered} pixels, the tile has {pixels}")]
    Beyond { covered: usize, pixels: usize },
    #[error("tile payload of {got} bytes: {kept} pixels need {want} (less where LZ4 packed)")]
    Payload { got: usize, kept: usize, want: usize },
    #[error("tile has crc32c {got:08x}, its header says {want:08x}: damaged on the way; order it again")]
    Checksum { got: u32, want: u32 },
    #[error("tile payload is not an LZ4 block of {want} bytes: {reason}")]
    Lz4 { want: usize, reason: String },
    #[error(
        "tile holds pixels of kind `{got}`, the order's scene has `{want}`: damaged on the way, or of another order; \
         order it again"
    )]
    Kind { got: PixelKind, want: PixelKind },
    #[error("tile holds pixels of kind `{kind}` as {format}: they travel as f32 alone; order them so")]
    Format { kind: PixelKind, format: Transport },
    #[error("tile pixel {index} is {value:?}: {}", .kind.rule())]
    Value { index: usize, kind: PixelKind, value: RawPixel },
}

impl EncodedTile {
    /// Checks the shape of what came over the wire.
    ///
    /// # Errors
    /// Runs that are no partition of a tile's pixels, a payload of another length than they promise.
    pub(crate) fn from_parts(
        kind: Option<PixelKind>,
        format: Transport,
        runs: Vec<u32>,
        lz4: bool,
        payload: Bytes,
        crc32c: u32,
    ) -> Result<Self, TileError> {
        if runs.is_empty() || !runs.len().is_multiple_of(2) {
            return Err(TileError::Runs(format!("{} of them, an even number from 2 is needed", runs.len())));
        }
        if runs.len() > TILE_PIXELS + 1 {
            return Err(TileError::Runs(format!("{} of them, more than a tile has pixels", runs.len())));
        }
        if let Some(index) = runs.iter().skip(1).position(|&r| r == 0) {
            return Err(TileError::Runs(format!("run {} is 0; only the first may be", index + 1)));
        }
        let covered = runs.iter().fold(0_usize, |sum, &r| sum.saturating_add(r as usize));
        if covered > TILE_PIXELS {
            return Err(TileError::Beyond { covered, pixels: TILE_PIXELS });
        }
        let tile = Self { kind, format, runs, lz4, payload, crc32c };
        let (got, want) = (tile.payload.len(), tile.plane_bytes());
        // A packed payload is only ever sent where it is smaller.
        if (!lz4 && got != want) || (lz4 && (got == 0 || got >= want)) {
            return Err(TileError::Payload { got, kept: tile.kept(), want });
        }
        Ok(tile)
    }

    #[must_use]
    pub fn format(&self) -> Transport {
        self.format
    }

    /// Bytes of the payload as sent.
    #[must_use]
    pub fn payload_bytes(&self) -> usize {
        self.payload.len()
    }

    /// Active pixels.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.runs.iter().skip(1).step_by(2).map(|&r| r as usize).sum()
    }

    fn plane_bytes(&self) -> usize {
        self.kept() * pixel_bytes(self.format)
    }
}

/// Bytes of one RGBA pixel.
fn pixel_bytes(format: Transport) -> usize {
    match format {
        Transport::F16 => 8,
        Transport::F32 => 16,
        Transport::U8 => 4,
    }
}

/// Packs the pixels of a tile (row-major, clipped to the picture). `None` where all of them are clear as they would
/// travel.
///
/// f32 keeps the very bits; f16 rounds to the nearest; u8 is `round(255 v)`, premultiplied, clamped.
#[must_use]
pub fn encode_tile(pixels: &Pixels, format: Transport) -> Option<EncodedTile> {
    let bytes = pixel_bytes(format);
    let mut runs: Vec<u32> = Vec::new();
    let mut interleaved: Vec<u8> = Vec::with_capacity(pixels.len() * bytes);
    let (mut skipped, mut kept) = (0_u32, 0_u32);
    for pixel in pixels.raw() {
        let at = interleaved.len();
        push_pixel(&mut interleaved, *pixel, format);
        if interleaved[at..].iter().all(|&b| b == 0) {
            interleaved.truncate(at);
            if kept > 0 {
                runs.extend([skipped, kept]);
                (skipped, kept) = (0, 0);
            }
            skipped += 1;
        } else {
            kept += 1;
        }
    }
    if kept > 0 {
        runs.extend([skipped, kept]);
    }
    if runs.is_empty() {
        return None;
    }
    let planes = to_planes(&interleaved, bytes);
    let packed = lz4_flex::block::compress(&planes);
    let (lz4, payload) = if packed.len() < planes.len() { (true, packed) } else { (false, planes) };
    let crc32c = checksum(&runs, &payload);
    Some(EncodedTile { kind: Some(pixels.kind()), format, runs, lz4, payload: payload.into(), crc32c })
}

/// Of the runs, little endian, then the payload as sent: a damaged run would shift pixels that are whole themselves.
fn checksum(runs: &[u32], payload: &[u8]) -> u32 {
    let runs: Vec<u8> = runs.iter().flat_map(|run| run.to_le_bytes()).collect();
    crc32c::crc32c_append(crc32c::crc32c(&runs), payload)
}

/// All pixels of a tile of `size` pixels (clipped to the picture), row-major; clear where none was sent. `kind` is what
/// the order's scene has: a tile that does not say what it holds holds that.
///
/// # Errors
/// Pixels of another kind, or in a format that this kind does not travel in; a checksum that does not match, runs
/// beyond `size`, a broken LZ4 block, values that no pixel of the kind has.
pub fn decode_tile(tile: &EncodedTile, size: UVec2, kind: PixelKind) -> Result<Pixels, TileError> {
    if let Some(got) = tile.kind.filter(|got| *got != kind) {
        return Err(TileError::Kind { got, want: kind });
    }
    if !tile.format.carries(kind) {
        return Err(TileError::Format { kind, format: tile.format });
    }
    let pixels = (size.x as usize).saturating_mul(size.y as usize).min(TILE_PIXELS);
    let covered: usize = tile.runs.iter().map(|&r| r as usize).sum();
    if covered > pixels {
        return Err(TileError::Beyond { covered, pixels });
    }
    let got = checksum(&tile.runs, &tile.payload);
    if got != tile.crc32c {
        return Err(TileError::Checksum { got, want: tile.crc32c });
    }
    let want = tile.plane_bytes();
    let unpacked;
    let planes: &[u8] = if tile.lz4 {
        let mut buffer = vec![0; want];
        let written = lz4_flex::block::decompress_into(&tile.payload, &mut buffer)
            .map_err(|e| TileError::Lz4 { want, reason: e.to_string() })?;
        if written != want {
            return Err(TileError::Lz4 { want, reason: format!("it holds {written}") });
        }
        unpacked = buffer;
        &unpacked
    } else {
        &tile.payload
    };
    let kept = tile.kept();
    if planes.len() != want {
        return Err(TileError::Payload { got: planes.len(), kept, want });
    }
    let mut picture = vec![[0.0; 4]; pixels];
    let (mut at, mut next) = (0, 0);
    for pair in tile.runs.chunks_exact(2) {
        at += pair[0] as usize;
        for pixel in &mut picture[at..at + pair[1] as usize] {
            let value = pull_pixel(planes, kept, next, tile.format);
            if !kind.is_valid(value) {
                return Err(TileError::Value { index: at, kind, value });
            }
            *pixel = value;
            next += 1;
        }
        at += pair[1] as usize;
    }
    Ok(Pixels::from_raw(kind, picture))
}

fn push_pixel(bytes: &mut Vec<u8>, pixel: RawPixel, format: Transport) {
    for value in pixel {
        match format {
            Transport::F16 => bytes.extend(f16::from_f32(value).to_le_bytes()),
            Transport::F32 => bytes.extend(value.to_le_bytes()),
            // A NaN becomes 0 by the cast; it cannot travel in a byte.
            Transport::U8 => bytes.push((value * 255.0).round().clamp(0.0, 255.0) as u8),
        }
    }
}

/// Byte `b` of all pixels, then byte `b + 1`: alike bytes side by side are what LZ4 packs.
fn to_planes(interleaved: &[u8], pixel_bytes: usize) -> Vec<u8> {
    (0..pixel_bytes).flat_map(|b| interleaved.iter().skip(b).step_by(pixel_bytes).copied()).collect()
}

/// Pixel `index` of `count` from byte planes; `planes` holds `count` whole pixels.
fn pull_pixel(planes: &[u8], count: usize, index: usize, format: Transport) -> RawPixel {
    let byte = |b: usize| planes[b * count + index];
    std::array::from_fn(|channel| match format {
        Transport::F16 => f16::from_le_bytes([byte(2 * channel), byte(2 * channel + 1)]).to_f32(),
        Transport::F32 => f32::from_le_bytes(std::array::from_fn(|b| byte(4 * channel + b))),
        Transport::U8 => f32::from(byte(channel)) / 255.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn colors(pixels: &[RawPixel]) -> Pixels {
        Pixels::from_raw(PixelKind::Over, pixels.to_vec())
    }

    fn decoded(tile: &EncodedTile, size: UVec2) -> Result<Pixels, TileError> {
        decode_tile(tile, size, PixelKind::Over)
    }

    fn pixel() -> impl Strategy<Value = RawPixel> {
        prop_oneof![
            2 => Just([0.0; 4]),
            3 => prop::array::uniform4(0.0_f32..=1.0),
        ]
    }

    fn tile() -> impl Strategy<Value = (UVec2, Pixels)> {
        (1_u32..=64, 1_u32..=64).prop_flat_map(|(x, y)| {
            prop::collection::vec(pixel(), (x * y) as usize).prop_map(move |p| (UVec2::new(x, y), colors(&p)))
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn tiles_survive_the_wire_within_their_format((size, pixels) in tile()) {
            let bounds = [(Transport::F32, 0.0), (Transport::F16, 0.5 / 2048.0), (Transport::U8, 0.5001 / 255.0)];
            for (format, bound) in bounds {
                let back = match encode_tile(&pixels, format) {
                    Some(encoded) => decoded(&encoded, size).unwrap(),
                    None => Pixels::clear(PixelKind::Over, pixels.len()),
                };
                prop_assert_eq!(back.len(), pixels.len());
                for (a, b) in pixels.raw().iter().zip(back.raw()) {
                    for (x, y) in a.iter().zip(b) {
                        prop_assert!((x - y).abs() <= bound, "{:?}: {} became {}", format, x, y);
                    }
                }
            }
        }
    }

    #[test]
    fn f32_keeps_the_very_bits_tiny_and_negative_zero_included() {
        let bits = [1, 0x8000_0000, 0x3f80_0000, 0x3f7f_ffff].map(f32::from_bits);
        let odd = [bits[0], bits[1], bits[3], bits[2]];
        let zero = [0.0, -0.0, 0.0, 0.0];
        let encoded = encode_tile(&colors(&[[0.0; 4], odd, zero]), Transport::F32).unwrap();
        let back = decoded(&encoded, UVec2::new(3, 1)).unwrap();
        assert_eq!(back.raw()[1].map(f32::to_bits), odd.map(f32::to_bits));
        assert_eq!(back.raw()[2].map(f32::to_bits), zero.map(f32::to_bits));
    }

    #[test]
    fn all_clear_is_no_tile() {
        let faint = colors(&[[1e-4; 4]]);
        for format in [Transport::F16, Transport::F32, Transport::U8] {
            assert_eq!(encode_tile(&colors(&[[0.0; 4]; 77]), format), None);
        }
        assert!(encode_tile(&faint, Transport::F16).is_some());
        assert_eq!(encode_tile(&faint, Transport::U8), None);
    }

    #[test]
    fn damaged_payloads_are_named_not_drawn() {
        let pixels: Vec<RawPixel> = (0..64 * 64).map(|i| [0.0, 0.0, 0.5, (i % 7) as f32 / 7.0]).collect();
        let pixels = colors(&pixels);
        let good = encode_tile(&pixels, Transport::F16).unwrap();
        assert!(good.lz4, "plain content packs");
        let full = UVec2::splat(TILE);
        for at in 0..good.payload.len() {
            let mut payload = good.payload.to_vec();
            payload[at] ^= 0x10;
            let bad = EncodedTile { payload: payload.clone().into(), ..good.clone() };
            assert!(matches!(decoded(&bad, full), Err(TileError::Checksum { .. })), "byte {at}");
            // With a matching checksum the block itself must hold: no panic, never another size.
            let crc32c = checksum(&good.runs, &payload);
            let resealed = EncodedTile { payload: payload.into(), crc32c, ..good.clone() };
            if let Ok(picture) = decoded(&resealed, full) {
                assert_eq!(picture.len(), pixels.len());
            }
        }
        assert!(matches!(decoded(&good, UVec2::new(63, 64)), Err(TileError::Beyond { .. })));
    }

    #[test]
    fn values_that_are_no_colour_are_refused() {
        for bad in
            [[f32::NAN, 0.0, 0.0, 1.0], [0.0, f32::INFINITY, 0.0, 1.0], [0.0, 0.0, 0.0, 1.1], [0.0, 0.0, 0.0, -0.1]]
        {
            for format in [Transport::F32, Transport::F16] {
                let encoded = encode_tile(&colors(&[bad]), format).unwrap();
                assert!(matches!(decoded(&encoded, UVec2::ONE), Err(TileError::Value { .. })), "{bad:?}");
            }
        }
    }

    /// By name, whatever its values; one that does not say is what was ordered.
    #[test]
    fn a_tile_of_another_kind_than_was_ordered_is_refused() {
        let codes = Pixels::from_raw(PixelKind::Largest, vec![[0.25, 0.0, 0.0, 1.0]]);
        let tile = encode_tile(&codes, Transport::F32).unwrap();
        assert_eq!(decode_tile(&tile, UVec2::ONE, PixelKind::Largest).as_ref(), Ok(&codes));
        for want in [PixelKind::Over, PixelKind::Smallest, PixelKind::Mean] {
            let error = decode_tile(&tile, UVec2::ONE, want).unwrap_err();
            assert_eq!(error, TileError::Kind { got: PixelKind::Largest, want });
            let text = error.to_string();
            assert!(text.contains("`largest`") && text.contains(&format!("`{want}`")), "{text}");
            let silent = EncodedTile { kind: None, ..tile.clone() };
            assert_eq!(decode_tile(&silent, UVec2::ONE, want).unwrap().kind(), want);
        }
    }

    #[test]
    fn codes_travel_as_f32_and_are_checked_as_codes() {
        let (kind, pixel) = (PixelKind::Mean, |count| [3.0, count, 0.0, 1.0]);
        let tile = |count, format| encode_tile(&Pixels::from_raw(kind, vec![pixel(count)]), format).unwrap();
        for format in [Transport::F16, Transport::U8] {
            let refused = decode_tile(&tile(6.0, format), UVec2::ONE, kind);
            assert_eq!(refused, Err(TileError::Format { kind, format }));
        }
        assert_eq!(decode_tile(&tile(6.0, Transport::F32), UVec2::ONE, kind).unwrap().raw(), [pixel(6.0)]);
        let error = decode_tile(&tile(6.5, Transport::F32), UVec2::ONE, kind).unwrap_err();
        assert_eq!(error, TileError::Value { index: 0, kind, value: pixel(6.5) });
        assert!(error.to_string().contains("their number whole"), "{error}");
    }

    #[test]
    fn runs_must_partition_the_tile() {
        let part = |runs: &[u32], bytes: usize| {
            EncodedTile::from_parts(None, Transport::U8, runs.to_vec(), false, vec![0; bytes].into(), 0)
        };
        assert!(part(&[0, 4096], 4 * 4096).is_ok() && part(&[4095, 1], 4).is_ok());
        for runs in [&[] as &[u32], &[1], &[0, 0], &[1, 1, 0, 1], &[0, 1, 1], &[0, 4097], &[u32::MAX, u32::MAX]] {
            assert!(part(runs, 4).is_err(), "{runs:?}");
        }
        assert!(part(&[0, 2], 7).is_err() && part(&vec![1; 5000], 4).is_err());
    }
}
