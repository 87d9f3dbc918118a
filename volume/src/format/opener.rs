//! By what a volume that somebody names is opened.

use std::fmt;
use std::path::Path;

use super::{FormatError, RawHints, VolumeSource};

type Open = fn(&Path, &RawHints) -> Result<Box<dyn VolumeSource>, FormatError>;

/// What opens label volumes: this crate knows few formats, and whoever asks for labels hands over what knows more.
#[derive(Clone, Copy)]
pub struct Opener(pub Open);

impl Opener {
    /// # Errors
    /// Those of the function.
    pub fn open(self, path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
        (self.0)(path, hints)
    }
}

/// Of NRRD and raw files.
impl Default for Opener {
    fn default() -> Self {
        Self(super::open)
    }
}

/// Options are compared by what they ask for, and every opener that knows a file reads the same voxels from it.
impl PartialEq for Opener {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Without the address, which differs from run to run: the cache finds a store by the text of its options.
impl fmt::Debug for Opener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Opener")
    }
}
