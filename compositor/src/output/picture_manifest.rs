//! What the file beside a picture says: the scene, bit for bit, and how the picture came about. It is read to draw the
//! picture again.

use std::path::{Path, PathBuf};

use brickcast_volume::StoreHash;
use brickcast_volume::json_fields::{FieldError, Fields};
use brickcast_volume::lod::{HiddenNote, Lod};
use brickcast_volume::scene::{SCENE_FIELDS, Scene, Transport};
use brickcast_volume::small_file::{FileError, read_text};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::limits::MAX_FRAMES;

/// The longest manifest that is read, bytes: that of a long animation.
const MAX_MANIFEST_BYTES: u64 = 64 << 20;
/// What such files are called in errors.
const WHAT: &str = "manifest of a picture";

/// The manifest of one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureManifest {
    pub scene: Scene,
    pub transport: Transport,
    /// Which of the store's levels it is of; manifests of earlier versions are of the volume itself.
    pub lod: Lod,
    /// Of level 0, whichever was drawn.
    pub store: StoreHash,
    /// Which step of the series at `path` the store is; nothing where it is no step.
    pub step: Option<u64>,
    /// PATH as it was given where the picture was drawn; manifests of earlier versions do not tell.
    pub path: Option<String>,
    /// RGB in 0..=1, of a picture that has no alpha.
    pub background: Option<[f32; 3]>,
    pub complete: bool,
    /// It is striped where coarser levels hide something.
    pub marks_hidden: bool,
    pub about: AboutPicture,
}

/// How a picture came about: nothing of it is needed to draw it again.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct AboutPicture {
    /// Version of the software that drew it.
    pub brickcast: String,
    /// Version of the protocol that it spoke with nodes.
    pub protocol: u32,
    pub problems: Vec<String>,
    /// Tiles of 64 pixels for which an answer is missing.
    pub missing_tiles: Vec<[u32; 2]>,
    pub epoch: u64,
    pub reissued: usize,
    pub lost: Vec<LostNote>,
    pub nodes: Vec<NodeNote>,
    pub store_short: String,
    pub notes: Vec<String>,
    /// What coarser levels hide; nothing where none is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<HiddenNote>,
    /// True where no pixel shows anything.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub empty: bool,
    pub empty_because: Option<String>,
}

/// A node that failed on the way.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LostNote {
    pub address: String,
    pub why: String,
}

/// A node that drew some of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeNote {
    pub address: String,
    pub node_id: String,
    pub version: String,
    pub backend: String,
    pub adapter: String,
}

/// The fields beside the scene's.
const FIELDS: [&str; 21] = [
    "transport",
    "lod",
    "store",
    "series_step",
    "path",
    "background",
    "complete",
    "brickcast",
    "protocol",
    "problems",
    "missing_tiles",
    "epoch",
    "reissued",
    "lost",
    "nodes",
    "store_short",
    "notes",
    "hidden",
    "marks_hidden",
    "empty",
    "empty_because",
];

#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}: no {WHAT}: not JSON: {reason}", path.display())]
    Syntax { path: PathBuf, reason: String },
    #[error("{}: no {WHAT} that can be drawn again: {error}", path.display())]
    Field { path: PathBuf, error: FieldError },
}

impl PictureManifest {
    fn to_json(&self) -> Map<String, Value> {
        let about = &self.about;
        // First what a reader looks for first.
        let head = json!({
            "brickcast": about.brickcast,
            "protocol": about.protocol,
            "store": self.store.to_string(),
            "path": self.path,
            "complete": self.complete,
            "problems": about.problems,
            "missing_tiles": about.missing_tiles,
        });
        let own = json!({
            "transport": self.transport,
            "background": self.background,
        });
        let mut fields = Map::new();
        if self.lod != Lod::Full {
            fields.insert("lod".to_owned(), self.lod.to_json());
        }
        for part in [head, Value::Object(self.scene.to_json()), own, json!(about)] {
            if let Value::Object(part) = part {
                fields.extend(part);
            }
        }
        if let Some(step) = self.step {
            fields.insert("series_step".to_owned(), step.into());
        }
        if self.marks_hidden {
            fields.insert("marks_hidden".to_owned(), true.into());
        }
        if !self.about.empty {
            fields.remove("empty_because");
        }
        fields
    }

