//! Numbers as text, between white space, as little-endian bytes.

use std::io::{self, BufRead, Read};

use brickcast_volume::format::{VoxelType, excerpt};

/// No number is longer.
const LONGEST: usize = 400;

pub(crate) struct Numbers<R> {
    text: R,
    voxel_type: VoxelType,
    /// Bytes of the last number that did not fit.
    rest: Vec<u8>,
}

impl<R: BufRead> Numbers<R> {
    pub(crate) fn new(text: R, voxel_type: VoxelType) -> Self {
        Self { text, voxel_type, rest: Vec::new() }
    }

    /// The next number's bytes; nothing at the end, or where a tag begins.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut word = Vec::new();
        loop {
            let buffer = self.text.fill_buf()?;
            let Some(&byte) = buffer.first() else { break };
            if byte == b'<' || (byte.is_ascii_whitespace() && !word.is_empty()) {
                break;
            }
            self.text.consume(1);
            if !byte.is_ascii_whitespace() {
                word.push(byte);
            }
            if word.len() > LONGEST {
                return Err(io::Error::other("a word of more than 400 letters is no number"));
            }
        }
        if word.is_empty() {
            return Ok(None);
        }
        let word = String::from_utf8_lossy(&word);
        let bytes = number(&word, self.voxel_type);
        bytes.map(Some).ok_or_else(|| io::Error::other(format!("`{}` is no {}", excerpt(&word), self.voxel_type)))
    }
}

fn number(word: &str, voxel_type: VoxelType) -> Option<Vec<u8>> {
    macro_rules! bytes {
        ($number:ty) => {
            word.parse::<$number>().ok()?.to_le_bytes().to_vec()
        };
    }
    Some(match voxel_type {
        VoxelType::U8 => bytes!(u8),
        VoxelType::I8 => bytes!(i8),
        VoxelType::U16 => bytes!(u16),
        VoxelType::I16 => bytes!(i16),
        VoxelType::U32 => bytes!(u32),
        VoxelType::I32 => bytes!(i32),
        VoxelType::U64 => bytes!(u64),
        VoxelType::I64 => bytes!(i64),
        VoxelType::F32 => bytes!(f32),
        VoxelType::F64 => bytes!(f64),
    })
}

impl<R: BufRead> Read for Numbers<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut done = 0;
        while done < buffer.len() {
            if self.rest.is_empty() {
                match self.next()? {
                    Some(bytes) => self.rest = bytes,
                    None => break,
                }
            }
            let take = self.rest.len().min(buffer.len() - done);
            buffer[done..done + take].copy_from_slice(&self.rest[..take]);
            self.rest.drain(..take);
            done += take;
        }
        Ok(done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_bytes() {
        let mut bytes = Vec::new();
        Numbers::new(&b" 1\n-2\t300 </DataArray>"[..], VoxelType::I16).read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, [1, 0, 0xfe, 0xff, 0x2c, 1]);
        let error = Numbers::new(&b"1 256"[..], VoxelType::U8).read_to_end(&mut bytes).unwrap_err().to_string();
        assert!(error.contains("`256` is no uint8"), "{error}");
        assert!(Numbers::new(&[b'1'; 500][..], VoxelType::F64).read_to_end(&mut bytes).is_err());
    }
}
