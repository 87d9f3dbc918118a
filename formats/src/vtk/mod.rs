//! VTK: the legacy format of structured points, and XML image data (.vti).

mod legacy;
mod tags;
mod xml;

pub(crate) use legacy::{FORMAT as LEGACY, open as open_legacy, recognises as is_legacy};
pub(crate) use xml::{FORMAT as XML, open as open_xml, recognises as is_xml};
