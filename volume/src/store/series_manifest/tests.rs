use super::*;
use crate::store::error::StoreError;

fn manifest() -> SeriesManifest {
    let step = |n: u128| StepEntry { hash: StoreHash(n), time: Some(n as f64 * 0.5) };
    let mut histogram = vec![0; 256];
    (histogram[3], histogram[200]) = (7, 9);
    SeriesManifest {
        steps: (1..4).map(step).collect(),
        time_unit: Some("second".to_owned()),
        statistics: CommonStatistics {
            min: -1.0,
            max: 2.5,
            mean: 0.25,
            otsu: 0.5,
            quantiles: [-1.0, -0.5, 0.0, 0.1, 0.2, 0.3, 0.4, 2.0, 2.5],
            histogram,
            noise: Some(0.125),
        },
        files: [ContentHash(5), ContentHash(6)],
    }
}

#[test]
fn it_comes_back_as_it_was() {
    let manifest = manifest();
    assert_eq!(SeriesManifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap(), manifest);
    let mut without = manifest;
    (without.time_unit, without.statistics.noise) = (None, None);
    without.steps.iter_mut().for_each(|step| step.time = None);
    let bytes = without.to_bytes().unwrap();
    assert!(!String::from_utf8_lossy(&bytes).contains("time"));
    assert_eq!(SeriesManifest::from_bytes(&bytes).unwrap(), without);
}

#[test]
fn what_cannot_be_is_refused_by_its_field() {
    let good: serde_json::Value = serde_json::from_slice(&manifest().to_bytes().unwrap()).unwrap();
    let refused = |change: &dyn Fn(&mut serde_json::Value), word: &str| {
        let mut bad = good.clone();
        change(&mut bad);
        let error = SeriesManifest::from_bytes(&serde_json::to_vec(&bad).unwrap()).unwrap_err();
        assert!(matches!(error, StoreError::SeriesManifest { .. }) && error.to_string().contains(word), "{error}");
    };
    refused(&|m| m["steps"] = serde_json::json!([]), "steps");
    refused(&|m| m["steps"] = serde_json::json!(vec![m["steps"][0].clone(); MAX_STEPS + 1]), "10001");
    refused(&|m| m["steps"][1]["hash"] = "no".into(), "hash");
    refused(&|m| m["steps"][1]["time"] = 0.5.into(), "step 1 is at 0.5, not after");
    refused(&|m| m["steps"][2]["time"] = serde_json::Value::Null, "step 2 has no time");
    refused(&|m| m["version"] = 2.into(), "format version 2");
    refused(&|m| m["format"] = "brickcast-store".into(), "brickcast-store");
    refused(&|m| m["mean"] = 3.into(), "mean");
    refused(&|m| m["quantiles"][0] = 9.into(), "quantiles");
    refused(&|m| m["histogram"] = serde_json::json!([1, 2]), "histogram");
    refused(&|m| m["histogram"][0] = u64::MAX.into(), "histogram");
    refused(&|m| m["noise"] = 0.into(), "noise");
    refused(&|m| m["files"]["zarr.json"] = "x".into(), "files");
    refused(&|m| m["more"] = 1.into(), "more");
}

/// Cut, doubled, with bytes changed: refused or read, and never a panic.
#[test]
fn mutated_bytes_do_no_harm() {
    let good = manifest().to_bytes().unwrap();
    let mut random = 88_172_645_463_325_252_u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random as usize
    };
    for _ in 0..10_000 {
        let mut bad = good.clone();
        for _ in 0..1 + next() % 4 {
            let at = next() % bad.len();
            match next() % 3 {
                0 => bad[at] = b"0919-e,[]{}\"n"[next() % 13],
                1 => bad.truncate(at.max(1)),
                _ => bad.insert(at, next() as u8),
            }
        }
        if let Ok(manifest) = SeriesManifest::from_bytes(&bad) {
            assert!((1..=MAX_STEPS).contains(&manifest.steps.len()));
        }
    }
}
