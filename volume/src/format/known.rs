//! What formats there are, in words: errors list them.

/// A format, for people.
pub(super) struct Known {
    pub(super) name: &'static str,
    /// Lower case, without the dot.
    pub(super) extensions: &'static [&'static str],
    /// What of the format is read.
    reads: &'static str,
}

pub(super) const NRRD: Known = Known {
    name: "NRRD",
    extensions: &["nrrd", "nhdr"],
    reads: "raw, gzip, bzip2, ascii or hex encoding, attached or with one data file or many",
};
pub(super) const RAW: Known = Known {
    name: "raw voxels",
    extensions: &["raw"],
    reads: "with --dims X,Y,Z --type uint16, or named like part_512x512x400_uint16.raw",
};

/// In the order of the table.
pub(super) const ALL: [Known; 2] = [NRRD, RAW];

/// The formats that [`super::open`] reads, for people.
#[must_use]
pub fn supported() -> String {
    let list: Vec<String> = ALL
        .iter()
        .map(|f| {
            let extensions: Vec<String> = f.extensions.iter().map(|e| format!(".{e}")).collect();
            format!("{} ({}: {})", f.name, extensions.join(", "), f.reads)
        })
        .collect();
    list.join("; ")
}
