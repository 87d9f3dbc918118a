//! A store that is prepared in parts, by several machines or by one that may be killed: each part is a slab of whole
//! layers of shards and bricks, made from the input alone; what parts leave is joined to the very bytes that one go
//! makes (docs/adr/0022-preparing-in-parts.md).

mod division;
pub(in crate::store) mod error;
mod folder;
mod found;
mod joined;
mod make;
mod merge;
mod number;
mod origin;
mod part_file;
mod resume;

pub use self::division::parts_folder;
pub use self::make::{MadePart, prepare_part, scan_part};
pub use self::merge::merge_parts;
pub use self::number::PartNumber;
pub use self::resume::{Journal, resume};
