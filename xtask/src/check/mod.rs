//! The checks, one file each.

mod documents;
mod error_texts;
mod file_length;
mod flags;
// Not among ALL before comments and strings of sources are wrapped.
#[allow(dead_code)]
mod line_width;
mod machine_paths;
mod manifests;
mod names;
mod shaders;

use crate::tree::Tree;

pub(crate) struct Check {
    pub(crate) name: &'static str,
    /// What holds where the check passes.
    pub(crate) law: &'static str,
    /// What to do where it fails.
    pub(crate) remedy: &'static str,
    /// One line a problem.
    pub(crate) run: fn(&Tree) -> anyhow::Result<Vec<String>>,
}

pub(crate) const ALL: [Check; 8] = [
    manifests::CHECK,
    names::CHECK,
    flags::CHECK,
    shaders::CHECK,
    documents::CHECK,
    error_texts::CHECK,
    machine_paths::CHECK,
    file_length::CHECK,
];
