//! What the whole-system tests share: the independent referee, its scenes, the comparison of pictures, and the door to
//! the product's kernels.
//!
//! [`referee`] is written from the definition of the picture alone and uses nothing of the product. [`product`] is the
//! only module here that calls the product; [`scenes`] describes each scene once, in plain numbers, for both.

// All of this crate is test code: an `Err` here is a failed test.
#![allow(clippy::unwrap_used)]

pub mod compare;
pub mod patience;
pub mod placed;
pub mod process;
pub mod product;
pub mod proxy;
pub mod referee;
pub mod rig;
pub mod s3;
pub mod scenes;
mod turn;
pub mod web;

pub use turn::{Turn, turn};
