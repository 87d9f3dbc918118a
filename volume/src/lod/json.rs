//! Levels of detail in the manifest of a picture: `"full"`, a number, or an object that says by what they are
//! chosen, or which they are.

use glam::DVec3;
use serde_json::{Value, json};

use super::rule::{Criterion, Lod, Rule};
use super::set::LevelSet;
use crate::json_fields::{FieldError, Fields};
use crate::scene::Words as _;

const FULL: &str = "full";

impl Lod {
    #[must_use]
    pub fn to_json(&self) -> Value {
        match self {
            Self::Full => json!(FULL),
            Self::Level(level) => json!(level),
            Self::Auto(Rule::Error { pixels }) => json!({ "criterion": Criterion::Error, "pixel_error": pixels }),
            Self::Auto(Rule::FieldOfView) => json!({ "criterion": Criterion::Fov }),
            Self::Auto(Rule::Cone) => json!({ "criterion": Criterion::Cone }),
            Self::Auto(Rule::Focus(point)) => json!({ "focus": point.to_array() }),
            Self::Set(set) => json!({ "set": set.runs() }),
        }
    }

    /// What the field `key` says; full resolution where it is not there, as in earlier versions.
    ///
    /// # Errors
    /// Anything that [`Lod::to_json`] does not write.
    pub fn from_json(fields: &Fields<'_>, key: &str) -> Result<Self, FieldError> {
        let Some(value) = fields.optional(key) else { return Ok(Self::Full) };
        if value == FULL {
            return Ok(Self::Full);
        }
        if !value.is_object() {
            return match fields.get(key) {
                Ok(level) => Ok(Self::Level(level)),
                Err(_) => Err(fields.refused(key, "\"full\", the number of a level, or an object is needed")),
            };
        }
        let object = fields.object(key)?;
        if object.optional("set").is_some() {
            object.only(&[&["set"]])?;
            let runs: Vec<(u8, u32)> = object.get("set")?;
            return LevelSet::new(runs).map(Self::Set).map_err(|error| object.refused("set", error));
        }
        let rule = rule_from(&object)?;
        rule.check().map_err(|error| fields.refused(key, error))?;
        Ok(Self::Auto(rule))
    }
}

fn rule_from(fields: &Fields<'_>) -> Result<Rule, FieldError> {
    if fields.optional("focus").is_some() {
        fields.only(&[&["focus"]])?;
        return Ok(Rule::Focus(DVec3::from_array(fields.get("focus")?)));
    }
    let word: String = fields.get("criterion")?;
    let criterion = Criterion::of_word(&word).map_err(|error| fields.refused("criterion", error))?;
    let known: &[&str] = if criterion == Criterion::Error { &["criterion", "pixel_error"] } else { &["criterion"] };
    fields.only(&[known])?;
    Ok(match criterion {
        Criterion::Error => Rule::Error { pixels: fields.get("pixel_error")? },
        Criterion::Fov => Rule::FieldOfView,
        Criterion::Cone => Rule::Cone,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(value: Value) -> Result<Lod, String> {
        let root = json!({ "lod": value });
        let fields = Fields::of("", &root).map_err(|error| error.to_string())?;
        Lod::from_json(&fields, "lod").map_err(|error| error.to_string())
    }

    #[test]
    fn what_is_written_is_read_back() {
        let rules =
            [Rule::Error { pixels: 1.0 / 3.0 }, Rule::FieldOfView, Rule::Cone, Rule::Focus(DVec3::new(0.1, -2.0, 1e9))];
        let set = Lod::Set(LevelSet::new([(2, 512), (0, 1), (1, 7)]).unwrap());
        let all = [Lod::Full, Lod::Level(0), Lod::Level(7), set].into_iter().chain(rules.map(Lod::Auto));
        for lod in all {
            assert_eq!(read(lod.to_json()).as_ref(), Ok(&lod));
        }
        assert_eq!(read(Value::Null), Ok(Lod::Full), "earlier manifests do not tell");
    }

    #[test]
    fn what_chooses_nothing_is_refused_with_its_value() {
        for (value, words) in [
            (json!("half"), &["lod = \"half\"", "full"][..]),
            (json!(-1), &["lod = -1"]),
            (json!(300), &["lod = 300"]),
            (json!([1]), &["lod = [1]"]),
            (json!({}), &["lod.criterion is missing"]),
            (json!({ "criterion": "near" }), &["lod.criterion = \"near\"", "error, fov, cone"]),
            (json!({ "criterion": "error" }), &["lod.pixel_error is missing"]),
            (json!({ "criterion": "error", "pixel_error": 0.0 }), &["pixel error 0", "above 0"]),
            (json!({ "criterion": "fov", "pixel_error": 1.0 }), &["lod.pixel_error is not known"]),
            (json!({ "focus": [1, 2] }), &["lod.focus = [1,2]"]),
            (json!({ "focus": [1, 2, 3], "criterion": "cone" }), &["lod.criterion is not known"]),
            (json!({ "set": [[1, 8], [0, 0]] }), &["lod.set", "each run must have a chunk"]),
            (json!({ "set": [[0, u32::MAX], [0, 1]] }), &["lod.set", "2^32"]),
            (json!({ "set": [[300, 1]] }), &["lod.set"]),
            (json!({ "set": [], "criterion": "fov" }), &["lod.criterion is not known"]),
        ] {
            let error = read(value).unwrap_err();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }
}
