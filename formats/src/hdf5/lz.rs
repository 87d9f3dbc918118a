//! The LZ codecs of HDF5's plugins: LZF, which h5py brings along, and LZ4 in the plugin's own frame.

/// LZF: literals, and copies of what was decoded. At most `most` bytes.
pub(super) fn lzf(data: &[u8], most: usize) -> Option<Vec<u8>> {
    let (mut out, mut at) = (Vec::new(), 0);
    while let Some(&control) = data.get(at) {
        at += 1;
        if control < 32 {
            let run = data.get(at..at + usize::from(control) + 1)?;
            out.extend_from_slice(run);
            at += run.len();
        } else {
            let mut length = usize::from(control >> 5);
            if length == 7 {
                length += usize::from(*data.get(at)?);
                at += 1;
            }
            let back = (usize::from(control & 31) << 8 | usize::from(*data.get(at)?)) + 1;
            at += 1;
            let from = out.len().checked_sub(back)?;
            for i in from..from + length + 2 {
                out.push(out[i]);
            }
        }
        if out.len() > most {
            return None;
        }
    }
    Some(out)
}

/// The next number, big endian, which is taken off `data`.
pub(super) fn number<const N: usize>(data: &mut &[u8]) -> Option<u64> {
    let (head, tail) = data.split_at_checked(N)?;
    *data = tail;
    Some(head.iter().fold(0, |n, byte| n << 8 | u64::from(*byte)))
}

/// One block, whose size is known.
pub(super) fn lz4_block(data: &[u8], size: usize) -> Option<Vec<u8>> {
    // No block expands further: what it says of its size costs no more.
    if size > data.len().saturating_mul(256) {
        return None;
    }
    lz4_flex::block::decompress(data, size).ok().filter(|out| out.len() == size)
}

/// The size of all, that of a block, and blocks with their packed sizes before them.
pub(super) fn lz4(mut data: &[u8], most: usize) -> Option<Vec<u8>> {
    let total = usize::try_from(number::<8>(&mut data)?).ok().filter(|total| *total <= most)?;
    let block = usize::try_from(number::<4>(&mut data)?).ok().filter(|block| *block > 0)?;
    let mut out = Vec::new();
    while out.len() < total {
        let size = block.min(total - out.len());
        let packed = usize::try_from(number::<4>(&mut data)?).ok()?;
        let (head, tail) = data.split_at_checked(packed)?;
        match packed == size {
            true => out.extend_from_slice(head),
            false => out.extend(lz4_block(head, size)?),
        }
        data = tail;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_cut_or_lies_is_refused() {
        assert_eq!(lzf(&[2, b'a', b'b', b'c', 0x40, 2], 99).as_deref(), Some(&b"abcabca"[..]));
        assert_eq!(lzf(&[0, b'a', 0xe0, 255, 0], 1000).map(|out| out.len()), Some(1 + 264));
        for wrong in [&[2, b'a'][..], &[0x20, 0], &[0, b'a', 0x20], &[0, b'a', 0x21, 0], &[0, b'a', 0xe0, 255, 0]] {
            assert_eq!(lzf(wrong, 100), None, "{wrong:?}");
        }
        let frame =
            [&12_u64.to_be_bytes()[..], &8_u32.to_be_bytes(), &[0, 0, 0, 8], b"abcdefgh", &[0, 0, 0, 4], b"ijkl"];
        assert_eq!(lz4(&frame.concat(), 12).as_deref(), Some(&b"abcdefghijkl"[..]));
        assert_eq!(lz4(&frame.concat(), 11), None);
        assert_eq!(lz4(&frame[..5].concat(), 12), None);
        assert_eq!(lz4(&[255; 16], usize::MAX), None);
    }
}
