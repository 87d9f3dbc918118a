//! The manifest as JSON: keys in a fixed order, and the door where they are checked.

use glam::DMat3;
use serde::{Deserialize, Serialize};

use super::checks::{MAX_TEXT, field, hash};
use super::halo::{self, HaloFile};
use super::levels::{self, LevelFile};
use super::notes;
use super::regions::RegionsFile;
use super::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
use crate::brick::BrickGrid;
use crate::format::VoxelType;
use crate::space::Geometry;
use crate::store::error::{ManifestError, StoreError};
use crate::store::hash::ContentHash;
use crate::store::no_data::{NoData, with_room_below};
use crate::store::shard::grid::ShardGrid;
use crate::store::value_map::check_range;
use crate::store::voxel::{SOURCE_TYPES, StoredType};

const FORMAT: &str = "brickcast-store";
/// Of the format that is written.
pub const VERSION: u64 = 10;
/// Read as well: 4 lacks keys that may be left out, before 6 shards have no checksums of their chunks at their end,
/// before 7 there are no cells, before 8 nothing says which values leap voxels have, before 9 there are no levels, and
/// before 10 nothing says what they hide.
const OLDEST: u64 = 4;
const FIRST_WITH_CELLS: u64 = 7;
const FIRST_WITH_LEVELS: u64 = 9;
const FIRST_WITH_MEANS: u64 = 10;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ManifestFile {
    format: String,
    version: u64,
    /// Left out in the manifest of a store: which of its levels this is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    level: Option<u8>,
    writer: String,
    source: SourceFile,
    dims: [u32; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    /// The index axes in the world, x first; left out where they are x, y, z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    directions: Option<[[f64; 3]; 3]>,
    space_unit: Option<String>,
    stored_type: String,
    scale: f64,
    offset: f64,
    lossless: bool,
    brick_size: u32,
    range: [f64; 2],
    min: f64,
    max: f64,
    mean: f64,
    otsu: f64,
    quantiles: Vec<[f64; 2]>,
    voxels: u64,
    nan_voxels: u64,
    negative_infinity_voxels: u64,
    positive_infinity_voxels: u64,
    /// Left out where every voxel holds data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    no_data: Option<NoData>,
    histogram: Vec<u64>,
    /// Left out where there is none, and in older stores.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    noise: Option<f64>,
    files: Files,
    /// Left out where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    halo: Option<HaloFile>,
    /// Left out where there are none: the bytes are those of a store that knows no regions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    regions: Option<RegionsFile>,
    /// Left out where there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    levels: Vec<LevelFile>,
    /// Left out where there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceFile {
    name: Option<String>,
    bytes: Option<u64>,
    format: String,
    voxel_type: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Files {
    #[serde(rename = "zarr.json")]
    group: String,
    #[serde(rename = "0/zarr.json")]
    array: String,
    #[serde(rename = "bricks.bin")]
    ranges: String,
    #[serde(rename = "shards.bin")]
    shards: String,
    /// Left out before version 7.
    #[serde(rename = "cells.bin", default, skip_serializing_if = "Option::is_none")]
    cells: Option<String>,
    /// Left out before version 10.
    #[serde(rename = "means.bin", default, skip_serializing_if = "Option::is_none")]
    means: Option<String>,
}

/// Says whether bytes are a manifest of any version, however broken otherwise.
#[derive(Deserialize)]
struct Marker {
    format: String,
    version: u64,
}

/// True where `bytes` claim to be a manifest of ours, of any version.
pub(crate) fn is_ours(bytes: &[u8]) -> bool {
    serde_json::from_slice::<Marker>(bytes).is_ok_and(|m| m.format == FORMAT)
}

fn parse(bytes: &[u8]) -> Result<ManifestFile, ManifestError> {
    let json = |e: serde_json::Error| ManifestError::Json(short(&e.to_string()));
    let marker: Marker = serde_json::from_slice(bytes).map_err(json)?;
    if marker.format != FORMAT {
        return Err(ManifestError::Format(short(&marker.format)));
    }
    if !(OLDEST..=VERSION).contains(&marker.version) {
        return Err(ManifestError::Version { got: marker.version, known: VERSION });
    }
    serde_json::from_slice(bytes).map_err(json)
}

/// Messages quote what came over the wire: not all of it.
fn short(text: &str) -> String {
    text.chars().take(200).collect()
}

fn checked_text(name: &'static str, text: String) -> Result<String, ManifestError> {
    match text.len() {
        n if n > MAX_TEXT => Err(field(name, format!("{n} bytes, at most {MAX_TEXT} are allowed"))),
        _ => Ok(text),
    }
}

/// Finite and not descending.
fn check_ascending(name: &'static str, values: &[f64]) -> Result<(), ManifestError> {
    let good = values.iter().all(|v| v.is_finite()) && values.is_sorted();
    if good { Ok(()) } else { Err(field(name, "values must be finite and must not descend")) }
}

/// Stores have cells from version 7 on, and not before.
fn cells_hash(version: u64, cells: Option<&str>) -> Result<Option<ContentHash>, ManifestError> {
    match (version >= FIRST_WITH_CELLS, cells) {
        (true, Some(text)) => hash("files", text).map(Some),
        (false, None) => Ok(None),
        (true, None) => Err(field("files", format!("cells.bin is missing, which version {version} has"))),
        (false, Some(_)) => Err(field("files", format!("cells.bin, which version {version} has not"))),
    }
}

/// Stores have means from version 10 on, and not before.
fn means_hash(version: u64, means: Option<&str>) -> Result<Option<ContentHash>, ManifestError> {
    match (version >= FIRST_WITH_MEANS, means) {
        (true, Some(text)) => hash("files", text).map(Some),
        (false, None) => Ok(None),
        (true, None) => Err(field("files", format!("means.bin is missing, which version {version} has"))),
        (false, Some(_)) => Err(field("files", format!("means.bin, which version {version} has not"))),
    }
}

fn checked_noise(noise: Option<f64>) -> Result<Option<f64>, ManifestError> {
    let good = noise.is_none_or(|n| n.is_finite() && n > 0.0);
    if good { Ok(noise) } else { Err(field("noise", "must be finite and above 0, or left out")) }
}

impl Manifest {
    /// Of a store; [`Manifest::level_from_bytes`] takes those of its coarser levels.
    ///
    /// # Errors
    /// Anything that is not a valid manifest of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        match Self::any_from_bytes(bytes)? {
            m if m.level == 0 => Ok(m),
            m => Err(field("level", format!("this is level {} of a store; open the store itself", m.level)).into()),
        }
    }

    /// Of a store or of a level: for whoever knows the level by its hash.
    ///
    /// # Errors
    /// As [`Manifest::from_bytes`].
    pub fn any_from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let got = bytes.len() as u64;
        if got > Self::MAX_BYTES {
            return Err(ManifestError::TooLong { got, max: Self::MAX_BYTES }.into());
        }
        let manifest = Self::try_from(parse(bytes)?)?;
        // The store must be readable, not only the manifest.
        ShardGrid::new(manifest.geometry.dims())?;
        Ok(manifest)
    }

    /// The same values always give the same bytes.
    ///
    /// # Errors
    /// Never for a manifest made by [`Manifest::from_bytes`] or by preparing a store.
    pub fn to_bytes(&self) -> Result<Vec<u8>, StoreError> {
        let mut bytes = serde_json::to_vec_pretty(&ManifestFile::from(self))
            .map_err(|e| StoreError::from(ManifestError::Json(e.to_string())))?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}

