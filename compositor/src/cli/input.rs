//! Input volumes, wherever they lie: a file, a folder of OME-Zarr, or OME-Zarr behind a network.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::anyhow;
use brickcast_remote::Place;
use brickcast_volume::format::{self, RawHints, VolumeSource};
use brickcast_volume::store::{Manifest, Phase, PrepareOptions, PrepareSummary, Progress, StoreError, prepare};

use super::progress::Bar;

/// Opens the input volume at `place`.
///
/// # Errors
/// A store, which is none; what lies behind a network and is no OME-Zarr; what the reader finds wrong.
pub fn open_input(place: &Place, hints: &RawHints) -> anyhow::Result<Box<dyn VolumeSource>> {
    if let Place::Folder(path) = place
        && !path.is_dir()
    {
        return Ok(format::open(path, hints)?);
    }
    let objects = place.objects();
    // A server may refuse to say that something is not there; then it is no store that could be opened.
    if objects.manifest_hash().is_ok() {
        return Err(anyhow!("{} is a brick store already; it is rendered as it is", shown(place).display()));
    }
    match (brickcast_zarr::is_zarr(objects.as_ref())?, place) {
        (true, _) => Ok(brickcast_zarr::open(objects, hints)?),
        (false, Place::Folder(path)) => Ok(format::open(path, hints)?),
        (false, Place::Far(root)) => {
            let why = "there is no zarr.json, .zattrs, .zarray or .zgroup; behind a network stores and OME-Zarr are \
                       read, files of other formats only on this machine";
            Err(anyhow!("{} is no OME-Zarr: {why}", root.address()))
        }
    }
}

/// True where `place`, which is no store by `error`, holds an input volume.
///
/// # Errors
/// The place cannot be read.
pub fn is_input(place: &Place, error: &StoreError) -> anyhow::Result<bool> {
    let is_none = matches!(error, StoreError::NotAStore { .. });
    Ok(is_none && brickcast_zarr::is_zarr(place.objects().as_ref())?)
}

/// Prepares the input at `place` into `target`, showing progress and telling what the reader noticed.
///
/// # Errors
/// As [`open_input`] and [`prepare`].
pub fn prepare_input(
    place: &Place,
    hints: &RawHints,
    target: &Path,
    options: &PrepareOptions,
) -> anyhow::Result<PrepareSummary> {
    let (mut source, options) = opened_input(place, hints, options)?;
    let input = shown(place);
    let summary = with_bar(&input, |progress| prepare(source.as_mut(), target, &options, progress))?;
    tell(&input, &summary.manifest);
    Ok(summary)
}

/// An input that is to be prepared, and `options` with what is said of it.
///
/// # Errors
/// As [`open_input`].
pub fn opened_input(
    place: &Place,
    hints: &RawHints,
    options: &PrepareOptions,
) -> anyhow::Result<(Box<dyn VolumeSource>, PrepareOptions)> {
    let source = open_input(place, hints)?;
    let input = shown(place);
    let options = PrepareOptions {
        source_name: input.file_name().and_then(|n| n.to_str()).map(str::to_owned),
        source_bytes: input.metadata().ok().filter(std::fs::Metadata::is_file).map(|m| m.len()),
        ..options.clone()
    };
    Ok((source, options))
}

/// Shows the progress of `work` on an input.
///
/// # Errors
/// That of `work`.
pub fn with_bar<T>(
    input: &Path,
    work: impl FnOnce(&mut dyn FnMut(Progress)) -> Result<T, StoreError>,
) -> anyhow::Result<T> {
    let bar = Bar::new(&format!("preparing {}", input.display()));
    let mut phase = None;
    let done = work(&mut |p| {
        if phase.replace(p.phase) != Some(p.phase) {
            bar.say(&format!("{} {}", words(p.phase), input.display()));
        }
        bar.at(p.done, p.total);
    })?;
    bar.finish();
    Ok(done)
}

/// Tells what is known of how a volume became a store, once a run, however often it is opened. The notes are harmless:
/// see [`Manifest::notes`].
pub fn tell(path: &Path, manifest: &Manifest) {
    static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    for note in &manifest.notes {
        let text = format!("{}: {note}", path.display());
        if !told.contains(&text) {
            tracing::warn!("{text}");
            told.push(text);
        }
    }
}

/// A place in words: a path, an address.
pub fn shown(place: &Place) -> PathBuf {
    match place {
        Place::Folder(path) => path.clone(),
        Place::Far(root) => PathBuf::from(root.address().to_string()),
    }
}

/// A phase, before the name of what is prepared.
fn words(phase: Phase) -> &'static str {
    match phase {
        Phase::Unpack => "unpacking",
        Phase::Scan | Phase::Write | Phase::Finish => "preparing",
        Phase::Levels => "coarser levels of",
        Phase::Flood => "flood filling",
        Phase::Distances => "distances of",
        Phase::Regions => "regions of",
        Phase::Labels => "writing regions of",
        Phase::Verify => "verifying",
    }
}
