//! Camera files of other tools: vtk.js and ParaView write the keys of [`Camera::from_json`] among others, in several
//! spellings; the manifest of a picture holds them under `camera`.

use serde_json::{Map, Value};

use crate::camera::{Camera, CameraError};

/// Our keys, as they are compared (see [`folded`]), and as they are written.
const OURS: [(&str, &str); 6] = [
    ("position", "position"),
    ("focalpoint", "focalPoint"),
    ("viewup", "viewUp"),
    ("viewangle", "viewAngle"),
    ("parallelprojection", "parallelProjection"),
    ("parallelscale", "parallelScale"),
];

/// Keys that change no picture here: near and far planes, what follows from the other keys, states of the viewer
/// itself.
const HARMLESS: [&str; 31] = [
    "clippingrange",
    "directionofprojection",
    "viewplanenormal",
    "distance",
    "thickness",
    "physicalscale",
    "physicaltranslation",
    "physicalviewup",
    "physicalviewnorth",
    "vtkclass",
    "managedinstanceid",
    "mtime",
    "cameralighttransform",
    "lightfollowcamera",
    "screenbottomleft",
    "screenbottomright",
    "screentopright",
    "freezefocalpoint",
    "scissorrect",
    "focaldisk",
    "focaldistance",
    "eyeangle",
    "eyeseparation",
    "eyeposition",
    "lefteye",
    "centerofrotation",
    "rotationfactor",
    "name",
    "id",
    "type",
    "classname",
];

/// Keys that would change the picture unless they hold what changes nothing; and what to do.
const TELLING: [(&str, &str); 17] = [
    (
        "usehorizontalviewangle",
        "give viewAngle as the vertical angle, 2 atan(tan(angle / 2) height / width), and leave it out",
    ),
    ("usehorizontalparallelscale", "give parallelScale as half the picture's height, and leave it out"),
    ("windowcenter", "the picture's middle is where the camera looks; move position and focalPoint instead"),
    ("useoffaxisprojection", "off-axis projections are not drawn"),
    ("useexplicitprojectiontransformmatrix", "give viewAngle or parallelScale in place of a matrix"),
    ("explicitprojectiontransformmatrix", "give viewAngle or parallelScale in place of a matrix"),
    ("useexplicitaspectratio", "pixels are square here"),
    ("projectionmatrix", "give viewAngle or parallelScale in place of a matrix"),
    ("viewmatrix", "give position, focalPoint and viewUp in place of a matrix"),
    ("eyetransformmatrix", "give position, focalPoint and viewUp as they are after it"),
    ("modeltransformmatrix", "give position, focalPoint and viewUp as they are after it"),
    ("usertransform", "give position, focalPoint and viewUp as they are after it"),
    ("userviewtransform", "give position, focalPoint and viewUp as they are after it"),
    ("viewshear", "sheared views are not drawn"),
    ("usescissor", "render the whole picture and cut it"),
    ("stereo", "render a picture for each eye"),
    ("shiftscalethreshold", "leave it out"),
];

/// Keys of other conventions for what ours say.
const FOREIGN: [(&str, &str); 12] = [
    ("up", "call it viewUp"),
    ("target", "call it focalPoint"),
    ("lookat", "call it focalPoint"),
    ("eye", "call it position"),
    ("fov", "call it viewAngle, the vertical angle in degrees"),
    ("zoom", "move position towards focalPoint, or narrow viewAngle"),
    ("roll", "turn viewUp"),
    ("rotation", "give position, focalPoint and viewUp"),
    ("quaternion", "give position, focalPoint and viewUp"),
    ("orientation", "give position, focalPoint and viewUp"),
    ("matrix", "give position, focalPoint and viewUp"),
    ("orthographic", "call it parallelProjection"),
];

/// Names that a note shows at most.
const SHOWN: usize = 8;

/// The camera of a file, and what of the file is left aside.
///
/// # Errors
/// As [`Camera::from_json`]; a key that would change the picture and is not drawn here; a key that is there twice.
pub fn read(file: &str, text: &str) -> Result<(Camera, Vec<String>), CameraError> {
    // Malformed text, and our own files, are told of by line and column.
    let Ok(root) = serde_json::from_str::<Value>(text.trim_start_matches('\u{feff}')) else {
        return Ok((Camera::from_json(file, text)?, Vec::new()));
    };
    let plain = |object: &Map<String, Value>| object.keys().all(|key| OURS.iter().any(|(_, ours)| ours == key));
    if root.as_object().is_none_or(plain) && !root.is_array() {
        return Ok((Camera::from_json(file, text.trim_start_matches('\u{feff}'))?, Vec::new()));
    }
    let mut notes = Vec::new();
    let refused = |problem: String| CameraError::State { file: file.to_owned(), problem };
    let state = camera_in(&root, &mut notes).map_err(refused)?;
    let ours = ours_of(state, &mut notes).map_err(refused)?;
    Ok((Camera::from_value(file, Value::Object(ours))?, notes))
}

