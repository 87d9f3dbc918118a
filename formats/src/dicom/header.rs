//! A file's header: everything before its pixels, of which little is kept.

use std::collections::HashMap;
use std::io;
use std::path::Path;

use super::bytes::Bytes;
use super::group::{Group, decimals, text};
use super::meta::{self, UNDEFINED, io_wrong, is_long};
use super::syntax::Syntax;
use super::tags;
use crate::wrong::Wrong;

/// Longer values of the kept tags are none of theirs.
const LONGEST: u64 = 4096;
const LONGEST_OF_FRAMES: u64 = 16 << 20;
const MOST_DEPTH: u32 = 32;
pub(super) const MOST_FRAMES: usize = 1 << 18;
const MOST_FRAGMENTS: usize = 1 << 20;

/// Where pixels begin, counted in the data set's bytes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PixelData {
    pub(super) tag: u32,
    pub(super) start: u64,
    /// Words of 16 bits rather than bytes.
    pub(super) is_words: bool,
    /// Nothing where they lie in fragments.
    pub(super) length: Option<u64>,
    /// Their places: first byte and length.
    pub(super) fragments: Vec<(u64, u32)>,
    /// The fragment that each frame begins with, by how far it is behind the first; empty where it is not said.
    pub(super) frame_starts: Vec<u64>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) syntax: Syntax,
    /// Where the data set begins in the file.
    pub(super) start: u64,
    /// The end of the data set, as far as it is known.
    pub(super) end: u64,
    pub(super) kept: HashMap<u32, Vec<u8>>,
    pub(super) own: Group,
    pub(super) shared: Group,
    pub(super) frames: Vec<Group>,
    /// There are groups of frames that are not there.
    pub(super) has_more_groups: bool,
    /// Values come from a table, not from slope and intercept.
    pub(super) has_table: bool,
    pub(super) pixels: Option<PixelData>,
}

/// Which group elements of a sequence's items belong to.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    Own,
    Shared,
    PerFrame,
    Frame(usize),
    Aside,
}

struct Element {
    tag: u32,
    vr: [u8; 2],
    length: u32,
}

/// The header of the file, whose start has the magic.
pub(super) fn read(path: &Path) -> Result<Header, Wrong> {
    let (syntax, start) = meta::read(path)?;
    let opened = match syntax.is_deflated {
        true => Bytes::deflated(path, start),
        false => Bytes::plain(path, start, syntax.is_big),
    };
    let bytes = opened.map_err(|reason| io_wrong(reason, start))?;
    let end = bytes.end();
    let header = Header {
        syntax,
        start,
        end,
        kept: HashMap::new(),
        own: Group::default(),
        shared: Group::default(),
        frames: Vec::new(),
        has_more_groups: false,
        has_table: false,
        pixels: None,
    };
    let mut walk = Walk { bytes, header, most_frames: 0, is_first: true };
    walk.data_set(None, syntax.is_implicit, Target::Own, 0)?;
    Ok(walk.header)
}

struct Walk {
    bytes: Bytes,
    header: Header,
    /// As many as the file says it has.
    most_frames: usize,
    is_first: bool,
}

impl Walk {
    fn failed(&self, reason: io::Error) -> Wrong {
        io_wrong(reason, self.bytes.at)
    }

    fn tag(&mut self) -> Result<u32, Wrong> {
        let pair = self.bytes.u16().and_then(|group| Ok((group, self.bytes.u16()?)));
        let (group, element) = pair.map_err(|e| self.failed(e))?;
        Ok(u32::from(group) << 16 | u32::from(element))
    }

    fn length(&mut self) -> Result<u32, Wrong> {
        self.bytes.u32().map_err(|e| self.failed(e))
    }

    fn skip(&mut self, length: u64) -> Result<(), Wrong> {
        self.bytes.skip(length).map_err(|e| self.failed(e))
    }

