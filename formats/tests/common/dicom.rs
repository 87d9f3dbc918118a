//! DICOM as its standard describes it, for tests of what is refused or damaged: what other programs write is read in
//! `interop`.

#![allow(dead_code)] // each test has its own part of it

use std::collections::BTreeMap;

/// A slice of 4 x 3 pixels of 16 bits, whose elements can be replaced.
#[derive(Debug, Clone)]
pub(crate) struct Slice {
    pub(crate) syntax: String,
    elements: BTreeMap<u32, ([u8; 2], Vec<u8>)>,
}

pub(crate) const COLUMNS: usize = 4;
pub(crate) const ROWS: usize = 3;
const LONG: [&[u8; 2]; 4] = [b"OB", b"OW", b"SQ", b"UN"];

fn element(tag: u32, vr: [u8; 2], value: &[u8], length: u32) -> Vec<u8> {
    let mut out = [&((tag >> 16) as u16).to_le_bytes()[..], &(tag as u16).to_le_bytes(), &vr].concat();
    match LONG.contains(&&vr) {
        true => out.extend([&[0, 0][..], &length.to_le_bytes()].concat()),
        false => out.extend((length as u16).to_le_bytes()),
    }
    out.extend_from_slice(value);
    out
}

fn whole(tag: u32, vr: [u8; 2], value: &[u8]) -> Vec<u8> {
    let mut value = value.to_vec();
    if value.len() % 2 == 1 {
        value.push(if vr == *b"UI" || vr == *b"OB" { 0 } else { b' ' });
    }
    element(tag, vr, &value, value.len() as u32)
}

impl Slice {
    /// At `z` times 2.5 mm; its pixels are its number.
    pub(crate) fn at(z: u16) -> Self {
        let mut slice = Self { syntax: "1.2.840.10008.1.2.1".into(), elements: BTreeMap::new() };
        for (tag, vr, value) in [
            (0x0008_0060, b"CS", "CT"),
            (0x0008_103e, b"LO", "chest"),
            (0x0020_000e, b"UI", "1.2.3"),
            (0x0020_0013, b"IS", &z.to_string()),
            (0x0020_0032, b"DS", &format!("1\\2\\{}", f64::from(z) * 2.5)),
            (0x0020_0037, b"DS", "1\\0\\0\\0\\1\\0"),
            (0x0028_0030, b"DS", "0.5\\0.25"),
            (0x0028_0004, b"CS", "MONOCHROME2"),
        ] {
            slice.text(tag, vr, value);
        }
        let shape = [(0x0028_0002, 1), (0x0028_0010, ROWS as u16), (0x0028_0011, COLUMNS as u16)];
        let bits = [(0x0028_0100, 16), (0x0028_0101, 16), (0x0028_0102, 15), (0x0028_0103, 0)];
        shape.iter().chain(&bits).for_each(|(tag, value)| slice.short(*tag, *value));
        slice.pixels(&[z; ROWS * COLUMNS].map(u16::to_le_bytes).concat())
    }

    pub(crate) fn put(&mut self, tag: u32, vr: &[u8; 2], value: &[u8]) {
        self.elements.insert(tag, (*vr, value.to_vec()));
    }

    pub(crate) fn text(&mut self, tag: u32, vr: &[u8; 2], value: &str) {
        self.put(tag, vr, value.as_bytes());
    }

    pub(crate) fn short(&mut self, tag: u32, value: u16) {
        self.put(tag, b"US", &value.to_le_bytes());
    }

    pub(crate) fn without(&mut self, tag: u32) {
        self.elements.remove(&tag);
    }

    pub(crate) fn pixels(mut self, pixels: &[u8]) -> Self {
        self.put(0x7fe0_0010, b"OW", pixels);
        self
    }

    /// Pixels in fragments, behind an empty table.
    pub(crate) fn fragments(&mut self, syntax: &str, fragments: &[&[u8]]) {
        self.syntax = syntax.into();
        let mut value = Vec::new();
        for fragment in [&[&[][..]], fragments].concat() {
            let length = fragment.len().next_multiple_of(2);
            value.extend([&[0xfe, 0xff, 0, 0xe0][..], &(length as u32).to_le_bytes(), fragment].concat());
            value.resize(value.len() + length - fragment.len(), 0);
        }
        value.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
        self.put(0x7fe0_0010, b"OB", &value);
    }

    /// A sequence of one item each of these elements.
    pub(crate) fn sequence(&mut self, tag: u32, items: &[Vec<u8>]) {
        let value = sequence(items);
        self.put(tag, b"SQ", &value);
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let meta = whole(0x0002_0010, *b"UI", self.syntax.as_bytes());
        let length = whole(0x0002_0000, *b"UL", &(meta.len() as u32).to_le_bytes());
        let mut out = [&[0; 128][..], b"DICM", &length, &meta].concat();
        for (tag, (vr, value)) in &self.elements {
            match *tag == 0x7fe0_0010 && vr == b"OB" {
                true => out.extend(element(*tag, *vr, value, u32::MAX)),
                false => out.extend(whole(*tag, *vr, value)),
            }
        }
        out
    }
}

pub(crate) fn sequence(items: &[Vec<u8>]) -> Vec<u8> {
    items.iter().flat_map(|item| item_head(item.len()).into_iter().chain(item.clone())).collect()
}

fn item_head(length: usize) -> Vec<u8> {
    [&[0xfe, 0xff, 0, 0xe0][..], &(length as u32).to_le_bytes()].concat()
}

/// An element for an item.
pub(crate) fn part(tag: u32, vr: &[u8; 2], value: &[u8]) -> Vec<u8> {
    whole(tag, *vr, value)
}