/// Where in a file the camera stands: a manifest has it under `camera`, that of an animation in each of its `frames`.
fn camera_in<'a>(root: &'a Value, notes: &mut Vec<String>) -> Result<&'a Map<String, Value>, String> {
    let mut at = root;
    for _ in 0..4 {
        let list = at.as_array().or_else(|| at.get("frames").and_then(Value::as_array));
        if let Some(list) = list {
            at = list.first().ok_or("the list holds no camera")?;
            if list.len() > 1 {
                notes.push(format!("of its {} cameras, the first is taken", list.len()));
            }
        } else if let Some(inner) = at.get("camera").filter(|inner| inner.is_object()) {
            at = inner;
        } else {
            return at.as_object().ok_or_else(|| "an object with position and focalPoint is needed".to_owned());
        }
    }
    Err("an object with position and focalPoint is needed".to_owned())
}

/// Without case, underscores, blanks, and the `Camera` that ParaView writes in front.
fn folded(key: &str) -> String {
    let letters: String = key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    match letters.strip_prefix("camera") {
        Some(rest) if OURS.iter().any(|(name, _)| *name == rest) || TELLING.iter().any(|(name, _)| *name == rest) => {
            rest.to_owned()
        }
        _ => letters,
    }
}

/// The state's keys that we know, in our spelling.
fn ours_of(state: &Map<String, Value>, notes: &mut Vec<String>) -> Result<Map<String, Value>, String> {
    let mut ours = Map::new();
    let mut aside = Vec::new();
    let parallel = state.iter().any(|(key, value)| folded(key) == "parallelprojection" && is_yes(value));
    for (key, value) in state {
        let name = folded(key);
        if let Some((_, our)) = OURS.iter().find(|(folded, _)| *folded == name) {
            let value = if name == "parallelprojection" { flag(key, value)? } else { value.clone() };
            if value.is_null() {
                continue;
            }
            if ours.get(*our).is_some_and(|other| *other != value) {
                return Err(format!("{our} is there twice, and not the same: leave one out"));
            }
            ours.insert((*our).to_owned(), value);
        } else if let Some((_, remedy)) = TELLING.iter().find(|(folded, _)| *folded == name) {
            let counts = match name.as_str() {
                "usehorizontalviewangle" => !parallel,
                "usehorizontalparallelscale" => parallel,
                _ => true,
            };
            if counts && !changes_nothing(&name, value) {
                return Err(format!("{} = {} would change the picture: {remedy}", quoted(key), brief(value)));
            }
        } else if let Some((_, remedy)) = FOREIGN.iter().find(|(folded, _)| *folded == name) {
            return Err(format!("{} would change the picture: {remedy}", quoted(key)));
        } else if !HARMLESS.contains(&name.as_str()) {
            aside.push(key);
        }
    }
    if !aside.is_empty() {
        let mut names = aside.iter().take(SHOWN).map(|key| quoted(key)).collect::<Vec<_>>().join(", ");
        if aside.len() > SHOWN {
            names.push_str(&format!(" and {} more", aside.len() - SHOWN));
        }
        notes.push(format!("keys that are not known here are left aside: {names}"));
    }
    Ok(ours)
}

/// ParaView writes 0 and 1.
fn flag(key: &str, value: &Value) -> Result<Value, String> {
    match value {
        Value::Null | Value::Bool(_) => Ok(value.clone()),
        _ if value.as_f64() == Some(0.0) => Ok(Value::Bool(false)),
        _ if value.as_f64() == Some(1.0) => Ok(Value::Bool(true)),
        _ => Err(format!("{} = {}: true or false is needed", quoted(key), brief(value))),
    }
}

fn is_yes(value: &Value) -> bool {
    value.as_bool() == Some(true) || value.as_f64() == Some(1.0)
}

/// True where the key's value is the one that no picture shows: off, null, zero, the identity.
fn changes_nothing(name: &str, value: &Value) -> bool {
    let numbers = || -> Option<Vec<f64>> {
        // A matrix may be nested by rows, or be an object with numbered keys as typed arrays are written.
        let mut flat = Vec::new();
        let mut push = |value: &Value| match value {
            Value::Array(row) => row.iter().all(|v| v.as_f64().is_some_and(|v| (flat.push(v), true).1)),
            other => other.as_f64().is_some_and(|v| (flat.push(v), true).1),
        };
        let whole = match value {
            Value::Array(list) => list.iter().all(&mut push),
            Value::Object(object) => (0..object.len()).all(|i| object.get(&i.to_string()).is_some_and(&mut push)),
            _ => false,
        };
        whole.then_some(flat)
    };
    match (value, numbers()) {
        (Value::Null | Value::Bool(false), _) => true,
        (Value::Number(n), _) => n.as_f64() == Some(0.0),
        (_, Some(numbers)) if numbers.len() == 16 => {
            numbers.iter().enumerate().all(|(i, v)| *v == if i % 5 == 0 { 1.0 } else { 0.0 })
        }
        // The third number of a shear is where it leaves things as they are.
        (_, Some(numbers)) if name == "viewshear" => numbers.iter().take(2).all(|v| *v == 0.0),
        (_, Some(numbers)) => numbers.iter().all(|v| *v == 0.0),
        _ => false,
    }
}

/// A key of the file on one line.
fn quoted(key: &str) -> String {
    format!("{:?}", key.chars().take(40).collect::<String>())
}

fn brief(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 60 { text } else { text.chars().take(60).chain("...".chars()).collect() }
}

#[cfg(test)]
mod tests;
