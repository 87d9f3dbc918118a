//! What PATH means: a store, an input that is prepared on the way, or a name that the nodes know.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use brickcast_remote::{Address, Place, PlaceError};
use brickcast_volume::StoreHash;
use brickcast_volume::brick::BrickGrid;
use brickcast_volume::format::{Facts, facts_of_store};
use brickcast_volume::store::{
    MANIFEST_FILE, Manifest, PrepareOptions, SERIES_FILE, STORE_VERSION, Series, Store, StoreError, ViewFile, survey,
};

use super::args::{DEFAULT_SEGMENTATION_RANGE, OnTheWayArgs, RawArgs, TimeChoice};
use super::failure::Failure;
use super::input::{is_input, open_input, prepare_input, tell, view_of};
use super::progress::Bar;
use super::say::say;
use crate::cache::{Key, Wanted};
use crate::session::StoreChoice;
use crate::stored;

/// A path that was understood.
#[derive(Debug)]
pub enum Source {
    /// A store on this machine.
    Store(Store),
    /// A name that only the nodes know.
    Name(String),
    /// A store that only the nodes have.
    Hash(StoreHash),
}

/// What is known of a volume without rendering it.
#[derive(Debug)]
pub struct Surveyed {
    pub manifest: Manifest,
    /// Who says what is known of the volume.
    pub source_of: Facts,
    /// Where the path is a store.
    pub store: Option<Store>,
    /// Where the voxels of a view lie, in its words.
    pub view: Option<String>,
    /// Where the path is a series of which no step was named: the rest is of its first one, but for what is said of the
    /// voxels of all.
    pub series: Option<Series>,
}

/// Reads a store's manifest, or an input once from end to end; nothing is prepared.
///
/// # Errors
/// Neither an input nor a store; what the reader finds wrong.
pub fn surveyed(path: &Path, raw: &RawArgs) -> Result<Surveyed, Failure> {
    let place = place(path)?;
    if is_place_of_many_files(&place) {
        match stored::open(&place) {
            Ok(store) => {
                let view = ViewFile::read(place.objects().as_ref())?.map(|file| file.input.place);
                return Ok(Surveyed {
                    manifest: store.manifest().clone(),
                    source_of: facts_of_store(),
                    store: Some(store),
                    view,
                    series: None,
                });
            }
            Err(StoreError::NotAStore { .. }) if let Some(series) = Series::find(place.objects())? => {
                let store = step_of(&series, raw.time.unwrap_or(TimeChoice::One(0)))?;
                let of_all = raw.time.is_none().then(|| series.manifest().statistics.in_place_of(store.manifest()));
                let series = of_all.is_some().then_some(series);
                let manifest = of_all.unwrap_or_else(|| store.manifest().clone());
                return Ok(Surveyed { manifest, source_of: facts_of_store(), store: Some(store), view: None, series });
            }
            Err(error) if is_input(&place, &error)? => {}
            Err(error) => return Err(error.into()),
        }
    }
    let mut source = open_input(&place, &raw.hints()?)?;
    let bar = Bar::new(&format!("reading {}", path.display()));
    let manifest = survey(source.as_mut(), &mut |p| bar.at(p.done, p.total))?;
    bar.finish();
    let source_of = source.header().source_of();
    Ok(Surveyed { manifest, source_of, store: None, view: None, series: None })
}

/// The series at `path`; nothing where there is none.
///
/// # Errors
/// As [`place`]; a series that is broken.
pub fn series_at(path: &Path) -> Result<Option<Series>, Failure> {
    let place = place(path)?;
    match is_place_of_many_files(&place) {
        // A server may refuse to say that something is not there.
        true if matches!(place, Place::Far(_)) => Ok(Series::find(place.objects()).unwrap_or(None)),
        true => Ok(Series::find(place.objects())?),
        false => Ok(None),
    }
}

/// Does a series lie at `path`, however broken?
///
/// # Errors
/// As [`place`].
pub fn is_series(path: &Path) -> Result<bool, Failure> {
    let place = place(path)?;
    Ok(is_place_of_many_files(&place) && place.objects().open(SERIES_FILE).is_ok_and(|file| file.size().is_ok()))
}

/// The store of one step.
fn step_of(series: &Series, asked: TimeChoice) -> Result<Store, Failure> {
    let steps = asked.steps(series.manifest().steps.len());
    let place = series.place().display();
    match steps.map_err(|why| Failure::usage(anyhow!("{why} in the series {place}")))?[..] {
        [step] => Ok(series.open_step(step)?),
        _ => Err(Failure::usage(anyhow!("--time {asked}: one step is needed here, and only render shows several"))),
    }
}

/// By what nodes elsewhere find a step.
pub fn choice_of_step(series: &Series, step: usize, hash: StoreHash) -> StoreChoice {
    let address = series.place().to_str().filter(|_| series.is_far()).and_then(|text| Address::new(text).ok());
    match address.filter(|address| !address.is_listed()) {
        Some(address) => StoreChoice::Name(format!("{}/{step}", address.to_string().trim_end_matches('/'))),
        None => StoreChoice::Hash(hash),
    }
}

/// A folder, or a place behind a network: a store, or an input of many files.
fn is_place_of_many_files(place: &Place) -> bool {
    !matches!(place, Place::Folder(path) if !path.is_dir())
}

/// Where `path` leads; an address that is none is wrong usage.
///
/// # Errors
/// No address of a kind that is read from, one with a secret in it; settings in the environment that cannot be.
pub fn place(path: &Path) -> Result<Place, Failure> {
    Place::of(path).map_err(|error| match error {
        PlaceError::Address(error) => Failure::usage(error),
        error => error.into(),
    })
}

