//! A file of lines from its first byte on, and between them numbers that are passed over: VTK's legacy format, Amira.

use std::io::{self, BufRead, Read as _};

use crate::wrong::Wrong;

/// Of all lines together, and of one.
const LONGEST: u64 = 1 << 20;

pub(crate) struct Lines<R> {
    file: R,
    /// The byte that comes next.
    pub(crate) at: u64,
    said: u64,
}

fn unreadable(reason: io::Error) -> Wrong {
    Wrong::broken("header", reason)
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(file: R) -> Self {
        Self { file, at: 0, said: 0 }
    }

    /// The next line, which may be empty; nothing at the end.
    pub(crate) fn raw(&mut self) -> Result<Option<String>, Wrong> {
        let mut line = Vec::new();
        let left = LONGEST.saturating_sub(self.said);
        let got = self.file.by_ref().take(left).read_until(b'\n', &mut line).map_err(unreadable)? as u64;
        if got == 0 && left > 0 {
            return Ok(None);
        }
        let start = self.at;
        (self.at, self.said) = (self.at + got, self.said + got);
        if !line.ends_with(b"\n") {
            return Err(Wrong::broken(
                "header",
                format!("the line at byte {start} does not end, or all have over 1 MiB"),
            ));
        }
        let line = String::from_utf8(line);
        let line = line.map_err(|_| Wrong::broken("header", format!("the line at byte {start} is no text")))?;
        Ok(Some(line.trim().to_owned()))
    }

    /// The next line that is not empty; nothing at the end.
    pub(crate) fn next(&mut self) -> Result<Option<String>, Wrong> {
        while let Some(line) = self.raw()? {
            if !line.is_empty() {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }

    /// One that must be there.
    pub(crate) fn due(&mut self) -> Result<String, Wrong> {
        self.next()?.ok_or_else(|| Wrong::broken("header", "it ends before the voxels begin"))
    }

    pub(crate) fn pass_bytes(&mut self, count: u64) -> Result<(), Wrong> {
        let passed = io::copy(&mut self.file.by_ref().take(count), &mut io::sink()).map_err(unreadable)?;
        self.at += passed;
        match passed == count {
            true => Ok(()),
            false => Err(Wrong::broken("array", format!("{count} bytes of it are due, and the file has {passed}"))),
        }
    }

    /// Words between white space.
    pub(crate) fn pass_words(&mut self, mut count: u64) -> Result<(), Wrong> {
        let mut is_within = false;
        while count > 0 || is_within {
            let buffer = self.file.fill_buf().map_err(unreadable)?;
            if buffer.is_empty() {
                return Err(Wrong::broken("array", format!("{count} numbers of it are missing")));
            }
            let mut used = 0;
            for byte in buffer {
                let is_white = byte.is_ascii_whitespace();
                if !is_within && !is_white {
                    count -= 1;
                }
                is_within = !is_white;
                if count == 0 && is_white {
                    break;
                }
                used += 1;
            }
            self.file.consume(used);
            self.at += used as u64;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_numbers_are_passed_over() {
        let mut lines = Lines::new(&b"a b\n\n  \n 1 2\n3\nnext\n\x01\n\x02last\n"[..]);
        assert_eq!(lines.next().unwrap().as_deref(), Some("a b"));
        lines.pass_words(3).unwrap();
        assert_eq!(lines.next().unwrap().as_deref(), Some("next"));
        lines.pass_bytes(3).unwrap();
        assert_eq!((lines.next().unwrap().as_deref(), lines.at), (Some("last"), 28));
        assert_eq!(lines.next(), Ok(None));
        assert!(lines.due().is_err() && lines.pass_bytes(1).is_err() && lines.pass_words(1).is_err());
        assert!(Lines::new(&b"no end"[..]).raw().is_err());
        assert!(Lines::new(io::BufReader::new(io::repeat(b'a'))).raw().is_err());
    }
}
