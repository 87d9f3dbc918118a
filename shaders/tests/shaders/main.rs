//! The kernels' layouts, and what their leaps may change.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod layout;
mod leaping;
