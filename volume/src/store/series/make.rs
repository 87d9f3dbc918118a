//! From several inputs to a series: they are looked at one after the other, then prepared one after the other.

use std::path::{Path, PathBuf};

use super::alike::check_headers;
use crate::format::{SourceHeader, VolumeSource};
use crate::ids::StoreHash;
use crate::store::error::StoreError;
use crate::store::files::target::Target;
use crate::store::files::workdir::{check_inputs, write_synced};
use crate::store::hash::ContentHash;
use crate::store::manifest::Manifest;
use crate::store::prepare::job::{look_at, prepare_in};
use crate::store::prepare::options::{PrepareOptions, PrepareSummary};
use crate::store::prepare::step_map::StepMap;
use crate::store::profile::{GROUP_FILE, SERIES_FILE, SERIES_LIST_FILE};
use crate::store::progress::Progress;
use crate::store::series_manifest::file::{GROUP, check_times, list};
use crate::store::series_manifest::{CommonStatistics, MAX_STEPS, SeriesManifest, StepEntry};

/// A series in the making: [`SeriesWriter::look_at`] every input in its order, then [`SeriesWriter::add`] every one in
/// the same order, then [`SeriesWriter::finish`]. Dropped before that, it leaves nothing.
#[derive(Debug)]
pub struct SeriesWriter {
    work: Target,
    options: PrepareOptions,
    /// Of the first input.
    header: Option<SourceHeader>,
    /// Of each input that was looked at.
    looks: Vec<StepMap>,
    steps: Vec<(StoreHash, Manifest)>,
    bytes: u64,
}

/// What was made.
#[derive(Debug, Clone)]
pub struct SeriesSummary {
    pub hash: StoreHash,
    pub manifest: SeriesManifest,
    /// Of one of the steps, the first.
    pub first: Manifest,
    pub store_bytes: u64,
}

impl SeriesWriter {
    /// Of a series at `out`, each of whose steps is made with these options. `inputs`: all files that they are made of.
    ///
    /// # Errors
    /// A target that exists or is no store or series, or holds one of the inputs.
    pub fn create(out: &Path, options: &PrepareOptions, inputs: &[PathBuf]) -> Result<Self, StoreError> {
        check_inputs(out, inputs)?;
        let work = Target::folder(out, options.force)?;
        let options = options.clone();
        Ok(Self { work, options, header: None, looks: Vec::new(), steps: Vec::new(), bytes: 0 })
    }

    /// Finds what the next input has in common with those before.
    ///
    /// # Errors
    /// An input that differs from the first, by its step; one that cannot be read.
    pub fn look_at(
        &mut self,
        source: &mut dyn VolumeSource,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(), StoreError> {
        let step = self.looks.len();
        if step >= MAX_STEPS {
            return Err(StoreError::TooManySteps { max: MAX_STEPS });
        }
        let header = source.header().clone();
        match &self.header {
            Some(first) => check_headers(step, &header, first)?,
            None => self.header = Some(header),
        }
        let look = look_at(source, self.options.range, progress).map_err(|error| error.of_step(step))?;
        self.looks.push(look);
        Ok(())
    }

    /// Prepares the next step.
    ///
    /// # Errors
    /// As [`prepare`](crate::store::prepare); an input that is not the one that was looked at.
    pub fn add(
        &mut self,
        source: &mut dyn VolumeSource,
        (name, bytes): (Option<String>, Option<u64>),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<&Manifest, StoreError> {
        let step = self.steps.len();
        if let Some(first) = &self.header {
            check_headers(step, source.header(), first)?;
        }
        let (source_name, source_bytes) = (name, bytes);
        let own = self.looks.get(step).copied();
        let steps = own.map(|own| self.looks.iter().fold(own, |map, other| map.joined(*other)));
        let options = PrepareOptions { source_name, source_bytes, steps, ..self.options.clone() };
        self.work.enter(step)?;
        let made = prepare_in(&self.work, source, &options, progress).map_err(|error| error.of_step(step));
        self.work.leave();
        let PrepareSummary { hash, manifest, store_bytes, .. } = made?;
        self.bytes = self.bytes.saturating_add(store_bytes);
        self.steps.push((hash, manifest));
        Ok(&self.steps[step].1)
    }

    /// Makes the finished series appear at its place. `times`: of all steps, or none.
    ///
    /// # Errors
    /// Times that do not ascend; a disk that fails.
    pub fn finish(self, times: &[f64], time_unit: Option<String>) -> Result<SeriesSummary, StoreError> {
        let count = self.steps.len();
        if !times.is_empty() && times.len() != count {
            return Err(StoreError::StepTimes(format!("{} times for {count} steps", times.len())));
        }
        let times: Vec<Option<f64>> = (0..count).map(|step| times.get(step).copied()).collect();
        check_times(&times).map_err(StoreError::StepTimes)?;
        let (hashes, manifests): (Vec<StoreHash>, Vec<Manifest>) = self.steps.into_iter().unzip();
        let statistics = CommonStatistics::of(&manifests);
        let (Some(statistics), Some(first)) = (statistics, manifests.into_iter().next()) else {
            return Err(StoreError::StepTimes("there are no steps".to_owned()));
        };
        let (root, list) = (self.work.store(), list(count));
        let manifest = SeriesManifest {
            steps: hashes.into_iter().zip(times).map(|(hash, time)| StepEntry { hash, time }).collect(),
            time_unit,
            statistics,
            files: [ContentHash::of(GROUP), ContentHash::of(&list)],
        };
        let bytes = manifest.to_bytes()?;
        // What was just written must be readable: the same checks that every reader makes.
        SeriesManifest::from_bytes(&bytes)?;
        write_synced(&root.join(GROUP_FILE), GROUP)?;
        write_synced(&root.join(SERIES_LIST_FILE), &list)?;
        write_synced(&root.join(SERIES_FILE), &bytes)?;
        self.work.publish()?;
        let own = (GROUP.len() + list.len() + bytes.len()) as u64;
        Ok(SeriesSummary { hash: StoreHash::of(&bytes), manifest, first, store_bytes: self.bytes + own })
    }
}
