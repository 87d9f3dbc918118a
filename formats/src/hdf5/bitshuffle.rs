//! Bitshuffle: the bits of a block's numbers, sorted by their places, alone or in LZ4 or zstd; detectors write it.

use super::lz::{lz4_block, number};

/// Numbers in a block where the file does not say.
fn default_block(bytes: usize) -> usize {
    (8192 / bytes / 8 * 8).max(128)
}

/// Rows of bits back to numbers of `bytes`. A block has a multiple of 8 of them.
fn unshuffled(block: &[u8], bytes: usize, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + block.len(), 0);
    let out = &mut out[start..];
    let groups = block.len() / bytes / 8;
    for byte in 0..bytes {
        for group in 0..groups {
            let row = |bit: usize| block[(8 * byte + bit) * groups + group];
            let numbers = transposed(u64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(row))).to_le_bytes();
            for (i, value) in numbers.into_iter().enumerate() {
                out[(8 * group + i) * bytes + byte] = value;
            }
        }
    }
}

/// Rows and columns of a matrix of 8 x 8 bits (Warren, Hacker's Delight, 7-3).
fn transposed(mut x: u64) -> u64 {
    for (shift, mask) in [(7, 0x00aa_00aa_00aa_00aa), (14, 0x0000_cccc_0000_cccc), (28, 0x0000_0000_f0f0_f0f0)] {
        let t = (x ^ (x >> shift)) & mask;
        x ^= t ^ (t << shift);
    }
    x
}

/// A chunk of numbers of `bytes` each, at most `most` bytes; `settings` are the filter's own numbers.
pub(super) fn decoded(mut data: &[u8], settings: &[u32], most: usize) -> Option<Vec<u8>> {
    let setting = |i: usize| settings.get(i).map_or(0, |n| *n as usize);
    let (bytes, codec) = (setting(2), setting(4));
    if bytes == 0 || bytes > 64 {
        return None;
    }
    let (total, mut block) = match codec {
        0 => (data.len(), setting(3)),
        _ => {
            let total = usize::try_from(number::<8>(&mut data)?).ok().filter(|total| *total <= most)?;
            (total, usize::try_from(number::<4>(&mut data)?).ok()? / bytes)
        }
    };
    if block == 0 {
        block = default_block(bytes);
    }
    if block % 8 != 0 || total > most {
        return None;
    }
    let mut out = Vec::new();
    loop {
        // What does not fill eight numbers follows as it is.
        let left = (total - out.len()) / bytes / 8 * 8;
        let size = block.min(left) * bytes;
        if size == 0 {
            out.extend_from_slice(data.get(..total - out.len())?);
            return Some(out);
        }
        let packed = if codec == 0 { size } else { usize::try_from(number::<4>(&mut data)?).ok()? };
        let (head, tail) = data.split_at_checked(packed)?;
        data = tail;
        match codec {
            0 => unshuffled(head, bytes, &mut out),
            2 => unshuffled(&lz4_block(head, size)?, bytes, &mut out),
            3 => unshuffled(&super::filters::zstd(head, size).filter(|out| out.len() == size)?, bytes, &mut out),
            _ => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_go_back_to_their_places() {
        let numbers: Vec<u16> = (0..16).map(|i| i * 4099 + 7).collect();
        let mut rows = vec![0_u8; 32];
        for (i, n) in numbers.iter().enumerate() {
            (0..16).filter(|bit| n >> bit & 1 == 1).for_each(|bit| rows[bit * 2 + i / 8] |= 1 << (i % 8));
        }
        rows.extend([1, 2, 3]);
        let out = decoded(&rows, &[0, 4, 2, 16, 0], 99).unwrap();
        let want: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).chain([1, 2, 3]).collect();
        assert_eq!(out, want);
        assert_eq!(decoded(&rows, &[0, 4, 2, 16, 0], 34), None);
        assert_eq!(decoded(&rows, &[0, 4, 2, 12, 0], 99), None, "no eights");
        assert_eq!(decoded(&rows, &[0, 4, 0, 16, 0], 99), None);
        assert_eq!(decoded(&rows[..11], &[0, 4, 2, 16, 2], 99), None);
    }
}