/// The very keys of the manifest file.
impl Serialize for Manifest {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        ManifestFile::from(self).serialize(serializer)
    }
}

impl TryFrom<ManifestFile> for Manifest {
    type Error = StoreError;

    fn try_from(file: ManifestFile) -> Result<Self, StoreError> {
        let geometry = Geometry::new(file.dims, file.spacing, file.origin)
            .map_err(|e| field("dims, spacing, origin", e.to_string()))?;
        let geometry = match &file.directions {
            Some(axes) => geometry
                .with_directions(DMat3::from_cols_array_2d(axes))
                .map_err(|e| field("directions", e.to_string()))?,
            None => geometry,
        };
        let grid = BrickGrid::new(geometry.dims(), file.brick_size)?;
        let stored_type = StoredType::from_name(&file.stored_type)
            .ok_or_else(|| field("stored_type", format!("`{}` is no type of a store", short(&file.stored_type))))?;
        let source = file.source.parse()?;
        if StoredType::of(source.voxel_type) != stored_type {
            return Err(field("stored_type", "does not follow from the source's type").into());
        }
        if !(file.scale.is_normal() && file.scale > 0.0 && file.offset.is_finite()) {
            return Err(field("scale, offset", "must be finite, scale above 0").into());
        }
        check_range(file.range[0], file.range[1])?;
        let (level, levels) =
            levels::parse(file.level, file.levels, (file.version, FIRST_WITH_LEVELS), (&geometry, file.brick_size))?;
        let no_data = file.no_data.map(|n| n.check(stored_type, geometry.voxel_count(), level)).transpose()?;
        let data_range = file.range.into();
        let range = if no_data.is_some() { with_room_below(data_range) } else { data_range };
        check_range(range.0, range.1)?;
        check_ascending("min, max", &[file.min, file.max])?;
        check_ascending("mean, otsu", &[file.mean.min(file.otsu), file.mean.max(file.otsu)])?;
        let shares = file.quantiles.iter().map(|q| q[0]);
        let quantiles: [f64; 9] = match file.quantiles.iter().map(|q| q[1]).collect::<Vec<_>>().try_into() {
            Ok(values) if shares.eq(QUANTILES) => values,
            _ => return Err(field("quantiles", format!("must be at the shares {QUANTILES:?}")).into()),
        };
        check_ascending("quantiles", &quantiles)?;
        let voxels = geometry.voxel_count();
        let counted = file.histogram.iter().try_fold(0u64, |sum, &n| sum.checked_add(n));
        let counted = counted.map(|n| n.saturating_add(no_data.as_ref().map_or(0, |n| n.voxels)));
        if file.voxels != voxels || file.histogram.len() != HISTOGRAM_BINS || counted != Some(voxels) {
            let why = format!("dims promise {voxels} voxels in {HISTOGRAM_BINS} bins or without data");
            return Err(field("voxels, histogram", why).into());
        }
        let not_finite = NotFinite {
            nan: file.nan_voxels,
            negative_infinity: file.negative_infinity_voxels,
            positive_infinity: file.positive_infinity_voxels,
        };
        if not_finite.total() > voxels {
            return Err(field("nan_voxels", "more voxels than there are").into());
        }
        Ok(Self {
            version: file.version,
            level,
            geometry,
            grid,
            range,
            otsu: file.otsu,
            quantile_999: quantiles[8],
            writer: checked_text("writer", file.writer)?,
            source,
            space_unit: file.space_unit.map(|u| checked_text("space_unit", u)).transpose()?,
            stored_type,
            scale: file.scale,
            offset: file.offset,
            lossless: file.lossless,
            min: file.min,
            max: file.max,
            mean: file.mean,
            not_finite,
            no_data,
            data_range,
            quantiles,
            histogram: file.histogram,
            noise: checked_noise(file.noise)?,
            files: FileHashes {
                group: hash("files", &file.files.group)?,
                array: hash("files", &file.files.array)?,
                ranges: hash("files", &file.files.ranges)?,
                shards: hash("files", &file.files.shards)?,
                cells: cells_hash(file.version, file.files.cells.as_deref())?,
                means: means_hash(file.version, file.files.means.as_deref())?,
            },
            halo: halo::parse(file.halo, file.brick_size, file.regions.is_some())?,
            regions: file.regions.map(|regions| regions.parse(&geometry)).transpose()?,
            levels,
            notes: notes::checked(file.notes)?,
        })
    }
}

