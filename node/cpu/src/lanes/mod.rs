//! Several rays at once: what one instruction does to as many numbers as an instruction set holds.
//!
//! Every operation is that of IEEE 754 on each number by itself (round to nearest, denormals kept, nothing fused,
//! nothing approximate), or exact: so a body written over [`Lanes`] gives each ray the same bits whatever the set and
//! its width. That is what `--exact` rests on where processors differ.
//!
//! A value of a set's token (`Avx2` and so on) says that the processor has the set: it is only made where that was
//! found out, and numbers come from tokens. All `unsafe` of the processor's kernel is in this folder; what callers
//! promise is that places lie within the slices that they are read from.

#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
mod set;
mod traits;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use set::InstructionSet;
pub(crate) use traits::{Floats, Ints, Lanes, Mask, Task, WIDEST};

#[cfg(test)]
mod tests;
