//! What a part says of itself: which one it is, what it was made from, and which files it has.
//!
//! The first line is the hash of all that follows: a bit that flips in it is noticed like one in any other file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::error::PartFault;
use super::number::PartNumber;
use crate::store::hash::ContentHash;

const FORMAT: &str = "brickcast-part";
/// Of the files of a part.
const VERSION: u64 = 1;
/// More than any part says of itself.
pub(super) const MOST_BYTES: u64 = 1 << 20;

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartFile {
    format: String,
    version: u64,
    part: u32,
    parts: u32,
    /// Parts of one store have the same.
    pub(super) made_of: BTreeMap<String, String>,
    /// What a scan found, of the part where this is one's, else of the whole volume; nothing where nothing is mapped.
    pub(super) scan: Option<[u64; 8]>,
    /// All files but this one and shards.
    pub(super) files: BTreeMap<String, FileEntry>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileEntry {
    pub(super) bytes: u64,
    pub(super) hash: String,
}

impl PartFile {
    pub(super) fn new(number: PartNumber, made_of: &BTreeMap<String, String>, scan: Option<[u64; 8]>) -> Self {
        let (format, made_of) = (FORMAT.to_owned(), made_of.clone());
        let PartNumber { index: part, count: parts } = number;
        Self { format, version: VERSION, part, parts, made_of, scan, files: BTreeMap::new() }
    }

    pub(super) fn to_bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let json = serde_json::to_string_pretty(self)?;
        Ok(format!("{}\n{json}\n", ContentHash::of(format!("{json}\n").as_bytes())).into_bytes())
    }

    /// Of part `number`.
    pub(super) fn from_bytes(bytes: &[u8], number: PartNumber) -> Result<Self, PartFault> {
        let text = std::str::from_utf8(bytes).map_err(|error| PartFault::Description(error.to_string()))?;
        let (want, json) = text.split_once('\n').unwrap_or((text, ""));
        let got = ContentHash::of(json.as_bytes()).to_string();
        if got != want {
            // What was cut or damaged may hold anything.
            let want = want.chars().filter(char::is_ascii_hexdigit).take(32).collect();
            return Err(PartFault::Hash { got, want });
        }
        let file: Self = serde_json::from_str(json).map_err(|error| PartFault::Description(error.to_string()))?;
        if (file.format.as_str(), file.version) != (FORMAT, VERSION) {
            let why = format!("{} of version {}; this brickcast makes version {VERSION}", file.format, file.version);
            return Err(PartFault::Description(why));
        }
        match (file.part, file.parts) == (number.index, number.count) {
            true => Ok(file),
            false => Err(PartFault::Misplaced(format!("{}/{}", file.part, file.parts))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_part_says_of_itself_survives_and_no_bit_of_it_may_flip() {
        let number = PartNumber { index: 1, count: 3 };
        let made_of = BTreeMap::from([("--brick".to_owned(), "64".to_owned())]);
        let mut file = PartFile::new(number, &made_of, Some([u64::MAX; 8]));
        file.files.insert("halos.bin".to_owned(), FileEntry { bytes: 3, hash: ContentHash::of(b"abc").to_string() });
        let bytes = file.to_bytes().unwrap();
        assert_eq!(PartFile::from_bytes(&bytes, number), Ok(file));
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bad = bytes.clone();
                bad[at] ^= 1 << bit;
                assert!(PartFile::from_bytes(&bad, number).is_err(), "bit {bit} of byte {at}");
            }
            assert!(PartFile::from_bytes(&bytes[..at], number).is_err(), "cut to {at}");
        }
        let other = PartNumber { index: 2, count: 3 };
        assert_eq!(PartFile::from_bytes(&bytes, other), Err(PartFault::Misplaced("1/3".to_owned())));
    }
}
