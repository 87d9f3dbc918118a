//! Everything that is wrong with a series: its own files, and each step's.

use std::path::Path;
use std::sync::Arc;

use super::Series;
use super::alike::check_alike;
use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::files::shape::StoreShape;
use crate::store::files::walk::Found;
use crate::store::manifest::Manifest;
use crate::store::objects::Objects;
use crate::store::profile::{GROUP_FILE, MANIFEST_FILE, SERIES_FILE, SERIES_LIST_FILE};
use crate::store::progress::{Phase, Progress};
use crate::store::read::inspect::{Fault, FaultKind, Inspected, fault, inspect_objects};
use crate::store::series_manifest::SeriesManifest;

/// Reads everything in the series at the root of `objects` once; what it does not name is looked for in `folder`.
///
/// # Errors
/// There is no series of ours, or its folder cannot be listed.
pub fn inspect_series(
    objects: Arc<dyn Objects>,
    folder: Option<&Path>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Inspected, StoreError> {
    let bytes = objects.read_at_most(SERIES_FILE, SeriesManifest::MAX_BYTES + 1)?;
    let hash = StoreHash::of(&bytes);
    let manifest = SeriesManifest::from_bytes(&bytes);
    let mut faults = Vec::new();
    let (mut total, mut binds_chunks) = (bytes.len() as u64, true);
    if let Some(folder) = folder {
        let shape = StoreShape::in_folder(folder).unwrap_or_else(StoreShape::any);
        let found = Found::below(folder, &shape)?;
        let foreign = |file: &String| {
            let what = "the manifest does not name it".to_owned();
            Fault { kind: FaultKind::Foreign, file: file.clone(), what }
        };
        faults.extend(found.foreign.iter().map(foreign));
        total = found.bytes;
    }
    let manifest = match manifest {
        Ok(manifest) => manifest,
        Err(error) => {
            faults.push(fault(SERIES_FILE, &error));
            return Ok(Inspected { hash, version: None, bytes: total, binds_chunks, faults });
        }
    };
    for (file, want) in [GROUP_FILE, SERIES_LIST_FILE].into_iter().zip(manifest.files) {
        if let Err(error) = objects.check_file(file, Manifest::MAX_BYTES, want) {
            faults.push(fault(file, &error));
        }
    }
    let series = Series::of(objects, hash, manifest);
    let (count, mut first) = (series.manifest().steps.len(), None);
    for (step, entry) in series.manifest().steps.iter().enumerate() {
        let at = |file: &str| format!("{step}/{file}");
        // So many parts for each step: what they take is not known before they are read.
        let parts = 1000;
        let mut of_step = |p: Progress| {
            let done = (step as u64) * parts + (p.done.saturating_mul(parts) / p.total.max(1)).min(parts);
            progress(Progress { phase: Phase::Verify, done, total: count as u64 * parts });
        };
        let objects = series.objects_of(step);
        match inspect_objects(objects.clone(), None, &mut of_step) {
            Err(error) => faults.push(fault(&at(MANIFEST_FILE), &error)),
            Ok(found) => {
                if found.hash != entry.hash {
                    let error = StoreError::OtherStep { step, got: found.hash, want: entry.hash };
                    faults.push(fault(&at(MANIFEST_FILE), &error));
                }
                faults.extend(found.faults.into_iter().map(|fault| Fault { file: at(&fault.file), ..fault }));
                binds_chunks &= found.binds_chunks;
                if folder.is_none() {
                    total = total.saturating_add(found.bytes);
                }
            }
        }
        let Ok(manifest) = objects.manifest() else { continue };
        match &first {
            None => first = Some(manifest),
            Some(first) => {
                if let Err(error) = check_alike(step, &manifest, first) {
                    faults.push(fault(&at(MANIFEST_FILE), &error));
                }
            }
        }
    }
    Ok(Inspected { hash, version: first.map(|first| first.version), bytes: total, binds_chunks, faults })
}
