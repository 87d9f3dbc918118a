//! The volume of a render: a store, an input, a series of stores, or a name that the nodes know.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::store::Series;

use super::redraw::Redraw;
use super::scenes::ScenesPlan;
use super::time::TimePlan;
use crate::cli::args::{OnTheWayArgs, TimeChoice};
use crate::cli::failure::Failure;
use crate::cli::source::{Source, series_at};

/// The volume.
#[derive(Debug)]
pub(super) struct SourcePlan {
    /// None: the nodes know it by the hash.
    path: Option<PathBuf>,
    /// As it was given, or as a manifest has it: for manifests.
    pub(super) given: Option<String>,
    prepare: OnTheWayArgs,
    nodes_know: bool,
    /// Where the path is one.
    series: Option<Series>,
}

impl SourcePlan {
    /// # Errors
    /// Usage: no path, and no manifest that tells it. A series that is broken.
    pub(super) fn of(
        path: Option<PathBuf>,
        prepare: OnTheWayArgs,
        redraw: Option<&Redraw>,
        nodes_know: bool,
    ) -> Result<Self, Failure> {
        let (path, given) = match (path, redraw) {
            (Some(path), _) => {
                let given = path.display().to_string();
                (Some(path), Some(given))
            }
            (None, Some(redraw)) => {
                let told = redraw.manifests.first().and_then(|manifest| manifest.path.clone());
                match (&told, nodes_know) {
                    (_, true) => (None, told),
                    (Some(path), false) => (Some(redraw.told_path(path)?), told),
                    (None, false) => {
                        let manifest = redraw.path.display();
                        return Err(Failure::usage(anyhow!(
                            "--scene {manifest}: it does not tell where its store lies: give PATH, or --nodes that \
                             have it"
                        )));
                    }
                }
            }
            (None, None) => return Err(Failure::usage(anyhow!("PATH is missing"))),
        };
        let series = path.as_deref().map(series_at).transpose()?.flatten();
        Ok(Self { path, given, prepare, nodes_know, series })
    }

    /// Which step each of `frames` shows, where it is a series.
    ///
    /// # Errors
    /// Usage: steps that are not there, several of what is no series. Pictures of other stores than its steps.
    pub(super) fn time_plan(&self, frames: Option<u32>, redraw: Option<&Redraw>) -> Result<Option<TimePlan>, Failure> {
        let asked = self.prepare.raw.time;
        match (&self.series, redraw) {
            (None, Some(redraw)) => redraw.check_one_store().map(|()| None),
            (None, None) => match asked {
                Some(several @ (TimeChoice::Range(..) | TimeChoice::All)) => {
                    let why =
                        "is no series of stores; brickcast prepare makes one, of several inputs or of several times";
                    Err(Failure::usage(anyhow!("--time {several}: {} {why}", self.shown().display())))
                }
                _ => Ok(None),
            },
            (Some(_), Some(redraw)) if asked.is_some() => {
                let file = redraw.path.display();
                Err(Failure::usage(anyhow!("--time: {file} says which step each picture is of: leave it out")))
            }
            (Some(series), Some(redraw)) => {
                let step =
                    |hash: StoreHash| series.step_of(hash).ok_or_else(|| redraw.another_store(self.shown(), hash));
                let steps = redraw.manifests.iter().map(|manifest| step(manifest.store)).collect::<Result<_, _>>()?;
                Ok(Some(TimePlan::new(series.clone(), steps, false)))
            }
            (Some(series), None) => TimePlan::asked(series, asked, frames).map(Some),
        }
    }

    /// For people.
    pub(super) fn shown(&self) -> &Path {
        self.path.as_deref().unwrap_or(Path::new("the store"))
    }

    /// Opens it; an input is prepared on the way. Not of a series.
    ///
    /// # Errors
    /// As [`OnTheWayArgs::open`]; another store than that of `scenes`.
    pub(super) fn open(&self, scenes: &ScenesPlan, quiet: bool) -> Result<Source, Failure> {
        let source = match (&self.path, scenes.store()) {
            (Some(path), _) => {
                let prepare = self.prepare.clone().with_regions_for(path, scenes.shows_regions().as_deref(), quiet)?;
                prepare.open(path, self.nodes_know)?
            }
            (None, Some(hash)) => Source::Hash(hash),
            (None, None) => return Err(Failure::usage(anyhow!("PATH is missing"))),
        };
        if let Source::Store(store) = &source {
            self.agree(scenes, store.hash())?;
        }
        Ok(source)
    }

    /// # Errors
    /// The store is another one than that of the pictures that are drawn again.
    pub(super) fn agree(&self, scenes: &ScenesPlan, got: StoreHash) -> Result<(), Failure> {
        match scenes {
            ScenesPlan::Drawn(redraw) if scenes.store().is_some_and(|wanted| wanted != got) => {
                Err(redraw.another_store(self.shown(), got))
            }
            ScenesPlan::Drawn(_) | ScenesPlan::Asked { .. } => Ok(()),
        }
    }
}
