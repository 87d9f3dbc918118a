//! What PATH means: a store, an input that is prepared on the way, or a name that the nodes know.

use std::hash::Hasher;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, anyhow};
use brickcast_volume::StoreHash;
use brickcast_volume::brick::BrickGrid;
use brickcast_volume::format::{self, RawHints};
use brickcast_volume::store::{
    Manifest, Phase, PrepareOptions, PrepareSummary, STORE_VERSION, Segmentation, Store, prepare, survey,
};

use crate::cli::{CacheArgs, OnTheWayArgs, RawArgs};
use crate::failure::Failure;
use crate::progress::Bar;

/// A path that was understood.
#[derive(Debug)]
pub enum Source {
    /// A store on this machine.
    Store(Store),
    /// A name that only the nodes know.
    Name(String),
}

/// What is known of a volume without rendering it.
#[derive(Debug)]
pub struct Surveyed {
    pub manifest: Manifest,
    /// Where the path is a store.
    pub store: Option<Store>,
}

/// Reads a store's manifest, or an input once from end to end; nothing is prepared.
///
/// # Errors
/// Neither an input nor a store; what the reader finds wrong.
pub fn surveyed(path: &Path, raw: &RawArgs) -> Result<Surveyed, Failure> {
    if path.is_dir() {
        let store = Store::open(path)?;
        return Ok(Surveyed { manifest: store.manifest().clone(), store: Some(store) });
    }
    let mut source = format::open(path, &raw.hints()?)?;
    let bar = Bar::new(&format!("reading {}", path.display()));
    let manifest = survey(source.as_mut(), &mut |p| bar.at(p.done, p.total))?;
    bar.finish();
    Ok(Surveyed { manifest, store: None })
}

impl RawArgs {
    /// The flags as hints for the raw reader.
    ///
    /// # Errors
    /// Usage: an unknown type or byte order.
    pub fn hints(&self) -> Result<RawHints, Failure> {
        let voxel_type = self.voxel_type.as_deref().map(str::parse).transpose().map_err(Failure::usage)?;
        let endian = self.endian.as_deref().map(str::parse).transpose().map_err(Failure::usage)?;
        let (skip, spacing, no_data) = (self.skip, self.spacing, self.no_data);
        Ok(RawHints { dims: self.dims, voxel_type, endian, skip, spacing, origin: None, no_data })
    }
}

impl OnTheWayArgs {
    /// Opens what `path` names; an input is prepared into the cache, or found there while it is unchanged. With
    /// `nodes_know`, a path that does not exist here is taken for a name that the nodes know.
    ///
    /// # Errors
    /// Nothing there, neither store nor input, an input that cannot be read.
    pub fn open(&self, path: &Path, nodes_know: bool) -> Result<Source, Failure> {
        let source = self.opened(path, nodes_know)?;
        if let Source::Store(store) = &source {
            tell(path, store.manifest());
        }
        Ok(source)
    }

    fn opened(&self, path: &Path, nodes_know: bool) -> Result<Source, Failure> {
        BrickGrid::new(glam::UVec3::ONE, self.brick).map_err(Failure::usage)?;
        if path.is_dir() {
            if self.regions.segmentation_range.is_some() || self.regions.labels.is_some() {
                let why = "is a store, with the regions that it was prepared with: leave --segmentation-range and --labels \
                           out, or prepare it anew";
                return Err(Failure::usage(anyhow!("{} {why}", path.display())));
            }
            return Ok(Source::Store(Store::open(path)?));
        }
        // What is there but no regular file is refused by name, not taken for a name that nodes know.
        if path.exists() {
            return Ok(Source::Store(self.prepared(path)?));
        }
        match path.to_str() {
            Some(name) if nodes_know => Ok(Source::Name(name.to_owned())),
            _ => Err(anyhow!("{}: no such file or store", path.display()).into()),
        }
    }

    fn prepared(&self, input: &Path) -> Result<Store, Failure> {
        let hints = self.raw.hints()?;
        let cache = self.cache.folder();
        let stem = input.file_stem().and_then(|s| s.to_str()).unwrap_or("volume");
        let target = cache.join(format!("{stem}-{:016x}", self.key(input)?));
        if target.is_dir() {
            match Store::open(&target) {
                Ok(store) => {
                    tracing::info!("using the prepared store {}", target.display());
                    return Ok(store);
                }
                Err(error) => tracing::warn!("the cached store cannot be used and is made again: {error}"),
            }
        }
        std::fs::create_dir_all(&cache).with_context(|| {
            format!("cache folder {}: cannot be made; name another with --cache-dir", cache.display())
        })?;
        let range = self.range.map(|[lo, hi]| (lo, hi));
        let regions = self.regions.options(self.raw.dims)?;
        let options =
            PrepareOptions { brick_size: self.brick, range, force: true, regions, ..PrepareOptions::default() };
        prepare_input(input, &hints, &target, &options)?;
        Ok(Store::open(&target)?)
    }