    fn from_json(fields: &Fields<'_>) -> Result<Self, FieldError> {
        fields.only(&[&SCENE_FIELDS, &FIELDS])?;
        let scene = Scene::from_json(fields)?;
        let transport: Transport = fields.get("transport")?;
        let carries = transport.carries(scene.look.style.mode.pixel_kind());
        if !carries || (scene.quality.exact && transport != Transport::F32) {
            return Err(fields.refused("transport", "exact pictures and projections are carried as f32"));
        }
        let background: Option<[f32; 3]> = fields.get_optional("background")?;
        if background.is_some_and(|rgb| rgb.iter().any(|v| !(0.0..=1.0).contains(v))) {
            return Err(fields.refused("background", "channels must lie between 0 and 1"));
        }
        let store = fields.get::<String>("store")?.parse().map_err(|error| fields.refused("store", error))?;
        Ok(Self {
            scene,
            transport,
            lod: Lod::from_json(fields, "lod")?,
            store,
            step: fields.get_optional("series_step")?,
            path: fields.get_optional("path")?,
            background,
            complete: fields.get("complete")?,
            marks_hidden: fields.get_optional("marks_hidden")?.unwrap_or_default(),
            about: AboutPicture {
                brickcast: fields.get_optional("brickcast")?.unwrap_or_default(),
                protocol: fields.get_optional("protocol")?.unwrap_or_default(),
                problems: fields.get_optional("problems")?.unwrap_or_default(),
                missing_tiles: fields.get_optional("missing_tiles")?.unwrap_or_default(),
                epoch: fields.get_optional("epoch")?.unwrap_or_default(),
                reissued: fields.get_optional("reissued")?.unwrap_or_default(),
                lost: fields.get_optional("lost")?.unwrap_or_default(),
                nodes: fields.get_optional("nodes")?.unwrap_or_default(),
                store_short: fields.get_optional("store_short")?.unwrap_or_default(),
                notes: fields.get_optional("notes")?.unwrap_or_default(),
                hidden: fields.get_optional("hidden")?,
                empty: fields.get_optional("empty")?.unwrap_or_default(),
                empty_because: fields.get_optional("empty_because")?,
            },
        })
    }
}

impl Serialize for PictureManifest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_json().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PictureManifest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let map = Map::deserialize(deserializer)?;
        Self::from_json(&Fields::new("", &map)).map_err(serde::de::Error::custom)
    }
}

/// The manifest of an animation that was to have `asked` frames.
#[must_use]
pub fn animation_manifest(frames: &[PictureManifest], asked: u32) -> Value {
    let complete = frames.len() == asked as usize && frames.iter().all(|frame| frame.complete);
    json!({ "complete": complete, "frames_asked": asked, "frames": frames })
}

/// The pictures of a manifest: one, or the frames of an animation.
///
/// # Errors
/// A file that cannot be read, is too long or no JSON; a field that is missing, unknown, of another kind or out of
/// range, by name.
pub fn read_manifest(path: &Path) -> Result<Vec<PictureManifest>, ManifestError> {
    of_text(path, &read_text(WHAT, path, MAX_MANIFEST_BYTES)?)
}

fn of_text(path: &Path, text: &str) -> Result<Vec<PictureManifest>, ManifestError> {
    let root: Value = serde_json::from_str(text)
        .map_err(|error| ManifestError::Syntax { path: path.to_owned(), reason: error.to_string() })?;
    of_value(&root).map_err(|error| ManifestError::Field { path: path.to_owned(), error })
}

fn of_value(root: &Value) -> Result<Vec<PictureManifest>, FieldError> {
    let fields = Fields::of("", root)?;
    if fields.optional("frames").is_none() {
        return Ok(vec![PictureManifest::from_json(&fields)?]);
    }
    fields.only(&[&["frames", "complete", "frames_asked"]])?;
    let frames = fields.objects("frames")?;
    if !(1..=MAX_FRAMES as usize).contains(&frames.len()) {
        return Err(fields.refused("frames", format!("between 1 and {MAX_FRAMES} are needed")));
    }
    frames.iter().map(PictureManifest::from_json).collect()
}

#[cfg(test)]
mod tests;
