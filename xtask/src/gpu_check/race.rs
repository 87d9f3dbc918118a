//! The GPU's kernel against the processor's, style by style, on a phantom.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, bail, ensure};
use serde_json::{Value, json};

use super::children::Child;

/// What all rows have in common: one node, one view.
const VIEW: [&str; 10] =
    ["--counts", "1", "--repeat", "5", "--azimuth", "30", "--elevation", "20", "--window", "12000,41000"];

/// A style, and its flags. `plain` takes every sample of every ray: the kernel's own speed.
const STYLES: [(&str, &[&str]); 11] = [
    ("plain", &["--integration", "sampled", "--accel", "none"]),
    ("exact filter", &["--integration", "sampled", "--accel", "none", "--filter", "exact"]),
    ("slabs", &["--integration", "preintegrated", "--accel", "none"]),
    ("lit samples", &["--integration", "sampled", "--accel", "none", "--shading", "phong"]),
    ("lit slabs", &["--integration", "preintegrated", "--accel", "none", "--shading", "phong"]),
    ("isosurface", &["--isosurface", "20000", "--accel", "none"]),
    ("mip", &["--mode", "mip", "--accel", "none"]),
    ("skipping", &["--integration", "sampled", "--accel", "ert,ess"]),
    ("leaping", &["--integration", "sampled", "--accel", "all"]),
    ("auto", &[]),
    ("small bricks", &["--integration", "sampled", "--accel", "none"]),
];

/// Figures of all styles; what did not end in time is named as left out.
pub(super) fn run(program: &Path, scratch: &Path, size: u32, end: Instant) -> anyhow::Result<Value> {
    let text = |path: &Path| path.to_str().map(str::to_owned).context("the temporary folder's name is no UTF-8");
    let volume = text(&scratch.join("phantom.nrrd"))?;
    let stores = ["large", "small"].map(|name| scratch.join(name));
    let (large, small) = (text(&stores[0])?, text(&stores[1])?);
    let mut left_out = Vec::new();
    let make = |words: &[&str], what: &str| {
        let ended = Child::new(program, words, what).run(end)?;
        ensure!(ended.is_some_and(|ended| ended.is_success), "{what}: brickcast {} failed", words.join(" "));
        Ok(())
    };
    make(&["phantom", &volume, "--pores", "200"], "a phantom of 256 x 256 x 256")?;
    make(&["prepare", &volume, &large, "--segmentation-range", "0.03", "--brick", "256"], "a store of one brick")?;
    make(&["prepare", &volume, &small, "--segmentation-range", "0.03"], "a store of bricks of 64")?;
    let mut adapters = Value::Null;
    let mut rows = Vec::new();
    for (name, flags) in STYLES {
        // Regions leap in bricks as they are usual.
        let store = if ["skipping", "leaping", "auto", "small bricks"].contains(&name) { &small } else { &large };
        let json_path = scratch.join("bench.json");
        let json_text = text(&json_path)?;
        let words: Vec<&str> = ["bench", store].into_iter().chain(VIEW).chain(flags.iter().copied()).collect();
        let side = size.to_string();
        let words = [&words[..], &["--size", &side, "--json", &json_text]].concat();
        match Child::new(program, &words, name).run(end)? {
            None => left_out.push(name),
            Some(ended) if !ended.is_success => bail!("{name}: brickcast {} failed", words.join(" ")),
            Some(_) => {
                let said: Value = serde_json::from_str(&text_of(&json_path)?)?;
                std::fs::remove_file(&json_path)?;
                adapters = said["adapters"].clone();
                rows.push(row(name, &said["rows"])?);
            }
        }
    }
    Ok(json!({ "adapters": adapters, "size": [size, size], "step": 0.5, "styles": rows, "left_out": left_out }))
}

/// What the bench wrote into a folder of this program's own.
fn text_of(path: &Path) -> anyhow::Result<String> {
    #[expect(clippy::disallowed_methods, reason = "a file that was just written, in a folder of this program's own")]
    std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))
}

/// Both kernels' figures, and how many times as fast the GPU's is.
fn row(name: &str, rows: &Value) -> anyhow::Result<Value> {
    let of = |backend: &str| rows.as_array()?.iter().find(|row| row["backend"] == backend);
    let cpu = of("cpu").with_context(|| format!("{name}: the bench has no row of the processor"))?;
    let ms = |row: &Value| row["frame_ms"].as_f64().unwrap_or(f64::NAN);
    let figures = |row: &Value| {
        json!({
            "frame_ms": row["frame_ms"], "samples": row["samples"],
            "samples_per_second": row["samples_per_second"], "load_ms": row["load_ms"],
        })
    };
    let gpu = of("gpu");
    Ok(json!({
        "style": name, "gpu": gpu.map(figures), "cpu": figures(cpu),
        "times_as_fast": gpu.map(|gpu| ms(cpu) / ms(gpu)),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_both_kernels_or_says_that_there_is_no_gpu() {
        let one = |backend: &str, ms: f64| json!({ "backend": backend, "frame_ms": ms, "samples": 7 });
        let both = row("plain", &json!([one("gpu", 5.0), one("cpu", 20.0)])).unwrap();
        assert_eq!((&both["times_as_fast"], &both["gpu"]["samples"]), (&json!(4.0), &json!(7)));
        let alone = row("plain", &json!([one("cpu", 20.0)])).unwrap();
        assert_eq!((&alone["times_as_fast"], &alone["gpu"]), (&Value::Null, &Value::Null));
        assert!(row("plain", &json!([one("gpu", 5.0)])).is_err());
    }
}
