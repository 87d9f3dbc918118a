//! Which instruction sets there are, which this processor has, and which one is taken.

#[cfg(target_arch = "aarch64")]
use super::neon::Neon;
use super::portable::Portable;
use super::traits::{Lanes as _, Task};
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512, Sse2};
/// An instruction set that the kernel on the processor has lanes for. Pictures do not depend on it, only their time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InstructionSet {
    /// Plain Rust, four lanes.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Sse2,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "aarch64")]
    Neon,
}

impl InstructionSet {
    /// Of this build, the best last.
    pub const ALL: &[Self] = &[
        Self::Portable,
        #[cfg(target_arch = "x86_64")]
        Self::Sse2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512,
        #[cfg(target_arch = "aarch64")]
        Self::Neon,
    ];

    /// The best one that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.iter().copied().rev().find(|set| set.is_here()).unwrap_or(Self::Portable)
    }

    /// Has this processor the set?
    #[must_use]
    pub fn is_here(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Avx2::new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Avx512::new().is_some(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => true,
        }
    }

    /// As users name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => "sse2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            Self::Neon => "neon",
        }
    }

    /// The one of this name, where this build knows it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|set| set.name() == name)
    }

    /// Rays side by side.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            Self::Portable => Portable::<4>::N,
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => Sse2::N,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Avx2::N,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Avx512::N,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => Neon::N,
        }
    }

    /// Runs `task` by this set, or by the least one where the processor has it not.
    pub(crate) fn enter<T: Task>(self, task: T) -> T::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Sse2 => Sse2::new().enter(task),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => match Avx2::new() {
                Some(lanes) => lanes.enter(task),
                None => Sse2::new().enter(task),
            },
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => match Avx512::new() {
                Some(lanes) => lanes.enter(task),
                None => Sse2::new().enter(task),
            },
            #[cfg(target_arch = "aarch64")]
            Self::Neon => Neon::new().enter(task),
            Self::Portable => Portable::<4>.enter(task),
        }
    }
}
