//! Numbers that fill a part of their words.

/// How numbers lie in their words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bits {
    /// 1, 8, 16, 32 or 64; a voxel has a byte where it is one.
    pub(super) allocated: u32,
    pub(super) stored: u32,
    /// Below the lowest bit.
    pub(super) shift: u32,
    pub(super) is_signed: bool,
}

/// Single bits, the lowest of a byte first, from the bit `first` on.
pub(super) fn single_bits(packed: &[u8], first: usize, count: usize) -> Vec<u8> {
    (first..first + count).map(|i| packed[i / 8] >> (i % 8) & 1).collect()
}

/// Leaves the bits that count, and gives their sign to those above.
pub(super) fn keep_bits(data: &mut [u8], bits: Bits) {
    if bits.stored == bits.allocated {
        return;
    }
    let above = 64 - bits.stored - bits.shift;
    let kept = |n: u64| match bits.is_signed {
        true => ((n << above) as i64 >> (above + bits.shift)) as u64,
        false => n << above >> (above + bits.shift),
    };
    match bits.allocated {
        8 => data.iter_mut().for_each(|n| *n = kept((*n).into()) as u8),
        16 => each::<2>(data, |n| kept(u16::from_le_bytes(n).into()).to_le_bytes()),
        32 => each::<4>(data, |n| kept(u32::from_le_bytes(n).into()).to_le_bytes()),
        _ => each::<8>(data, |n| kept(u64::from_le_bytes(n)).to_le_bytes()),
    }
}

fn each<const N: usize>(data: &mut [u8], kept: impl Fn([u8; N]) -> [u8; 8]) {
    data.as_chunks_mut::<N>().0.iter_mut().for_each(|n| {
        let numbers = kept(*n);
        n.copy_from_slice(&numbers[..N]);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_that_do_not_count_are_taken_off() {
        for (stored, shift, is_signed, number, want) in [
            (12, 0, false, 0xf123, 0x0123),
            (12, 0, true, 0x7fff, 0xffff),
            (12, 0, true, 0xf7ff, 0x07ff),
            (12, 4, false, 0xabcd, 0x0abc),
            (12, 4, true, 0xabcd, 0xfabc),
            (16, 0, true, 0xabcd, 0xabcd),
        ] {
            let mut data = u16::to_le_bytes(number).to_vec();
            keep_bits(&mut data, Bits { allocated: 16, stored, shift, is_signed });
            assert_eq!(data, u16::to_le_bytes(want), "{stored} {shift} {is_signed} {number:x}");
        }
    }
}
