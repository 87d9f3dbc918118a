//! Filters of chunks, each read up to what is due and a little more: no stream says what it costs.

use std::io::Read as _;

use hdf5_reader::FilterRegistry;
use hdf5_reader::filters::fletcher32;
use hdf5_reader::messages::filter_pipeline::FilterDescription;

use super::{bitshuffle, lz};
use crate::wrong::Wrong;

const DEFLATE: u16 = 1;
const SHUFFLE: u16 = 2;
const FLETCHER32: u16 = 3;
const SZIP: u16 = 4;
const NBIT: u16 = 5;
const SCALE_OFFSET: u16 = 6;
const LZF: u16 = 32000;
const LZ4: u16 = 32004;
const BITSHUFFLE: u16 = 32008;
const ZSTD: u16 = 32015;
const READ: [u16; 10] = [DEFLATE, SHUFFLE, FLETCHER32, SZIP, NBIT, SCALE_OFFSET, LZF, LZ4, BITSHUFFLE, ZSTD];
/// The window that a frame of zstd may ask for, as a power of 2.
const WINDOW: u32 = 27;
/// What checksums and frames add to a chunk on its way.
const AROUND: usize = 64 << 10;

fn name(filter: &FilterDescription) -> String {
    match filter.id {
        DEFLATE => "deflate".into(),
        SHUFFLE => "shuffle".into(),
        FLETCHER32 => "Fletcher32".into(),
        SZIP => "szip".into(),
        NBIT => "nbit".into(),
        SCALE_OFFSET => "scale-offset".into(),
        307 => "bzip2".into(),
        LZF => "LZF".into(),
        32001 => "Blosc".into(),
        LZ4 => "LZ4".into(),
        BITSHUFFLE => "bitshuffle".into(),
        32013 => "ZFP".into(),
        ZSTD => "zstd".into(),
        32026 => "Blosc2".into(),
        id => format!("filter {id}"),
    }
}

/// Refuses by name what is not read, before anything is.
pub(super) fn check(filters: &[FilterDescription]) -> Result<(), Wrong> {
    match filters.iter().find(|filter| !READ.contains(&filter.id)) {
        None => Ok(()),
        Some(filter) => {
            let why = format!("chunks in {} are not read", name(filter));
            Err(Wrong::new("filter", why, "save it with deflate: h5repack -f GZIP=1 IN OUT"))
        }
    }
}

/// A chunk of `bytes` out of what is stored; bit i of `mask` leaves filter i out.
pub(super) fn decoded(
    stored: Vec<u8>,
    filters: &[FilterDescription],
    mask: u32,
    element: usize,
    bytes: usize,
) -> Result<Vec<u8>, Wrong> {
    let mut data = stored;
    for (i, filter) in filters.iter().enumerate().rev() {
        if mask.checked_shr(i as u32).is_some_and(|bits| bits & 1 == 1) {
            continue;
        }
        let most = bytes.saturating_add(bytes / 8).saturating_add(AROUND);
        let own = |decoded: Option<Vec<u8>>| {
            decoded.ok_or_else(|| Wrong::broken("chunk", format!("{} is broken in it", name(filter))))
        };
        data = match filter.id {
            DEFLATE => own(deflated(&data, most))?,
            SHUFFLE => unshuffled(data, filter.client_data.first().map_or(element, |n| *n as usize)),
            FLETCHER32 => fletcher32::verify_and_strip(&data).map_err(|e| Wrong::broken("chunk", e))?,
            LZF => own(lz::lzf(&data, most))?,
            LZ4 => own(lz::lz4(&data, most))?,
            BITSHUFFLE => own(bitshuffle::decoded(&data, &filter.client_data, most))?,
            ZSTD => own(zstd(&data, most))?,
            _ => {
                let apply = FilterRegistry::new().apply_with_limit(filter, &data, element, Some(bytes));
                apply.map_err(|e| Wrong::broken("chunk", e))?
            }
        };
    }
    match data.len() == bytes {
        true => Ok(data),
        false => Err(Wrong::broken("chunk", format!("{} bytes are in it, and {bytes} are due", data.len()))),
    }
}

fn at_most(reader: impl std::io::Read, most: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    reader.take(most as u64 + 1).read_to_end(&mut out).ok()?;
    (out.len() <= most).then_some(out)
}

fn deflated(data: &[u8], most: usize) -> Option<Vec<u8>> {
    at_most(flate2::read::ZlibDecoder::new(data), most)
}

pub(super) fn zstd(data: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(data).ok()?;
    decoder.window_log_max(WINDOW).ok()?;
    at_most(decoder, most)
}

/// First bytes of all numbers, then second ones, and so on; what is no whole number follows.
fn unshuffled(data: Vec<u8>, element: usize) -> Vec<u8> {
    let count = data.len().checked_div(element).unwrap_or(0);
    if element < 2 || count < 2 {
        return data;
    }
    let mut out = data.clone();
    for byte in 0..element {
        for (number, value) in data[byte * count..(byte + 1) * count].iter().enumerate() {
            out[number * element + byte] = *value;
        }
    }
    out
}
