//! Which dataset is the volume: the one that is named, else what NeXus or DXchange say, else the only one that can be.

use std::collections::{HashSet, VecDeque};
use std::path::Path;

use brickcast_volume::format::excerpt;
use hdf5_reader::Hdf5File;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::LinkTarget;

use super::attributes::text;
use super::kind;
use super::links::{At, header, links, resolve, root};
use crate::wrong::Wrong;

/// Objects that are looked at for datasets.
const MOST_OBJECTS: usize = 20_000;
const MOST_STEPS: usize = 16;
/// Candidates that are told of.
const MOST_TOLD: usize = 12;
const DX_CHANGE: &str = "/exchange/data";

/// A dataset, for people.
struct Candidate {
    at: At,
    told: String,
    /// Of numbers, with three axes longer than one or more.
    is_volume: bool,
}

fn is_dataset(file: &Hdf5File, at: &At) -> bool {
    header(file, at).is_ok_and(|header| header.messages.iter().any(|m| matches!(m, HdfMessage::DataLayout(_))))
}

/// Hard links alone: each object once, by the path that is shortest.
fn candidates(file: &Hdf5File) -> Result<Vec<Candidate>, Wrong> {
    let mut found = Vec::new();
    let mut waiting = VecDeque::from([root(file)?]);
    let mut seen = HashSet::from([waiting[0].address]);
    while let Some(at) = waiting.pop_front() {
        let header = match header(file, &at) {
            Ok(header) => header,
            // One that cannot be read does not hide the others.
            Err(_) => {
                found.push(Candidate { told: format!("{} (cannot be read)", at.path), at, is_volume: false });
                continue;
            }
        };
        let (mut shape, mut name, mut has_data) = (None, None, false);
        for message in &header.messages {
            match message {
                HdfMessage::Dataspace(space) => shape = Some(space.dims.clone()),
                HdfMessage::Datatype(datatype) => name = kind::name(&datatype.datatype),
                HdfMessage::DataLayout(_) => has_data = true,
                _ => {}
            }
        }
        if let (Some(shape), true) = (shape, has_data) {
            let is_volume = name.is_some() && shape.iter().filter(|n| **n > 1).count() >= 3;
            let axes: Vec<String> = shape.iter().map(u64::to_string).collect();
            let told = format!("{} ({} of {})", at.path, axes.join(" x "), name.as_deref().unwrap_or("no numbers"));
            found.push(Candidate { at, told, is_volume });
            continue;
        }
        for (name, target) in links(file, &header).unwrap_or_default() {
            if let LinkTarget::Hard { address } = target
                && seen.len() < MOST_OBJECTS
                && seen.insert(address)
            {
                waiting.push_back(At { path: format!("{}/{name}", at.path), address });
            }
        }
    }
    Ok(found)
}

/// By NeXus: from the root along `default` to a group whose `signal` names a dataset.
fn nexus(file: &Hdf5File) -> Option<At> {
    let mut at = root(file).ok()?;
    for _ in 0..MOST_STEPS {
        if let Some(signal) = signal(file, &at) {
            return Some(signal);
        }
        let next = text(file, &at, "default")?;
        at = resolve(file, &at, &next).ok()??;
    }
    None
}

fn signal(file: &Hdf5File, group: &At) -> Option<At> {
    let name = text(file, group, "signal")?;
    resolve(file, group, &name).ok()?.filter(|at| is_dataset(file, at))
}

/// Where the volume lies.
pub(super) fn dataset(file: &Hdf5File, path: &Path, named: Option<&str>, notes: &mut Vec<String>) -> Result<At, Wrong> {
    let root = root(file)?;
    if let Some(name) = named {
        let at = resolve(file, &root, name)?;
        let dataset = at.and_then(|at| match is_dataset(file, &at) {
            true => Some(at),
            // Says that it is virtual, where it is.
            false => signal(file, &at).or_else(|| header(file, &at).is_err().then_some(at)),
        });
        return match dataset {
            Some(at) => {
                notes.push(format!("dataset `{}`, as named", excerpt(&at.path)));
                Ok(at)
            }
            None => Err(which(path, format!("there is no dataset `{}`", excerpt(name)), &candidates(file)?)),
        };
    }
    let all = candidates(file)?;
    let is_volume = |at: &At| all.iter().any(|c| c.at.address == at.address && c.is_volume);
    if let Some(at) = nexus(file) {
        match is_volume(&at) {
            true => {
                notes.push(format!("dataset `{}`, NeXus's default", excerpt(&at.path)));
                return Ok(at);
            }
            false => notes.push(format!("NeXus's default `{}` is no volume", excerpt(&at.path))),
        }
    }
    if let Some(at) = resolve(file, &root, DX_CHANGE).ok().flatten().filter(is_volume) {
        notes.push(format!("dataset `{DX_CHANGE}`, as DXchange has it"));
        return Ok(at);
    }
    let volumes: Vec<&Candidate> = all.iter().filter(|c| c.is_volume).collect();
    match volumes[..] {
        [only] => {
            notes.push(format!("dataset `{}`, the only one of three axes", excerpt(&only.at.path)));
            Ok(only.at.clone())
        }
        [] => Err(which(path, "there is no dataset of numbers with three axes".into(), &all)),
        _ => Err(which(path, format!("there are {} datasets that could be the volume", volumes.len()), &all)),
    }
}

/// Names the candidates, volumes before others, and what to say.
fn which(path: &Path, why: String, all: &[Candidate]) -> Wrong {
    let of = |is_volume| all.iter().filter(move |c| c.is_volume == is_volume);
    let mut told: Vec<String> = of(true).chain(of(false)).map(|c| excerpt(&c.told)).collect();
    let more = told.len().saturating_sub(MOST_TOLD);
    told.truncate(MOST_TOLD);
    if more > 0 {
        told.push(format!("{more} more"));
    }
    if told.is_empty() {
        return Wrong::new("dataset", format!("{why}; the file holds none"), "write the volume into a dataset");
    }
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let example = of(true).chain(of(false)).next().map_or("/path", |c| &c.at.path);
    let say = format!("{why}; there are: {}. Say which, e.g. `{file}:{example}`", told.join(", "));
    Wrong::new("dataset", say, "name one with three axes")
}
