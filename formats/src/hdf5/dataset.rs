//! What the header of a dataset says: its axes, numbers, and where they lie.

use brickcast_volume::format::RawHints;
use hdf5_reader::Hdf5File;
use hdf5_reader::io::Cursor;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::filter_pipeline::FilterDescription;
use hdf5_reader::messages::layout::{ChunkIndexing, DataLayout};

use super::attributes::{text, texts};
use super::filters;
use super::kind::Kind;
use super::links::{At, header};
use crate::wrong::Wrong;

/// Axes of a dataset that are read; the format knows 32.
const MOST_AXES: usize = 8;
/// What may be channels where no name says so.
const MOST_CHANNELS: u64 = 4;

/// Where the numbers lie.
#[derive(Debug)]
pub(super) enum Stored {
    /// In the header itself.
    Here(Vec<u8>),
    /// In a row from this byte on.
    InARow(u64),
    Chunks {
        index: u64,
        /// As many as the dataset has axes, none of them 0.
        dims: Vec<u32>,
        indexing: Option<ChunkIndexing>,
        filters: Vec<FilterDescription>,
    },
    /// Nowhere: they were never written.
    Nowhere,
}

#[derive(Debug)]
pub(super) struct Dataset {
    pub(super) shape: Vec<u64>,
    pub(super) max_shape: Vec<u64>,
    pub(super) kind: Kind,
    pub(super) stored: Stored,
    /// The number of what was not written, as the file has numbers.
    pub(super) fill: Vec<u8>,
    /// Which axis of the dataset is x, y, z of the volume; nothing for an axis that it has not.
    pub(super) axes: [Option<usize>; 3],
    /// Where the volume lies along the other axes, 0 for its own.
    pub(super) at: Vec<u64>,
    /// Letters of the axes where the file says them.
    pub(super) names: Option<Vec<String>>,
}

impl Dataset {
    pub(super) fn open(file: &Hdf5File, at: &At, hints: &RawHints, notes: &mut Vec<String>) -> Result<Self, Wrong> {
        let header = header(file, at)?;
        let of_file = file.dataset(&at.path).map_err(|e| Wrong::broken("dataset", e))?;
        let kind = Kind::of(&of_file.raw_datatype().map_err(|e| Wrong::broken("datatype", e))?)?;
        let (mut space, mut layout, mut fill, mut filters) = (None, None, None, Vec::new());
        for message in &header.messages {
            match message {
                HdfMessage::Dataspace(message) => space = Some(message),
                HdfMessage::DataLayout(message) => layout = Some(&message.layout),
                HdfMessage::FillValue(message) => fill = message.value.clone().or(fill),
                HdfMessage::FilterPipeline(message) => filters = message.filters.clone(),
                HdfMessage::ExternalFiles(_) => {
                    let why = "its numbers lie in raw files beside";
                    return Err(Wrong::new("external files", why, "copy it with h5repack, or read the raw file"));
                }
                _ => {}
            }
        }
        let space = space.ok_or_else(|| Wrong::broken("dataspace", "there is none"))?;
        let shape = space.dims.clone();
        if shape.len() > MOST_AXES {
            return Err(Wrong::new("dataspace", format!("{} axes", shape.len()), "save one volume of axes z, y, x"));
        }
        let voxels = shape.iter().try_fold(1, |n: u64, edge| n.checked_mul(*edge)).filter(|n| *n < 1 << 56);
        if voxels.is_none_or(|n| n == 0) {
            return Err(Wrong::broken("dataspace", format!("{shape:?} is the size of nothing")));
        }
        let max_shape = space.max_dims.clone().filter(|max| max.len() == shape.len()).unwrap_or_else(|| shape.clone());
        let layout = layout.ok_or_else(|| Wrong::broken("layout", "there is none"))?;
        let stored = stored(layout, filters, &shape, file.superblock().offset_size)?;
        // One of another length is none that could be laid out.
        let fill = fill.filter(|fill| fill.len() == kind.bytes).unwrap_or_else(|| vec![0; kind.bytes]);
        let names = axis_names(file, at, shape.len());
        let (axes, at) = axes(&shape, names.as_deref(), hints, notes)?;
        Ok(Self { shape, max_shape, kind, stored, fill, axes, at, names })
    }

