//! Which array the finest voxels of an image are, and what OME-Zarr says of its axes and its place in space.

use brickcast_volume::json_fields::{FieldError, Fields};
use brickcast_volume::shown::shown;
use brickcast_volume::store::Objects;
use serde_json::Value;

use crate::error::OmeZarrError;
use crate::json::{Json, below};
use crate::node::{Node, Version};

/// More images are not looked for below a group.
const MOST_IMAGES: usize = 1000;

/// An axis by its metadata.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Axis {
    /// In lower case.
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
}

/// A scale and a translation; a number for each axis of the array.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Transform {
    pub(crate) scale: Option<Vec<f64>>,
    pub(crate) translation: Option<Vec<f64>>,
}

/// An image's finest array, and what is said of it.
#[derive(Debug)]
pub(crate) struct Image {
    pub(crate) node: Node,
    pub(crate) array: Json,
    /// Nothing where nothing says.
    pub(crate) axes: Option<Vec<Axis>>,
    /// Of the finest array, then of all.
    pub(crate) transforms: [Transform; 2],
    /// Names of channels, where some are said.
    pub(crate) channels: Vec<String>,
    pub(crate) notes: Vec<String>,
}

/// The image at the root of `objects`, or the only one below it.
pub(crate) fn find(objects: &dyn Objects) -> Result<Image, OmeZarrError> {
    let root = Node::read(objects, "")?.ok_or(OmeZarrError::Nothing)?;
    if root.array.is_some() {
        return bare(root);
    }
    let ome = root.ome();
    if ome.map.contains_key("multiscales") {
        return multiscale(objects, &root, Vec::new());
    }
    if let Some(plate) = ome.map.get("plate") {
        let well = plate.get("wells").and_then(|wells| wells.get(0)?.get("path")?.as_str()).unwrap_or("A/1");
        return Err(OmeZarrError::Plate { example: format!("{}/0", shown(well)) });
    }
    let names = images(objects, &ome)?;
    match names.as_slice() {
        [] => Err(OmeZarrError::NoImage { group: root.attributes.file.clone() }),
        [name] => {
            let node = Node::read(objects, name)?.ok_or(OmeZarrError::Nothing)?;
            let note = format!("its only image, `{}`, was taken", shown(name));
            multiscale(objects, &node, vec![note])
        }
        _ => Err(OmeZarrError::SeveralImages(names)),
    }
}

/// Names of the images below a group: those of a well, or `0`, `1`, ... as of bioformats2raw.
fn images(objects: &dyn Objects, ome: &Json) -> Result<Vec<String>, OmeZarrError> {
    if let Some(well) = ome.map.get("well") {
        let images = well.get("images").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        let paths = images.iter().filter_map(|image| image.get("path")?.as_str());
        return paths.map(|path| checked(ome, path)).collect();
    }
    let mut names = Vec::new();
    for name in (0..MOST_IMAGES).map(|n| n.to_string()) {
        match Node::read(objects, &name)? {
            Some(node) if node.ome().map.contains_key("multiscales") => names.push(name),
            _ => break,
        }
    }
    Ok(names)
}

/// An array that was named itself.
fn bare(mut node: Node) -> Result<Image, OmeZarrError> {
    let Some(array) = node.array.take() else { return Err(OmeZarrError::Nothing) };
    let names = array.fields().get_optional::<Vec<Option<String>>>("dimension_names");
    let names = names.map_err(|error| array.wrong(error))?;
    let named = |names: Vec<Option<String>>| {
        names.into_iter().map(|name| Some(Axis { name: name?.to_lowercase(), unit: None })).collect()
    };
    let notes = vec!["one array, without what OME-Zarr says of its image: its spacing is taken as 1".to_owned()];
    Ok(Image { axes: names.and_then(named), transforms: Default::default(), channels: Vec::new(), notes, array, node })
}