/// A file or folder of this machine: `file:///path`, or as it is.
///
/// # Errors
/// As [`place`]; what lies behind a network, where only files are read or written.
pub fn local(path: &Path) -> Result<PathBuf, Failure> {
    match place(path)? {
        Place::Folder(path) => Ok(path),
        Place::Far(root) => {
            let why = "lies behind a network, where only single volumes are prepared to; name a folder of this machine";
            Err(Failure::usage(anyhow!("{} {why}", root.address())))
        }
    }
}

impl OnTheWayArgs {
    /// With regions, where an input is prepared for a picture of them, asked for by the flag `asked`, and nothing was
    /// said of how to find them.
    ///
    /// # Errors
    /// stderr cannot be written.
    pub fn with_regions_for(mut self, path: &Path, asked: Option<&str>, quiet: bool) -> Result<Self, Failure> {
        let is_input = || {
            brickcast_formats::file_of(path).is_file()
                || brickcast_formats::is_pattern(path)
                || (path.is_dir() && !path.join(MANIFEST_FILE).exists())
        };
        if let (Some(asked), true, true) = (asked, self.regions.is_silent(), is_input()) {
            let range = DEFAULT_SEGMENTATION_RANGE;
            self.regions.segmentation_range = Some(range);
            let shown = path.display();
            say(quiet, &format!("{asked} wants regions: {shown} is prepared with --segmentation-range {range}"))?;
        }
        Ok(self)
    }

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
        let place = place(path)?;
        let path = if let Place::Folder(path) = &place { path } else { path };
        if is_place_of_many_files(&place) {
            let store = match stored::open(&place) {
                Err(StoreError::NotAStore { .. }) if let Some(series) = Series::find(place.objects())? => {
                    let asked =
                        self.raw.time.ok_or_else(|| Failure::usage(anyhow!("{}, or --time 0", series.words())))?;
                    step_of(&series, asked)?
                }
                Err(error) if is_input(&place, &error)? => return Ok(Source::Store(self.prepared(&place, path)?)),
                store => store?,
            };
            if self.regions.segmentation_range.is_some() || self.regions.labels.is_some() {
                let why = "is a store, with the regions that it was prepared with: leave --segmentation-range and \
                           --labels out, or prepare it anew";
                return Err(Failure::usage(anyhow!("{} {why}", path.display())));
            }
            return Ok(Source::Store(store));
        }
        // What is there but no regular file is refused by name, not taken for a name that nodes know.
        if brickcast_formats::file_of(path).exists() || brickcast_formats::is_pattern(path) {
            return Ok(Source::Store(self.prepared(&place, path)?));
        }
        match path.to_str() {
            Some(name) if nodes_know => Ok(Source::Name(name.to_owned())),
            _ => Err(anyhow!("{}: no such file or store", path.display()).into()),
        }
    }

    fn prepared(&self, place: &Place, input: &Path) -> Result<Store, Failure> {
        let hints = self.raw.hints()?;
        let range = self.range.map(|[lo, hi]| (lo, hi));
        let regions = self.regions.options(&hints)?;
        let source = open_input(place, &hints)?;
        let header = source.header();
        // What lies in chunks already is shown where it is; a stack of slices does not.
        let in_chunks = is_place_of_many_files(place) && brickcast_zarr::is_zarr(place.objects().as_ref())?;
        let view = in_chunks.then(|| view_of(place, &hints, None)).transpose()?;
        let options =
            PrepareOptions { brick_size: self.brick, range, force: true, regions, view, ..PrepareOptions::default() };
        // As if nothing could be compressed; what is wider is mapped to 16 bits. Coarser levels are a seventh more.
        let finest = header.geometry.voxel_count().saturating_mul(header.voxel_type.bytes().min(2) as u64);
        let bytes = match &options.view {
            None => finest.saturating_add(finest / 7),
            // Coarser levels, and halos.
            Some(_) => finest / 2,
        };
        let version = env!("CARGO_PKG_VERSION");
        let PrepareOptions { brick_size: brick, regions, levels, view, .. } = &options;
        let how = format!("{range:?}|{:?}|{regions:?}|{levels:?}", self.raw);
        let mut words = format!("{brick}|{how}|{version}|{STORE_VERSION}|{view:?}");
        if let Some(array) = brickcast_formats::array_of(input) {
            // Of one file, each array is a volume of its own.
            write!(words, "|{array:?}").map_err(anyhow::Error::new)?;
        }
        if let Place::Far(root) = place {
            // No file tells whether voxels were changed: that is seen chunk by chunk, where they are read.
            write!(words, "|{}|{header:?}", root.address()).map_err(anyhow::Error::new)?;
        }
        let store = self.cache.open()?.obtain(&Wanted {
            input,
            bytes,
            key: &|| {
                let files = options.inputs(open_input(place, &hints)?.as_ref())?;
                Key::new(input, &files, &words)
            },
            make: &|target| prepare_input(place, &hints, target, &options).map(drop),
        })?;
        Ok(store)
    }
}

impl Source {
    /// As [`Source::choice`], for nodes elsewhere: a server that does not list what it has is not searched for a hash.
    #[must_use]
    pub fn choice_elsewhere(&self) -> StoreChoice {
        let address = |store: &Store| Address::new(store.path().to_str()?).ok().filter(|address| !address.is_listed());
        match self {
            Self::Store(store) if store.is_far() => {
                address(store).map_or(self.choice(), |address| StoreChoice::Name(address.to_string()))
            }
            _ => self.choice(),
        }
    }

    /// The store's hash, or the name.
    #[must_use]
    pub fn choice(&self) -> StoreChoice {
        match self {
            Self::Store(store) => StoreChoice::Hash(store.hash()),
            Self::Name(name) => StoreChoice::Name(name.clone()),
            Self::Hash(hash) => StoreChoice::Hash(*hash),
        }
    }
}
