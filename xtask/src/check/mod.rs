//! The checks, one file each.

mod circles;
mod documents;
mod error_texts;
mod file_length;
mod law;
mod machine_paths;
mod manifests;
mod names;
mod shaders;

pub(crate) use law::Check;

pub(crate) const ALL: [Check; 8] = [
    manifests::CHECK,
    circles::CHECK,
    names::CHECK,
    shaders::CHECK,
    documents::CHECK,
    error_texts::CHECK,
    machine_paths::CHECK,
    file_length::CHECK,
];
