//! Voxels written as text: numbers between white space, or two hexadecimal digits a byte. Memory does not grow with the
//! text.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read};

use super::coded::Decoder;
use super::excerpt::excerpt;
use super::voxel_type::VoxelType;

/// No number needs more: an f64 written out in full has 1,077 characters.
const LONGEST_NUMBER: usize = 1100;

/// Numbers as little-endian voxels.
#[derive(Debug)]
pub(super) struct AsciiVoxels {
    text: BufReader<File>,
    voxel_type: VoxelType,
    /// Numbers read so far.
    count: u64,
    /// Bytes of a number that did not fit into a reader's buffer.
    left: Vec<u8>,
}

impl AsciiVoxels {
    pub(super) fn new(text: BufReader<File>, voxel_type: VoxelType) -> Self {
        Self { text, voxel_type, count: 0, left: Vec::new() }
    }

    /// The next number's characters; nothing at the end.
    fn next_word(&mut self) -> io::Result<Vec<u8>> {
        let mut word = Vec::new();
        loop {
            let buffer = self.text.fill_buf()?;
            if buffer.is_empty() {
                return Ok(word);
            }
            let is_space = |b: &u8| b.is_ascii_whitespace() || *b == b',';
            let begin = if word.is_empty() { buffer.iter().take_while(|b| is_space(b)).count() } else { 0 };
            let length = buffer[begin..].iter().take_while(|b| !is_space(b)).count();
            word.extend_from_slice(&buffer[begin..begin + length.min(LONGEST_NUMBER + 1)]);
            let ends = begin + length < buffer.len();
            self.text.consume(begin + length);
            if word.len() > LONGEST_NUMBER {
                return Err(self.wrong(&word, "is too long for a number"));
            }
            if ends && !word.is_empty() {
                return Ok(word);
            }
        }
    }

    fn wrong(&self, word: &[u8], why: &str) -> io::Error {
        let text = excerpt(&String::from_utf8_lossy(word));
        let problem = format!("number {}, `{text}`, {why}", self.count + 1);
        io::Error::new(io::ErrorKind::InvalidData, problem)
    }

    fn bytes_of(&self, word: &[u8]) -> io::Result<Vec<u8>> {
        let text = std::str::from_utf8(word).map_err(|_| self.wrong(word, "is no number"))?;
        macro_rules! whole {
            ($t:ty) => {
                match text.parse::<$t>() {
                    Ok(value) => Ok(value.to_le_bytes().to_vec()),
                    Err(_) => match whole(text) {
                        Some(value) => <$t>::try_from(value)
                            .map(|value| value.to_le_bytes().to_vec())
                            .map_err(|_| self.wrong(word, &format!("does not fit into {}", self.voxel_type))),
                        None => Err(self.wrong(word, "is no whole number")),
                    },
                }
            };
        }
        let real = || text.parse::<f64>().map_err(|_| self.wrong(word, "is no number"));
        match self.voxel_type {
            VoxelType::U8 => whole!(u8),
            VoxelType::I8 => whole!(i8),
            VoxelType::U16 => whole!(u16),
            VoxelType::I16 => whole!(i16),
            VoxelType::U32 => whole!(u32),
            VoxelType::I32 => whole!(i32),
            VoxelType::U64 => whole!(u64),
            VoxelType::I64 => whole!(i64),
            VoxelType::F32 => real().map(|value| (value as f32).to_le_bytes().to_vec()),
            VoxelType::F64 => real().map(|value| value.to_le_bytes().to_vec()),
        }
    }
}

/// A whole number, also where it is written `1.0` or `2e3`.
fn whole(text: &str) -> Option<i128> {
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let value: f64 = text.parse().ok()?;
    (value.trunc() == value && value.abs() < 1e30).then_some(value as i128)
}

impl Read for AsciiVoxels {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left.is_empty() {
                let word = self.next_word()?;
                if word.is_empty() {
                    break;
                }
                self.left = self.bytes_of(&word)?;
                self.count += 1;
            }
            let n = self.left.len().min(buffer.len() - filled);
            buffer[filled..filled + n].copy_from_slice(&self.left[..n]);
            self.left.drain(..n);
            filled += n;
        }
        Ok(filled)
    }
}

impl Decoder for AsciiVoxels {
    /// Anything but white space, be it a number or not.
    fn goes_on(&mut self) -> io::Result<bool> {
        Ok(!self.left.is_empty() || !self.next_word()?.is_empty())
    }
}

/// Pairs of hexadecimal digits as bytes; white space counts nowhere.
#[derive(Debug)]
pub(super) struct HexVoxels {
    text: BufReader<File>,
    /// Digits read so far.
    count: u64,
    /// The first digit of a pair.
    high: Option<u8>,
}

impl HexVoxels {
    pub(super) fn new(text: BufReader<File>) -> Self {
        Self { text, count: 0, high: None }
    }
}

impl Read for HexVoxels {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            let text = self.text.fill_buf()?;
            if text.is_empty() {
                break;
            }
            let mut used = 0;
            for &b in text {
                if filled == buffer.len() {
                    break;
                }
                used += 1;
                if b.is_ascii_whitespace() {
                    continue;
                }
                let Some(digit) = char::from(b).to_digit(16).and_then(|d| u8::try_from(d).ok()) else {
                    let found = excerpt(&char::from(b).to_string());
                    let problem = format!("`{found}`, behind {} digits, is no hexadecimal digit", self.count);
                    return Err(io::Error::new(io::ErrorKind::InvalidData, problem));
                };
                self.count += 1;
                match self.high.take() {
                    Some(high) => {
                        buffer[filled] = high << 4 | digit;
                        filled += 1;
                    }
                    None => self.high = Some(digit),
                }
            }
            self.text.consume(used);
        }
        Ok(filled)
    }
}

impl Decoder for HexVoxels {
    /// A single digit counts.
    fn goes_on(&mut self) -> io::Result<bool> {
        Ok(self.read(&mut [0])? > 0 || self.high.is_some())
    }
}