    /// x, y, z.
    pub(super) fn dims(&self) -> Result<[u32; 3], Wrong> {
        let mut dims = [1; 3];
        for (dim, axis) in dims.iter_mut().zip(self.axes) {
            let edge = axis.map_or(1, |axis| self.shape[axis]);
            *dim = u32::try_from(edge).map_err(|_| Wrong::new("dataspace", format!("an axis of {edge}"), "crop it"))?;
        }
        Ok(dims)
    }
}

fn stored(
    layout: &DataLayout,
    filters: Vec<FilterDescription>,
    shape: &[u64],
    offset_size: u8,
) -> Result<Stored, Wrong> {
    let is_nowhere = |address: u64| Cursor::is_undefined_offset(address, offset_size);
    Ok(match layout {
        DataLayout::Compact { data } => Stored::Here(data.clone()),
        DataLayout::Contiguous { address, .. } | DataLayout::Chunked { address, .. } if is_nowhere(*address) => {
            Stored::Nowhere
        }
        DataLayout::Contiguous { address, .. } => Stored::InARow(*address),
        DataLayout::Chunked { address, dims, chunk_indexing, .. } => {
            // Newer layouts have the bytes of a number as a last one.
            let dims = dims.get(..shape.len()).unwrap_or(dims);
            if dims.len() != shape.len() || dims.contains(&0) {
                return Err(Wrong::broken("chunks", format!("{dims:?} of a dataset of {shape:?}")));
            }
            filters::check(&filters)?;
            Stored::Chunks { index: *address, dims: dims.to_vec(), indexing: chunk_indexing.clone(), filters }
        }
    })
}

/// Of ilastik (`axistags`), or of NetCDF-like labels: one letter or word an axis, in lower case.
fn axis_names(file: &Hdf5File, at: &At, count: usize) -> Option<Vec<String>> {
    let tags = text(file, at, "axistags").map(|json| {
        let keys = json.split("\"key\"").skip(1);
        keys.filter_map(|rest| rest.split('"').nth(1).map(str::to_ascii_lowercase)).collect::<Vec<_>>()
    });
    let labels = || texts(file, at, "DIMENSION_LABELS").map(|all| all.iter().map(|n| n.to_ascii_lowercase()).collect());
    tags.or_else(labels).filter(|names| names.len() == count && names.iter().all(|name| !name.is_empty()))
}

type Chosen = ([Option<usize>; 3], Vec<u64>);

