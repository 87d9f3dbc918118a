//! The file that makes a store's folder a view: where the finest voxels lie, and how they become stored numbers.

use std::io;

use serde::{Deserialize, Serialize};

use super::form::StoredForm;
use crate::format::VoxelType;
use crate::store::error::StoreError;
use crate::store::objects::Objects;
use crate::store::prepare::fill::Fill;
use crate::store::prepare::quantise::Scan;
use crate::store::profile::VIEW_FILE;

const FORMAT: &str = "brickcast-view";
const VERSION: u32 = 1;
/// No such file is longer, bytes.
const MOST: u64 = 64 << 10;

/// Where the voxels of a view lie.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewInput {
    /// An address, or a path; one that is not absolute begins at the view's folder.
    pub place: String,
    /// Which channel of several.
    pub channel: Option<u64>,
    /// Which time of several.
    pub time: Option<u64>,
}

/// What the file says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewFile {
    format: String,
    version: u32,
    pub input: ViewInput,
    /// Of the input.
    voxel_type: String,
    /// Declared fill values, the bits of an f64 each.
    fill: Vec<u64>,
    /// Values that the stored numbers are spread over, bits again; nothing where all are.
    range: Option<[u64; 2]>,
    /// What was found of voxels of 32 and 64 bits.
    scan: Option<[u64; 8]>,
}

/// The bytes of the file, of voxels that are stored in this way.
pub(in crate::store) fn written(
    input: &ViewInput,
    voxel_type: VoxelType,
    fill: &Fill,
    range: Option<(f64, f64)>,
    scan: Option<&Scan>,
) -> Result<Vec<u8>, StoreError> {
    let file = ViewFile {
        format: FORMAT.to_owned(),
        version: VERSION,
        input: input.clone(),
        voxel_type: voxel_type.name().to_owned(),
        fill: fill.declared().iter().map(|value| value.to_bits()).collect(),
        range: range.map(|(lo, hi)| [lo.to_bits(), hi.to_bits()]),
        scan: scan.map(Scan::numbers),
    };
    let bytes = serde_json::to_vec_pretty(&file);
    bytes.map_err(|error| StoreError::io("write", VIEW_FILE.as_ref())(error.into()))
}

/// A server may refuse to say that something is not there.
fn is_none(objects: &dyn Objects, error: &StoreError) -> bool {
    let is_refused = |kind| kind == io::ErrorKind::PermissionDenied && objects.is_far();
    error.is_missing() || matches!(error, StoreError::Io { source, .. } if is_refused(source.kind()))
}

impl ViewFile {
    /// Of the store at `objects`; nothing where that is no view.
    ///
    /// # Errors
    /// A file that cannot be read, or says nothing that can be.
    pub fn read(objects: &dyn Objects) -> Result<Option<Self>, StoreError> {
        let bytes = match objects.read_at_most(VIEW_FILE, MOST) {
            Err(error) if is_none(objects, &error) => return Ok(None),
            read => read?,
        };
        let broken = |why: String| StoreError::ViewFile { path: objects.path_of(VIEW_FILE), why };
        let file: Self = serde_json::from_slice(&bytes).map_err(|error| broken(error.to_string()))?;
        match (file.format.as_str(), file.version) {
            (FORMAT, VERSION) => Ok(Some(file)),
            (FORMAT, version) => Err(broken(format!("it is of version {version}, this program reads {VERSION}"))),
            (format, _) => Err(broken(format!("its format is {format:?}, not {FORMAT:?}"))),
        }
    }

    /// How voxels of `voxel_type`, which the array has, are stored.
    pub(super) fn form(&self, voxel_type: VoxelType) -> Result<StoredForm, StoreError> {
        if voxel_type.name() != self.voxel_type {
            let (got, want) = (voxel_type.name(), self.voxel_type.clone());
            return Err(StoreError::ViewType { place: self.input.place.clone(), got, want });
        }
        let declared: Vec<f64> = self.fill.iter().map(|bits| f64::from_bits(*bits)).collect();
        let range = self.range.map(|[lo, hi]| (f64::from_bits(lo), f64::from_bits(hi)));
        StoredForm::new(voxel_type, &declared, range, self.scan.map(Scan::of_numbers))
    }
}
