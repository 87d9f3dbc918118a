//! Formats and stores from outside. Tests that count what the process allocates are programs of their own.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

mod format_files;
mod format_nrrd;
mod format_open;
mod store;
