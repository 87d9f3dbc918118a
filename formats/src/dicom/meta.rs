//! How a file of DICOM begins: its mark, and the group of meta data that says how the rest is written down.

use std::io;
use std::path::Path;

use super::bytes::Bytes;
use super::group::text;
use super::syntax::{self, Syntax};
use super::tags;
use crate::wrong::{EXPORT_AGAIN, Wrong};

pub(super) const MAGIC_AT: usize = 128;
const MAGIC: &[u8] = b"DICM";
/// What files without a preamble begin with: the length of the group of meta data.
const BARE: &[u8] = b"\x02\0\0\0UL\x04\0";
pub(super) const UNDEFINED: u32 = u32::MAX;
/// No identifier is longer.
const LONGEST: u64 = 4096;

pub(crate) fn has_magic(start: &[u8]) -> bool {
    start.get(MAGIC_AT..MAGIC_AT + MAGIC.len()) == Some(MAGIC) || start.starts_with(BARE)
}

pub(super) fn io_wrong(reason: io::Error, at: u64) -> Wrong {
    match reason.kind() {
        io::ErrorKind::UnexpectedEof => Wrong::broken("data set", format!("the file ends in it, at byte {at}")),
        _ => Wrong::new("data set", format!("at byte {at}: {reason}"), EXPORT_AGAIN),
    }
}

/// Group 2, always little endian with explicit types: the transfer syntax, and where the data set begins.
pub(super) fn read(path: &Path) -> Result<(Syntax, u64), Wrong> {
    let failed = |reason: io::Error| io_wrong(reason, 0);
    let mut bytes = Bytes::plain(path, 0, false).map_err(failed)?;
    let start = bytes.exact::<{ MAGIC_AT + 4 }>().map_err(failed)?;
    let at = if start.ends_with(MAGIC) { MAGIC_AT as u64 + 4 } else { 0 };
    let mut bytes = Bytes::plain(path, at, false).map_err(failed)?;
    let mut uid = None;
    loop {
        let at = bytes.at;
        let failed = |reason: io::Error| io_wrong(reason, at);
        let Some(tag) = bytes.exact_or_end::<4>().map_err(failed)? else { return Ok((syntax(uid)?, at)) };
        if tag[..2] != [2, 0] {
            return Ok((syntax(uid)?, at));
        }
        let tag = 0x0002_0000 | u32::from(u16::from_le_bytes([tag[2], tag[3]]));
        let vr: [u8; 2] = bytes.exact().map_err(failed)?;
        let length = match is_long(vr) {
            true => bytes.u16().and_then(|_| bytes.u32()).map_err(failed)?,
            false => bytes.u16().map_err(failed)?.into(),
        };
        match tag == tags::SYNTAX && u64::from(length) <= LONGEST {
            true => uid = Some(text(&bytes.take(length.into()).map_err(failed)?)),
            false if tag == tags::META_LENGTH || length != UNDEFINED => bytes.skip(length.into()).map_err(failed)?,
            false => return Err(Wrong::broken("meta data", format!("the element at byte {at} has no length"))),
        }
    }
}

/// Without one the default, which the first element may belie.
fn syntax(uid: Option<String>) -> Result<Syntax, Wrong> {
    let Some(uid) = uid else { return Ok(syntax::IMPLICIT) };
    syntax::of(&uid).ok_or_else(|| {
        let why = format!("`{}` is not known", brickcast_volume::format::excerpt(&uid));
        Wrong::new("TransferSyntaxUID", why, "rewrite it, e.g. with gdcmconv --raw IN OUT")
    })
}

/// Types with lengths of 32 bits.
pub(super) fn is_long(vr: [u8; 2]) -> bool {
    let long = [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];
    long.contains(&&vr)
}
