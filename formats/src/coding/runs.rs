//! Runs of bytes, as Amira writes them (HxByteRLE): a count above 127 is of bytes that follow, another of one byte.

use std::io::{self, BufRead, Read};

pub(crate) struct Runs<R> {
    packed: R,
    /// Bytes that are left of a run, and which one where it is one over and over.
    left: usize,
    same: Option<u8>,
}

impl<R: BufRead> Runs<R> {
    pub(crate) fn new(packed: R) -> Self {
        Self { packed, left: 0, same: None }
    }

    fn byte(&mut self) -> io::Result<Option<u8>> {
        let byte = self.packed.fill_buf()?.first().copied();
        self.packed.consume(usize::from(byte.is_some()));
        Ok(byte)
    }
}

impl<R: BufRead> Read for Runs<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if out.is_empty() {
            return Ok(0);
        }
        while self.left == 0 {
            let Some(count) = self.byte()? else { return Ok(0) };
            self.left = usize::from(count & 127);
            self.same = match count {
                0..128 => Some(self.byte()?.ok_or(io::ErrorKind::UnexpectedEof)?),
                128.. => None,
            };
        }
        let count = self.left.min(out.len());
        let got = match self.same {
            Some(byte) => {
                out[..count].fill(byte);
                count
            }
            None => self.packed.read(&mut out[..count])?,
        };
        self.left -= got;
        Ok(got)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_of_one_byte_or_of_several() {
        let mut out = Vec::new();
        Runs::new(&[3, 7, 0x82, 1, 2, 0, 9, 1, 5][..]).read_to_end(&mut out).unwrap();
        assert_eq!(out, [7, 7, 7, 1, 2, 5]);
        assert!(Runs::new(&[3][..]).read_to_end(&mut out).is_err());
    }
}
