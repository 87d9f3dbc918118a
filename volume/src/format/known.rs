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

/// Read by a crate of its own, through objects.
pub(super) const OME_ZARR: Known = Known {
    name: "OME-Zarr",
    extensions: &["zarr"],
    reads: "a folder or an address; 0.1 to 0.5, compressed and sharded as is usual",
};

/// In the order of the table, then what others read.
pub(super) const ALL: [Known; 3] = [NRRD, RAW, OME_ZARR];

/// The formats that are read, for people.
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
