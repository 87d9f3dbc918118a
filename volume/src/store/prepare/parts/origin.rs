//! What parts are made from and with, in words that are compared: parts of one store agree in all of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use crate::format::{SourceHeader, VolumeSource};
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::manifest::file::VERSION as STORE_VERSION;
use crate::store::prepare::options::PrepareOptions;

/// Files of the input that are named one by one; of more there is one hash.
const NAMED: usize = 16;

/// By what they are of.
pub(super) fn origin(
    source: &dyn VolumeSource,
    header: &SourceHeader,
    options: &PrepareOptions,
) -> Result<BTreeMap<String, String>, StoreError> {
    let PrepareOptions { brick_size, range, source_name, source_bytes, regions, levels, .. } = options;
    let mut made_of = BTreeMap::new();
    let mut say = |what: &str, value: String| made_of.insert(what.to_owned(), value);
    say("the program", concat!("brickcast ", env!("CARGO_PKG_VERSION")).to_owned());
    say("the version of stores", STORE_VERSION.to_string());
    say("the edge of bricks", brick_size.to_string());
    say("--range", range.map_or("none".to_owned(), |(lo, hi)| format!("{lo},{hi}")));
    say("the number of levels", format!("{levels:?}"));
    say("what regions are found by", format!("{regions:?}"));
    say("the input's name", format!("{source_name:?}"));
    say("the input's size", format!("{source_bytes:?}"));
    say("the size of the volume", header.geometry.dims().to_array().map(|n| n.to_string()).join(" x "));
    say("the type of voxels", header.voxel_type.to_string());
    // Place, directions, unit, fill values, rescaling, notes: all that a header says.
    say("what the input's header says", ContentHash::of(format!("{header:?}").as_bytes()).to_string());
    let files = options.inputs(source)?;
    let mut rest = String::new();
    for (i, file) in files.iter().enumerate() {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let state = state_of(file)?;
        match i < NAMED {
            true => drop(made_of.insert(format!("file {i} of the input"), format!("{name}, {state}"))),
            false => rest.push_str(&format!("{name}, {state}\n")),
        }
    }
    if !rest.is_empty() {
        let of = format!("{} more, {}", files.len() - NAMED, ContentHash::of(rest.as_bytes()));
        made_of.insert("the input's other files".to_owned(), of);
    }
    Ok(made_of)
}

/// What is cheaply known of a file's content.
fn state_of(file: &Path) -> Result<String, StoreError> {
    let metadata = fs::metadata(file).map_err(StoreError::io("look at", file))?;
    let time = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let time = time
        .map_or("of an unknown time".to_owned(), |t| format!("written at {}.{:09} s", t.as_secs(), t.subsec_nanos()));
    Ok(format!("{} bytes, {time}", metadata.len()))
}

/// Where two differ: what, and both values.
pub(super) fn difference(got: &BTreeMap<String, String>, want: &BTreeMap<String, String>) -> Option<[String; 3]> {
    let none = || "unknown".to_owned();
    let of = |made_of: &BTreeMap<String, String>, what: &String| made_of.get(what).cloned().unwrap_or_else(none);
    let what = want.keys().chain(got.keys()).find(|what| got.get(*what) != want.get(*what))?;
    Some([what.clone(), of(got, what), of(want, what)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named_with_both_values() {
        let of = |pairs: &[(&str, &str)]| {
            pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect::<BTreeMap<_, _>>()
        };
        let (a, b) = (of(&[("a", "1"), ("b", "2")]), of(&[("a", "1"), ("b", "3")]));
        assert_eq!(difference(&a, &a), None);
        assert_eq!(difference(&a, &b), Some(["b", "2", "3"].map(str::to_owned)));
        assert_eq!(difference(&a, &of(&[("a", "1")])), Some(["b", "2", "unknown"].map(str::to_owned)));
        assert_eq!(difference(&of(&[("a", "1")]), &a), Some(["b", "unknown", "2"].map(str::to_owned)));
    }
}
