//! The series' manifest as JSON, and the door where it is checked; and what other programs read of a series.

use serde::{Deserialize, Serialize};

use super::{CommonStatistics, MAX_STEPS, SeriesManifest, StepEntry};
use crate::store::error::{ManifestError, StoreError};
use crate::store::manifest::checks::{MAX_TEXT, field, hash};
use crate::store::manifest::{HISTOGRAM_BINS, QUANTILES};

const FORMAT: &str = "brickcast-series";
const VERSION: u64 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SeriesFile {
    format: String,
    version: u64,
    writer: String,
    /// Left out where no step has a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time_unit: Option<String>,
    min: f64,
    max: f64,
    mean: f64,
    otsu: f64,
    quantiles: [f64; 9],
    histogram: Vec<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    noise: Option<f64>,
    files: Files,
    steps: Vec<StepFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Files {
    #[serde(rename = "zarr.json")]
    group: String,
    #[serde(rename = "OME/zarr.json")]
    list: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StepFile {
    hash: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
}

#[derive(Deserialize)]
struct Marker {
    format: String,
    version: u64,
}

/// True where `bytes` claim to be a series' manifest, of any version.
pub(crate) fn is_ours(bytes: &[u8]) -> bool {
    serde_json::from_slice::<Marker>(bytes).is_ok_and(|m| m.format == FORMAT)
}

fn short(text: &str) -> String {
    text.chars().take(200).collect()
}

impl SeriesManifest {
    /// The longest that is read, in bytes.
    pub const MAX_BYTES: u64 = 2 << 20;

    /// # Errors
    /// Anything that is not a valid manifest of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        Self::parsed(bytes).map_err(|error| StoreError::SeriesManifest { error })
    }

    fn parsed(bytes: &[u8]) -> Result<Self, ManifestError> {
        let got = bytes.len() as u64;
        if got > Self::MAX_BYTES {
            return Err(ManifestError::TooLong { got, max: Self::MAX_BYTES });
        }
        let json = |e: serde_json::Error| ManifestError::Json(short(&e.to_string()));
        let marker: Marker = serde_json::from_slice(bytes).map_err(json)?;
        if marker.format != FORMAT {
            return Err(ManifestError::Format(short(&marker.format)));
        }
        if marker.version != VERSION {
            return Err(ManifestError::Version { got: marker.version, known: VERSION });
        }
        let file: SeriesFile = serde_json::from_slice(bytes).map_err(json)?;
        if !(1..=MAX_STEPS).contains(&file.steps.len()) {
            return Err(field("steps", format!("{}: must be from 1 to {MAX_STEPS}", file.steps.len())));
        }
        let entry = |step: &StepFile| Ok(StepEntry { hash: hash("steps", &step.hash)?, time: step.time });
        let steps: Vec<StepEntry> = file.steps.iter().map(entry).collect::<Result<_, ManifestError>>()?;
        check_times(&steps.iter().map(|step| step.time).collect::<Vec<_>>()).map_err(|why| field("steps", why))?;
        let time_unit = match file.time_unit {
            Some(unit) if unit.len() > MAX_TEXT => {
                return Err(field("time_unit", format!("{} bytes, at most {MAX_TEXT} are allowed", unit.len())));
            }
            unit => unit,
        };
        let ascend = |values: &[f64]| values.iter().all(|v| v.is_finite()) && values.is_sorted();
        let within = |value: f64| (file.min..=file.max).contains(&value);
        if !ascend(&[file.min, file.max]) || !within(file.mean) || !within(file.otsu) {
            return Err(field("min, max, mean, otsu", "must be finite, and the last two between the first"));
        }
        if !ascend(&file.quantiles) {
            return Err(field("quantiles", format!("must be finite and not descend at the shares {QUANTILES:?}")));
        }
        let counted = file.histogram.iter().try_fold(0_u64, |sum, n| sum.checked_add(*n));
        if file.histogram.len() != HISTOGRAM_BINS || counted.is_none_or(|n| n == 0) {
            return Err(field("histogram", format!("must count some voxels in {HISTOGRAM_BINS} bins")));
        }
        if file.noise.is_some_and(|n| !n.is_finite() || n <= 0.0) {
            return Err(field("noise", "must be finite and above 0, or left out"));
        }
        let (min, max, mean, otsu) = (file.min, file.max, file.mean, file.otsu);
        let (quantiles, histogram, noise) = (file.quantiles, file.histogram, file.noise);
        Ok(Self {
            steps,
            time_unit,
            statistics: CommonStatistics { min, max, mean, otsu, quantiles, histogram, noise },
            files: [hash("files", &file.files.group)?, hash("files", &file.files.list)?],
        })
    }

    /// The same values always give the same bytes.
    ///
    /// # Errors
    /// Never for what was made by [`SeriesManifest::from_bytes`] or by preparing a series.
    pub fn to_bytes(&self) -> Result<Vec<u8>, StoreError> {
        let CommonStatistics { min, max, mean, otsu, quantiles, ref histogram, noise } = self.statistics;
        let [group, list] = self.files.map(|hash| hash.to_string());
        let step = |step: &StepEntry| StepFile { hash: step.hash.to_string(), time: step.time };
        let file = SeriesFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            writer: concat!("brickcast ", env!("CARGO_PKG_VERSION")).to_owned(),
            time_unit: self.time_unit.clone(),
            min,
            max,
            mean,
            otsu,
            quantiles,
            histogram: histogram.clone(),
            noise,
            files: Files { group, list },
            steps: self.steps.iter().map(step).collect(),
        };
        let json = |e: serde_json::Error| StoreError::SeriesManifest { error: ManifestError::Json(e.to_string()) };
        let mut bytes = serde_json::to_vec_pretty(&file).map_err(json)?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}

/// Either no step has a time, or all have, each later than the one before; else why not.
pub(crate) fn check_times(times: &[Option<f64>]) -> Result<(), String> {
    if times.iter().all(Option::is_none) {
        return Ok(());
    }
    let mut before: Option<f64> = None;
    for (step, time) in times.iter().enumerate() {
        match (*time, before) {
            (None, _) => return Err(format!("step {step} has no time, and others have")),
            (Some(time), _) if !time.is_finite() => return Err(format!("step {step} has the time {time}")),
            (Some(time), Some(before)) if time <= before => {
                return Err(format!("step {step} is at {time}, not after the step before, at {before}"));
            }
            (Some(time), _) => before = Some(time),
        }
    }
    Ok(())
}

/// `zarr.json` of the series: OME's collection of images.
pub(crate) const GROUP: &[u8] = br#"{
  "zarr_format": 3,
  "node_type": "group",
  "attributes": {
    "ome": {
      "version": "0.5",
      "bioformats2raw.layout": 3
    }
  }
}
"#;

/// `OME/zarr.json`: which images there are, in order.
pub(crate) fn list(steps: usize) -> Vec<u8> {
    let names: Vec<String> = (0..steps).map(|step| format!("\"{step}\"")).collect();
    format!(
        r#"{{
  "zarr_format": 3,
  "node_type": "group",
  "attributes": {{
    "ome": {{
      "version": "0.5",
      "series": [{}]
    }}
  }}
}}
"#,
        names.join(", ")
    )
    .into_bytes()
}
