//! Lanes of x86-64: SSE2, which every such processor has, AVX2, AVX-512.
//!
//! Why the intrinsics may be called: values of these types come from tokens alone (`Sse2` and so on), and a token is
//! made only where the set was found. What is called outside [`Lanes::enter`] works as well, but is not inlined.

/// `impl Trait for Type`, by an intrinsic of both.
macro_rules! operator {
    ($type:ident, $trait:ident, $name:ident, |$a:ident, $b:ident| $of:expr) => {
        impl $trait for $type {
            type Output = Self;

            #[inline(always)]
            fn $name(self, with: Self) -> Self {
                let ($a, $b) = (self.0, with.0);
                // SAFETY: see the module's head.
                Self(unsafe { $of })
            }
        }
    };
}

/// Functions of a trait, each by an intrinsic; see the module's head.
macro_rules! by {
    ($(fn $name:ident($($args:tt)*) -> $result:ty = $of:expr;)*) => {
        $(
            #[inline(always)]
            fn $name($($args)*) -> $result {
                // SAFETY: see the module's head. Some need no promise in functions of their set.
                #[allow(unused_unsafe)]
                unsafe {
                    $of
                }
            }
        )*
    };
}

mod avx2;
mod avx512;
mod spilled;
mod sse2;

pub(crate) use avx2::Avx2;
pub(crate) use avx512::Avx512;
pub(crate) use sse2::Sse2;
