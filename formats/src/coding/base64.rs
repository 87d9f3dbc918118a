//! Base64 as VTK writes it: groups of four letters, several runs one after the other, each padded for itself.

use std::io::{self, BufRead, Read};

pub(super) struct Base64<R> {
    text: R,
    /// The last group's bytes, and how many of them are still to be read.
    group: [u8; 3],
    left: usize,
    end: usize,
}

impl<R: BufRead> Base64<R> {
    pub(super) fn new(text: R) -> Self {
        Self { text, group: [0; 3], left: 0, end: 0 }
    }

    /// True where a group was read.
    fn next(&mut self) -> io::Result<bool> {
        let (mut bits, mut letters, mut padding) = (0_u32, 0, 0);
        while letters < 4 {
            let Some(&byte) = self.text.fill_buf()?.first() else { break };
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => 0,
                b'<' => break,
                _ if byte.is_ascii_whitespace() => {
                    self.text.consume(1);
                    continue;
                }
                _ => return Err(io::Error::other(format!("the byte {byte} is no letter of base64"))),
            };
            self.text.consume(1);
            padding += usize::from(byte == b'=');
            bits = bits << 6 | u32::from(value);
            letters += 1;
        }
        match (letters, padding) {
            (0, _) => Ok(false),
            (4, 0..=2) => {
                self.group = [(bits >> 16) as u8, (bits >> 8) as u8, bits as u8];
                (self.left, self.end) = (3 - padding, 3 - padding);
                Ok(true)
            }
            _ => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

impl<R: BufRead> Read for Base64<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut done = 0;
        while done < buffer.len() {
            if self.left == 0 && !self.next()? {
                break;
            }
            buffer[done] = self.group[self.end - self.left];
            (self.left, done) = (self.left - 1, done + 1);
        }
        Ok(done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_read_one_after_the_other() {
        let read = |text: &[u8]| {
            let mut bytes = Vec::new();
            Base64::new(text).read_to_end(&mut bytes).map(|_| bytes)
        };
        assert_eq!(read(b" aGVsbG8=\nd29ybGQh</x>").unwrap(), b"helloworld!");
        assert_eq!(read(b"AA==/+8=").unwrap(), [0, 0xff, 0xef]);
        assert!(read(b"aGV").is_err() && read(b"a*==").is_err() && read(b"a===").is_err());
    }
}