fn multiscale(objects: &dyn Objects, node: &Node, mut notes: Vec<String>) -> Result<Image, OmeZarrError> {
    let ome = node.ome();
    let fields = ome.fields();
    let field = |error: FieldError| ome.wrong(error);
    let multiscales = fields.objects("multiscales").map_err(field)?;
    let first = multiscales.first().ok_or_else(|| ome.problem("its list of `multiscales` is empty"))?;
    if multiscales.len() > 1 {
        notes.push(format!("the first of {} multiscales was taken", multiscales.len()));
    }
    let datasets = first.objects("datasets").map_err(field)?;
    let finest = datasets.first().ok_or_else(|| ome.problem("its list of `datasets` is empty"))?;
    let path = below(&node.path, &checked(&ome, finest.get("path").map_err(field)?)?);
    let mut level = Node::read(objects, &path)?.ok_or_else(|| {
        ome.problem(format!("it names the array `{}`, where none lies; copy it there, too", shown(&path)))
    })?;
    let array = level.array.take().ok_or_else(|| ome.problem(format!("`{}` is no array", shown(&path))))?;
    let axes = match first.optional("axes") {
        None => None,
        Some(_) => Some(axes(&ome, first)?),
    };
    let transforms = [transform(&ome, finest)?, transform(&ome, first)?];
    let channels = ome.map.get("omero").and_then(|omero| omero.get("channels")?.as_array());
    let label = |channel: &Value| channel.get("label").and_then(Value::as_str).map(|label| shown(label).into_owned());
    let channels = channels.map(|list| list.iter().filter_map(label).collect()).unwrap_or_default();
    Ok(Image { node: level, array, axes, transforms, channels, notes })
}

/// Objects (0.4 and later) or names alone (0.3).
fn axes(json: &Json, multiscale: &Fields<'_>) -> Result<Vec<Axis>, OmeZarrError> {
    let list = multiscale.get::<Vec<Value>>("axes").map_err(|error| json.wrong(error))?;
    let axis = |axis: &Value| {
        let text = |key: &str| axis.get(key).and_then(Value::as_str);
        let name = axis.as_str().or_else(|| text("name"))?;
        // What an axis is, its type says better than its name.
        let name = match text("type") {
            Some("channel") => "c",
            Some("time") => "t",
            _ => name,
        };
        Some(Axis { name: name.to_lowercase(), unit: text("unit").map(str::to_owned) })
    };
    let axes = list.iter().map(axis).collect::<Option<Vec<_>>>();
    axes.ok_or_else(|| json.wrong(multiscale.refused("axes", "each axis needs a name")))
}

fn transform(json: &Json, of: &Fields<'_>) -> Result<Transform, OmeZarrError> {
    let mut found = Transform::default();
    if of.optional("coordinateTransformations").is_none() {
        return Ok(found);
    }
    for transform in of.objects("coordinateTransformations").map_err(|error| json.wrong(error))? {
        let kind: &str = transform.get("type").map_err(|error| json.wrong(error))?;
        let place = match kind {
            "identity" => continue,
            "scale" => &mut found.scale,
            "translation" => &mut found.translation,
            name => {
                let (file, what) = (json.file.clone(), "coordinate transformation");
                let name = shown(name).chars().take(60).collect();
                return Err(OmeZarrError::Unsupported { file, what, name, read: "scale, translation, identity" });
            }
        };
        *place = Some(transform.get(kind).map_err(|error| json.wrong(error))?);
    }
    Ok(found)
}

/// A path below the group that names it, and nowhere else.
fn checked(json: &Json, path: &str) -> Result<String, OmeZarrError> {
    let path = path.trim_end_matches('/');
    let is_below = path.split('/').all(|part| !matches!(part, "" | "." | "..") && !part.contains(['\\', '\0']));
    match is_below {
        true => Ok(path.to_owned()),
        false => Err(json.problem(format!("the path `{}` leads out of its group; write a name below it", shown(path)))),
    }
}

impl Image {
    /// For people.
    pub(crate) fn format(&self) -> &'static str {
        match self.node.version {
            Version::V2 => "OME-Zarr (Zarr v2)",
            Version::V3 => "OME-Zarr (Zarr v3)",
        }
    }
}
