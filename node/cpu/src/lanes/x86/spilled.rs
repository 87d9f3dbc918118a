//! Whole numbers that are taken from their register one by one, as offsets to load from.

use std::mem::MaybeUninit;

/// A register's numbers in memory. Volatile both ways: the compiler, left to itself, takes lanes out of the register in
/// place of the detour, at two or three instructions each in place of one.
pub(super) struct Spilled<V>(MaybeUninit<V>);

impl<V> Spilled<V> {
    #[inline(always)]
    pub(super) fn new(numbers: V) -> Self {
        let mut memory = MaybeUninit::<V>::uninit();
        // SAFETY: it is written where there is room for it.
        unsafe { memory.as_mut_ptr().write_volatile(numbers) };
        Self(memory)
    }

    /// One of them, as an unsigned number.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> usize {
        assert!(lane < size_of::<V>() / size_of::<u32>());
        // SAFETY: it lies within the register's numbers, which were written.
        unsafe { self.0.as_ptr().cast::<u32>().add(lane).read_volatile() as usize }
    }
}