    /// The next element's head; nothing at the end.
    fn element(&mut self, is_implicit: &mut bool) -> Result<Option<Element>, Wrong> {
        let head = self.bytes.exact_or_end::<4>().map_err(|e| self.failed(e))?;
        let Some([a, b, c, d]) = head else { return Ok(None) };
        let pair = |a, b| match self.bytes.is_big {
            true => u32::from(u16::from_be_bytes([a, b])),
            false => u32::from(u16::from_le_bytes([a, b])),
        };
        let tag = pair(a, b) << 16 | pair(c, d);
        if matches!(tag, tags::ITEM | tags::ITEM_END | tags::SEQUENCE_END) {
            return Ok(Some(Element { tag, vr: [0; 2], length: self.length()? }));
        }
        let raw = self.bytes.exact::<4>().map_err(|e| self.failed(e))?;
        let vr = [raw[0], raw[1]];
        if std::mem::take(&mut self.is_first) {
            // Some files say one thing and do the other.
            *is_implicit = !vr.iter().all(u8::is_ascii_uppercase);
        }
        let numbers = |raw: [u8; 4]| if self.bytes.is_big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) };
        if *is_implicit {
            return Ok(Some(Element { tag, vr: *b"  ", length: numbers(raw) }));
        }
        if !vr.iter().all(u8::is_ascii_uppercase) {
            let why =
                format!("the element {:04x},{:04x} at byte {} has no type", tag >> 16, tag & 0xffff, self.bytes.at);
            return Err(Wrong::broken("data set", why));
        }
        let length = match is_long(vr) {
            true => self.length()?,
            false if self.bytes.is_big => u16::from_be_bytes([raw[2], raw[3]]).into(),
            false => u16::from_le_bytes([raw[2], raw[3]]).into(),
        };
        Ok(Some(Element { tag, vr, length }))
    }

    /// Elements up to `end`, or to the end of their item or of the file.
    fn data_set(&mut self, end: Option<u64>, is_implicit: bool, target: Target, depth: u32) -> Result<(), Wrong> {
        let mut is_implicit = is_implicit;
        while end.is_none_or(|end| self.bytes.at < end) {
            let Some(element) = self.element(&mut is_implicit)? else {
                return match depth {
                    0 => Ok(()),
                    _ => Err(self.failed(io::ErrorKind::UnexpectedEof.into())),
                };
            };
            let Element { tag, vr, length } = element;
            match tag {
                tags::ITEM_END => return Ok(()),
                tags::PIXELS | tags::FLOATS | tags::DOUBLES if target == Target::Own => {
                    return self.pixel_data(&element, is_implicit);
                }
                _ if length == UNDEFINED && [b"OB", b"OW"].contains(&&vr) => {
                    self.fragments(&mut None)?;
                }
                _ if length == UNDEFINED || self.is_wanted_sequence(tag, target) => {
                    let is_implicit = is_implicit || vr == *b"UN";
                    let end = (length != UNDEFINED).then(|| self.bytes.at + u64::from(length));
                    self.sequence(end, is_implicit, within(tag, target), depth + 1)?;
                }
                _ => self.value(tag, length.into(), target)?,
            }
        }
        Ok(())
    }

    fn is_wanted_sequence(&self, tag: u32, target: Target) -> bool {
        within(tag, target) != Target::Aside
    }

    fn sequence(&mut self, end: Option<u64>, is_implicit: bool, target: Target, depth: u32) -> Result<(), Wrong> {
        if depth > MOST_DEPTH {
            return Err(Wrong::broken("data set", format!("more than {MOST_DEPTH} sequences within each other")));
        }
        let mut item = 0;
        while end.is_none_or(|end| self.bytes.at < end) {
            let (at, tag, length) = (self.bytes.at, self.tag()?, self.length()?);
            match tag {
                tags::SEQUENCE_END => return Ok(()),
                tags::ITEM => {}
                _ => {
                    let why = format!("no item at byte {at}, but {:04x},{:04x}", tag >> 16, tag & 0xffff);
                    return Err(Wrong::broken("data set", why));
                }
            }
            let of_item = match target {
                Target::PerFrame => self.frame(item)?,
                target => target,
            };
            item += 1;
            match (length, of_item) {
                (UNDEFINED, _) => self.data_set(None, is_implicit, of_item, depth)?,
                (length, Target::Aside) => self.skip(length.into())?,
                (length, _) => {
                    let end = self.bytes.at + u64::from(length);
                    self.data_set(Some(end), is_implicit, of_item, depth)?;
                }
            }
        }
        Ok(())
    }

    /// Where the group of a frame goes; more than there are frames have no place.
    fn frame(&mut self, item: usize) -> Result<Target, Wrong> {
        if item == 0 {
            let frames = self.header.kept.get(&tags::FRAMES).and_then(|n| text(n).parse().ok()).unwrap_or(1);
            (self.most_frames, self.header.frames) = (frames, Vec::new());
        }
        if item >= self.most_frames {
            self.header.has_more_groups = true;
            return Ok(Target::Aside);
        }
        if item >= MOST_FRAMES {
            return Err(Wrong::broken("PerFrameFunctionalGroupsSequence", format!("more than {MOST_FRAMES} items")));
        }
        self.header.frames.push(Group::default());
        Ok(Target::Frame(item))
    }

    fn value(&mut self, tag: u32, length: u64, target: Target) -> Result<(), Wrong> {
        let most = match tag {
            _ if target == Target::Own && tags::LONG.contains(&tag) => LONGEST_OF_FRAMES,
            _ => LONGEST,
        };
        let is_kept = target == Target::Own && (tags::KEPT.contains(&tag) || tags::LONG.contains(&tag));
        self.header.has_table |= target == Target::Own && tag == tags::VALUE_TABLE;
        if target == Target::Aside || length > most || !(is_kept || tags::KEPT.contains(&tag)) {
            return self.skip(length);
        }
        let value = self.bytes.take(length).map_err(|e| self.failed(e))?;
        let group = match target {
            Target::Shared => &mut self.header.shared,
            Target::Frame(i) => &mut self.header.frames[i],
            _ => &mut self.header.own,
        };
        group.put(tag, &value)?;
        if is_kept {
            self.header.kept.insert(tag, value);
        }
        Ok(())
    }

    fn pixel_data(&mut self, element: &Element, is_implicit: bool) -> Result<(), Wrong> {
        let start = self.bytes.at;
        let is_words = is_implicit || element.vr == *b"OW";
        let mut pixels = PixelData {
            tag: element.tag,
            start,
            is_words,
            length: Some(element.length.into()),
            fragments: Vec::new(),
            frame_starts: Vec::new(),
        };
        if element.length == UNDEFINED {
            let mut found = Some(Vec::new());
            self.fragments(&mut found)?;
            pixels.length = None;
            let mut fragments = found.unwrap_or_default();
            if fragments.is_empty() {
                return Err(Wrong::broken("PixelData", "it has no fragments"));
            }
            let (table, length) = fragments.remove(0);
            pixels.frame_starts = self.frame_starts(table, length)?;
            pixels.fragments = fragments;
        }
        self.header.pixels = Some(pixels);
        Ok(())
    }

    /// From the extended table, else from the basic one.
    fn frame_starts(&mut self, table: u64, length: u32) -> Result<Vec<u64>, Wrong> {
        if let Some(extended) = self.header.kept.get(&tags::FRAME_STARTS).filter(|table| !table.is_empty()) {
            return Ok(extended.as_chunks::<8>().0.iter().map(|n| u64::from_le_bytes(*n)).collect());
        }
        if u64::from(length) > LONGEST_OF_FRAMES || length == 0 || self.header.syntax.is_deflated {
            return Ok(Vec::new());
        }
        // Nothing is read behind the fragments.
        let numbers = self.bytes.back(table).and_then(|()| self.bytes.take(length.into()));
        let numbers = numbers.map_err(|e| io_wrong(e, table))?;
        Ok(numbers.as_chunks::<4>().0.iter().map(|n| u32::from_le_bytes(*n).into()).collect())
    }

    /// Skips fragments, and keeps where they lie if somebody asks.
    fn fragments(&mut self, found: &mut Option<Vec<(u64, u32)>>) -> Result<(), Wrong> {
        loop {
            let (at, tag, length) = (self.bytes.at, self.tag()?, self.length()?);
            match tag {
                tags::SEQUENCE_END => return Ok(()),
                tags::ITEM if length != UNDEFINED => {}
                _ => return Err(Wrong::broken("PixelData", format!("no fragment at byte {at}"))),
            }
            if let Some(found) = found {
                if found.len() > MOST_FRAGMENTS {
                    return Err(Wrong::broken("PixelData", format!("more than {MOST_FRAGMENTS} fragments")));
                }
                found.push((self.bytes.at, length));
            }
            self.skip(length.into())?;
        }
    }
}

/// Which group the items of a sequence belong to.
fn within(tag: u32, target: Target) -> Target {
    match (tag, target) {
        (tags::SHARED, Target::Own) => Target::Shared,
        (tags::PER_FRAME, Target::Own) => Target::PerFrame,
        (tag, Target::Shared | Target::Frame(_)) if tags::GROUPS.contains(&tag) => target,
        _ => Target::Aside,
    }
}

impl Header {
    pub(super) fn text(&self, tag: u32) -> Option<String> {
        self.kept.get(&tag).map(|value| text(value)).filter(|text| !text.is_empty())
    }

    pub(super) fn decimals(&self, tag: u32) -> Result<Vec<f64>, Wrong> {
        self.kept.get(&tag).map_or(Ok(Vec::new()), |value| decimals(tag, value))
    }

    pub(super) fn whole(&self, tag: u32) -> Option<i64> {
        self.text(tag)?.parse().ok()
    }

    /// A number of 16 bits.
    pub(super) fn short(&self, tag: u32) -> Option<u16> {
        let bytes = *self.kept.get(&tag)?.first_chunk::<2>()?;
        Some(if self.syntax.is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }
}
