//! BloscLZ, the compressor of Blosc's own: runs of literals, and matches of what came before.

/// The longest distance of a match with a short code.
const SHORT: usize = 8191;

/// Appends exactly `want` bytes to `out`; nothing where `input` is no such stream.
pub(crate) fn decompress(input: &[u8], want: usize, out: &mut Vec<u8>) -> Option<()> {
    let begin = out.len();
    let mut rest = input;
    let next = |rest: &mut &[u8]| rest.split_off_first().map(|byte| usize::from(*byte));
    // The first is always a run of literals.
    let mut control = next(&mut rest)? & 31;
    loop {
        let left = want - (out.len() - begin);
        if control < 32 {
            let run = control + 1;
            out.extend_from_slice(rest.split_off(..run).filter(|_| run <= left)?);
        } else {
            let mut length = (control >> 5) - 1;
            if length == 6 {
                loop {
                    let more = next(&mut rest)?;
                    length += more;
                    if more < 255 {
                        break;
                    }
                }
            }
            let (high, low) = ((control & 31) << 8, next(&mut rest)?);
            let distance = match (high, low) {
                (0x1f00, 255) => {
                    let (high, low) = (next(&mut rest)?, next(&mut rest)?);
                    (high << 8) + low + SHORT + 1
                }
                _ => high + low + 1,
            };
            length += 3;
            let from = out.len().checked_sub(distance).filter(|from| *from >= begin && length <= left)?;
            for at in from..from + length {
                out.push(out[at]);
            }
        }
        match next(&mut rest) {
            Some(code) => control = code,
            None => return (out.len() - begin == want).then_some(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_runs_and_matches_come_back_and_nothing_else_is_taken() {
        let decompressed = |input: &[u8], want| {
            let mut out = b"before".to_vec();
            decompress(input, want, &mut out).map(|()| out.split_off(6))
        };
        // Three literals; four bytes from three bytes before (they overlap what they make); one literal.
        assert_eq!(decompressed(&[2, b'a', b'b', b'c', 0x40, 2, 0, b'd'], 8).unwrap(), b"abcabcad");
        // A run of a byte, longer than one code says: 6 + 255 + 1 + 3 and one.
        assert_eq!(decompressed(&[0, b'x', 0xe0, 255, 1, 0], 266).unwrap(), [b'x'; 266]);
        for broken in [&[][..], &[2, b'a'], &[0, b'x', 0x40, 1], &[0, b'x', 0xe0, 255], &[0, b'x', 0x5f, 255, 0]] {
            assert_eq!(decompressed(broken, 8), None, "{broken:?}");
        }
        assert_eq!(decompressed(&[2, b'a', b'b', b'c'], 2), None, "more than is due");
        assert_eq!(decompressed(&[2, b'a', b'b', b'c'], 4), None, "less than is due");
    }
}