    /// Changes whenever the prepared store would: place, size and times of every file that the readers of input and labels open, and
    /// every option.
    fn key(&self, input: &Path) -> Result<u64, Failure> {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        let (regions, version) = (self.regions.options(self.raw.dims)?, env!("CARGO_PKG_VERSION"));
        let mut files = format::open(input, &self.raw.hints()?)?.files().to_vec();
        if let Some(Segmentation::Labels { path, hints }) = regions.as_ref().map(|r| &r.segmentation) {
            files.extend_from_slice(format::open(path, hints)?.files());
        }
        for file in files {
            let place = file.canonicalize().with_context(|| format!("{}: cannot be found", file.display()))?;
            let data = place.metadata().with_context(|| format!("{}: cannot be read", file.display()))?;
            hasher.write(place.as_os_str().as_encoded_bytes());
            let text = format!("|{}|{:?}|{:?}|", data.len(), data.modified().ok(), inode(&data));
            hasher.write(text.as_bytes());
        }
        let options = format!("{}|{:?}|{:?}|{regions:?}|{version}|{STORE_VERSION}", self.brick, self.range, self.raw);
        hasher.write(options.as_bytes());
        Ok(hasher.finish())
    }
}

/// Which file it is and when anything of it changed last, in seconds and nanoseconds: tells apart what was put in its place or given
/// the old time.
#[cfg(unix)]
fn inode(data: &std::fs::Metadata) -> (u64, i64, i64) {
    use std::os::unix::fs::MetadataExt as _;
    (data.ino(), data.ctime(), data.ctime_nsec())
}

#[cfg(not(unix))]
fn inode(_: &std::fs::Metadata) {}

/// Tells what is known of how a volume became a store, once a run, however often it is opened. The notes are harmless: see
/// [`Manifest::notes`].
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

impl CacheArgs {
    /// The folder for prepared inputs.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        if let Some(folder) = &self.cache_dir {
            return folder.clone();
        }
        let base = std::env::var_os("XDG_CACHE_HOME")
            .map(PathBuf::from)
            .or_else(|| std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache")))
            .filter(|p| p.is_absolute())
            .unwrap_or_else(std::env::temp_dir);
        base.join("brickcast")
    }
}

/// Prepares `input` into `target`, showing progress and telling what the reader noticed.
///
/// # Errors
/// As [`format::open`] and [`prepare`].
pub fn prepare_input(
    input: &Path,
    hints: &RawHints,
    target: &Path,
    options: &PrepareOptions,
) -> Result<PrepareSummary, Failure> {
    let mut source = format::open(input, hints)?;
    let bar = Bar::new(&format!("preparing {}", input.display()));
    let options = PrepareOptions {
        source_name: input.file_name().and_then(|n| n.to_str()).map(str::to_owned),
        source_bytes: input.metadata().ok().map(|m| m.len()),
        ..options.clone()
    };
    let mut phase = None;
    let summary = prepare(source.as_mut(), target, &options, &mut |p| {
        if phase.replace(p.phase) != Some(p.phase) {
            bar.say(&format!("{} {}", words(p.phase), input.display()));
        }
        bar.at(p.done, p.total);
    })?;
    bar.finish();
    tell(input, &summary.manifest);
    Ok(summary)
}

/// A phase, before the name of what is prepared.
fn words(phase: Phase) -> &'static str {
    match phase {
        Phase::Unpack => "unpacking",
        Phase::Scan | Phase::Write | Phase::Finish => "preparing",
        Phase::Flood => "flood filling",
        Phase::Distances => "distances of",
        Phase::Regions => "regions of",
        Phase::Labels => "writing regions of",
        Phase::Verify => "verifying",
    }
}

impl Source {
    /// The local store's hash, or the name.
    #[must_use]
    pub fn choice(&self) -> crate::session::StoreChoice {
        match self {
            Self::Store(store) => crate::session::StoreChoice::Hash(store.hash()),
            Self::Name(name) => crate::session::StoreChoice::Name(name.clone()),
        }
    }
}

/// For messages.
#[must_use]
pub fn short(hash: StoreHash) -> String {
    hash.to_string().chars().take(12).collect()
}