impl SourceFile {
    fn parse(self) -> Result<Source, ManifestError> {
        let voxel_type = SOURCE_TYPES.into_iter().find(|(_, name)| *name == self.voxel_type);
        let (voxel_type, _) = voxel_type
            .ok_or_else(|| field("source.voxel_type", format!("`{}` is not known", short(&self.voxel_type))))?;
        Ok(Source {
            name: self.name.map(|n| checked_text("source.name", n)).transpose()?,
            bytes: self.bytes,
            format: checked_text("source.format", self.format)?,
            voxel_type,
        })
    }
}

fn type_name(voxel_type: VoxelType) -> String {
    SOURCE_TYPES.into_iter().find(|(t, _)| *t == voxel_type).map_or(String::new(), |(_, name)| name.to_owned())
}

impl From<&Manifest> for ManifestFile {
    fn from(m: &Manifest) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: m.version,
            level: (m.level > 0).then_some(m.level),
            writer: m.writer.clone(),
            source: SourceFile {
                name: m.source.name.clone(),
                bytes: m.source.bytes,
                format: m.source.format.clone(),
                voxel_type: type_name(m.source.voxel_type),
            },
            dims: m.geometry.dims().to_array(),
            spacing: m.geometry.spacing().to_array(),
            origin: m.geometry.origin().to_array(),
            directions: (!m.geometry.is_straight()).then(|| m.geometry.directions().to_cols_array_2d()),
            space_unit: m.space_unit.clone(),
            stored_type: m.stored_type.name().to_owned(),
            scale: m.scale,
            offset: m.offset,
            lossless: m.lossless,
            brick_size: m.grid.brick_size(),
            range: m.data_range.into(),
            min: m.min,
            max: m.max,
            mean: m.mean,
            otsu: m.otsu,
            quantiles: QUANTILES.into_iter().zip(m.quantiles).map(|(q, v)| [q, v]).collect(),
            voxels: m.geometry.voxel_count(),
            nan_voxels: m.not_finite.nan,
            negative_infinity_voxels: m.not_finite.negative_infinity,
            positive_infinity_voxels: m.not_finite.positive_infinity,
            no_data: m.no_data.clone(),
            histogram: m.histogram.clone(),
            noise: m.noise,
            files: Files {
                group: m.files.group.to_string(),
                array: m.files.array.to_string(),
                ranges: m.files.ranges.to_string(),
                shards: m.files.shards.to_string(),
                cells: m.files.cells.map(|cells| cells.to_string()),
                means: m.files.means.map(|means| means.to_string()),
            },
            halo: m.halo.as_ref().map(HaloFile::from),
            regions: m.regions.as_ref().map(RegionsFile::from),
            levels: m.levels.iter().map(LevelFile::from).collect(),
            notes: m.notes.clone(),
        }
    }
}