/// Which axes are x, y and z, and where the volume lies along the others.
fn axes(shape: &[u64], names: Option<&[String]>, hints: &RawHints, notes: &mut Vec<String>) -> Result<Chosen, Wrong> {
    let mut at = vec![0; shape.len()];
    let mut left: Vec<usize> = (0..shape.len()).collect();
    let named = |axis: usize, name: &str| names.is_some_and(|names| names[axis] == name);
    let is_other = |axis: usize| ["t", "time", "c", "channel"].iter().any(|name| named(axis, name));
    // Of length one: first those that are named as no axis of space, then from the front, then from the back.
    while left.len() > 3 || left.iter().any(|axis| shape[*axis] == 1 && is_other(*axis)) {
        let one = |axis: &&usize| shape[**axis] == 1;
        let Some(axis) = left.iter().filter(one).find(|axis| is_other(**axis)).or_else(|| left.iter().find(one)) else {
            break;
        };
        let axis = *axis;
        left.retain(|other| *other != axis);
        notes.push(format!("axis {axis} of length 1 was left out"));
    }
    let mut choose = |axis: usize, what: &str, asked: Option<u64>, left: &mut Vec<usize>| {
        let (chosen, count) = (asked.unwrap_or(0), shape[axis]);
        if chosen >= count {
            let why = format!("{what} {chosen} of {count}, counted from 0");
            return Err(Wrong::new("dataspace", why, "give another --time or --channel"));
        }
        notes.push(format!("{what} {chosen} of {count} was taken, counted from 0: axis {axis} of {shape:?}"));
        at[axis] = chosen;
        left.retain(|other| *other != axis);
        Ok(())
    };
    let find = |left: &[usize], words: [&str; 2]| {
        left.iter().copied().find(|axis| words.iter().any(|word| named(*axis, word)))
    };
    if let Some(axis) = find(&left, ["t", "time"]) {
        choose(axis, "time", hints.time, &mut left)?;
    }
    if let Some(axis) = find(&left, ["c", "channel"]) {
        choose(axis, "channel", hints.channel, &mut left)?;
    }
    if let (&[first, _, _, last], None) = (left.as_slice(), names) {
        let are_channels = shape[last] <= MOST_CHANNELS && shape[last] < shape[first] && hints.time.is_none();
        let (axis, what) = match (are_channels, hints.time, hints.channel) {
            (true, ..) => (last, "channel"),
            (false, None, Some(_)) => (first, "channel"),
            _ => (first, "time"),
        };
        let asked = if what == "time" { hints.time } else { hints.channel };
        choose(axis, what, asked, &mut left)?;
    }
    match left[..] {
        [z, y, x] => Ok(([Some(x), Some(y), Some(z)], at)),
        [y, x] => Ok(([Some(x), Some(y), None], at)),
        _ => {
            let why = format!("{} axes {shape:?}, which are not x, y, z, time and channel", left.len());
            Err(Wrong::new("dataspace", why, "save one volume of axes z, y, x"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(shape: &[u64], names: &str, hints: &RawHints) -> Result<Chosen, Wrong> {
        let names: Vec<String> = names.chars().map(String::from).collect();
        axes(shape, (!names.is_empty()).then_some(&names[..]), hints, &mut Vec::new())
    }

    #[test]
    fn axes_of_space_are_found_among_others() {
        let (none, xyz) = (RawHints::default(), |x, y, z| [Some(x), Some(y), Some(z)]);
        let time = |t| RawHints { time: Some(t), ..RawHints::default() };
        let channel = |c| RawHints { channel: Some(c), ..RawHints::default() };
        assert_eq!(chosen(&[4, 5, 6], "", &none), Ok((xyz(2, 1, 0), vec![0; 3])));
        assert_eq!(chosen(&[5, 6], "", &none), Ok(([Some(1), Some(0), None], vec![0; 2])));
        assert_eq!(chosen(&[1, 1, 4, 5, 6], "", &none), Ok((xyz(4, 3, 2), vec![0; 5])));
        assert_eq!(chosen(&[4, 5, 6, 1], "", &none), Ok((xyz(2, 1, 0), vec![0; 4])));
        assert_eq!(chosen(&[7, 4, 5, 6], "", &time(3)), Ok((xyz(3, 2, 1), vec![3, 0, 0, 0])));
        assert_eq!(chosen(&[7, 4, 5, 6], "", &channel(2)), Ok((xyz(3, 2, 1), vec![2, 0, 0, 0])));
        assert_eq!(chosen(&[7, 5, 6, 3], "", &channel(2)), Ok((xyz(2, 1, 0), vec![0, 0, 0, 2])));
        let both = RawHints { time: Some(1), channel: Some(2), ..RawHints::default() };
        assert_eq!(chosen(&[2, 4, 5, 6, 3], "tzyxc", &both), Ok((xyz(3, 2, 1), vec![1, 0, 0, 0, 2])));
        assert_eq!(chosen(&[4, 1, 6], "zcy", &none), Ok(([Some(2), Some(0), None], vec![0; 3])));
        assert!(chosen(&[7, 4, 5, 6], "", &time(7)).is_err() && chosen(&[2, 3, 4, 5, 6], "", &none).is_err());
        assert!(chosen(&[9], "", &none).is_err());
    }
}
