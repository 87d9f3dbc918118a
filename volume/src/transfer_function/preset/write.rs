//! Presets as ParaView writes and reads them.

use std::fmt::Write as _;

use super::read::Preset;
use crate::transfer_function::function::TransferFunction;

impl Preset {
    /// The preset as JSON, one point a line: RGB points as they are (linear in RGB), and `Points` where the preset has
    /// opacities. Numbers are written so that they read back as the same bits: [`Preset::from_json`] gives the same
    /// function.
    #[must_use]
    pub fn to_json(&self) -> String {
        let name = serde_json::Value::from(self.name.as_deref().unwrap_or("brickcast"));
        let mut text = format!("[\n  {{\n    \"ColorSpace\": \"RGB\",\n    \"Name\": {name},\n");
        if self.has_opacities {
            let points = opacities(&self.function).map(|[x, o]| format!("{x:?}, {o:?}, 0.5, 0.0"));
            list(&mut text, "Points", points);
            text.push_str(",\n");
        }
        let points = self.function.colors().iter().map(|p| {
            let [r, g, b] = p.rgb;
            format!("{:?}, {r:?}, {g:?}, {b:?}", p.x)
        });
        list(&mut text, "RGBPoints", points);
        text.push_str("\n  }\n]\n");
        text
    }
}

fn opacities(function: &TransferFunction) -> impl Iterator<Item = [f64; 2]> {
    function.opacities().iter().map(|p| [p.x, p.opacity])
}

fn list(text: &mut String, key: &str, points: impl Iterator<Item = String>) {
    let points: Vec<String> = points.collect();
    // Writing to a String cannot fail.
    let _ = write!(text, "    \"{key}\": [\n      {}\n    ]", points.join(",\n      "));
}
