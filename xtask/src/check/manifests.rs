//! Which crate may know which: the table of ARCHITECTURE.md, against `cargo metadata`.

use std::process::Command;

use anyhow::{Context as _, bail};
use serde_json::Value;

use super::law::Check;
use crate::tree::Tree;

pub(super) const CHECK: Check = Check {
    name: "dependency-law",
    law: "crates depend only on those that the table of ARCHITECTURE.md allows",
    remedy: "move the code to the crate that may know both, or change the table (xtask/src/check/manifests.rs) with a \
             reason",
    run: |tree| Ok(problems(&metadata(tree)?)),
};

struct Law {
    package: &'static str,
    /// Our crates that it may name, in any kind of dependency; `None`: all.
    ours: Option<&'static [&'static str]>,
    /// Crates of others that it must not name: what keeps it clear of GPU, network or shaders.
    banned: &'static [&'static str],
}

const VOLUME: &str = "brickcast-volume";
const REMOTE: &str = "brickcast-remote";
const ZARR: &str = "brickcast-zarr";
const FORMATS: &str = "brickcast-formats";
const SHADERS: &str = "brickcast-shaders";
const PROTO: &str = "brickcast-proto";
const CPU: &str = "brickcast-cpu";
const NODE: &str = "brickcast-node";
const HARNESS: &str = "brickcast-harness";
const ATTRIBUTE: &str = "brickcast-harness-attribute";

const LAWS: [Law; 13] = [
    Law {
        package: VOLUME,
        ours: Some(&[]),
        banned: &["wgpu", "naga", "tokio", "tonic", "prost", "hyper", "axum", "futures-util", "async-trait"],
    },
    Law { package: REMOTE, ours: Some(&[VOLUME]), banned: &["wgpu", "naga", "tonic", "prost"] },
    Law { package: ZARR, ours: Some(&[VOLUME]), banned: &["wgpu", "naga", "tokio", "tonic", "prost"] },
    Law { package: FORMATS, ours: Some(&[VOLUME, HARNESS]), banned: &["wgpu", "naga", "tokio", "tonic", "prost"] },
    Law { package: SHADERS, ours: Some(&[VOLUME]), banned: &["wgpu", "tokio", "tonic", "prost"] },
    Law { package: PROTO, ours: Some(&[VOLUME]), banned: &["wgpu", "naga"] },
    Law { package: CPU, ours: Some(&[VOLUME, SHADERS]), banned: &["wgpu", "naga", "tokio", "tonic", "prost"] },
    Law { package: NODE, ours: Some(&[VOLUME, REMOTE, ZARR, SHADERS, CPU, PROTO, HARNESS]), banned: &[] },
    Law { package: "brickcast", ours: Some(&[VOLUME, REMOTE, ZARR, FORMATS, PROTO, NODE]), banned: &["wgpu", "naga"] },
    Law { package: HARNESS, ours: Some(&[ATTRIBUTE]), banned: &["wgpu", "tokio"] },
    Law { package: ATTRIBUTE, ours: Some(&[]), banned: &["wgpu", "tokio"] },
    Law { package: "brickcast-tests", ours: None, banned: &[] },
    Law { package: "xtask", ours: None, banned: &[] },
];

fn metadata(tree: &Tree) -> anyhow::Result<Value> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let arguments = ["metadata", "--no-deps", "--format-version", "1", "--offline"];
    let output = Command::new(cargo).current_dir(&tree.root).args(arguments).output().context("cannot run cargo")?;
    if !output.status.success() {
        bail!("cargo metadata failed: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn problems(metadata: &Value) -> Vec<String> {
    let list = |value: &Value, key: &str| value[key].as_array().cloned().unwrap_or_default();
    let name = |value: &Value| value["name"].as_str().unwrap_or_default().to_owned();
    let packages = list(metadata, "packages");
    let ours: Vec<String> = packages.iter().map(name).collect();
    let mut problems = Vec::new();
    for package in &packages {
        let package_name = name(package);
        let Some(law) = LAWS.iter().find(|l| l.package == package_name) else {
            problems.push(format!("{package_name} is not in the table"));
            continue;
        };
        for dependency in list(package, "dependencies") {
            let dependency_name = name(&dependency);
            let kind = dependency["kind"].as_str().unwrap_or("normal");
            let is_ours = ours.contains(&dependency_name);
            let allowed = law.ours.is_none_or(|list| list.contains(&dependency_name.as_str()));
            if (is_ours && !allowed) || law.banned.contains(&dependency_name.as_str()) {
                problems.push(format!("{package_name} may not use {dependency_name} ({kind} dependency)"));
            }
        }
    }
    for law in LAWS.iter().filter(|l| !ours.iter().any(|o| o == l.package)) {
        problems.push(format!("the table names {}, which is no crate of the workspace", law.package));
    }
    problems
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// The whole workspace, with `extra` dependencies (package, dependency, kind).
    fn workspace(extra: &[(&str, &str, Option<&str>)]) -> Value {
        let packages: Vec<_> = LAWS
            .iter()
            .map(|law| {
                let dependencies: Vec<_> = extra
                    .iter()
                    .filter(|(package, ..)| *package == law.package)
                    .map(|(_, name, kind)| json!({"name": name, "kind": kind}))
                    .collect();
                json!({"name": law.package, "dependencies": dependencies})
            })
            .collect();
        json!({ "packages": packages })
    }

    #[test]
    fn what_the_table_allows_passes() {
        let allowed = [
            (NODE, VOLUME, None),
            ("brickcast", NODE, None),
            ("brickcast-tests", "brickcast", None),
            (VOLUME, "serde", None),
            (SHADERS, "naga", Some("dev")),
        ];
        assert_eq!(problems(&workspace(&allowed)), [""; 0]);
    }

    #[test]
    fn every_direction_against_the_table_is_found() {
        for (package, dependency, kind) in [
            (VOLUME, SHADERS, None),
            (VOLUME, "tokio", None),
            (VOLUME, NODE, Some("dev")),
            (PROTO, NODE, None),
            (NODE, "brickcast", Some("dev")),
            ("brickcast", SHADERS, None),
            ("brickcast", "wgpu", Some("build")),
        ] {
            let found = problems(&workspace(&[(package, dependency, kind)]));
            assert_eq!(found.len(), 1, "{package} {dependency}");
            assert!(found[0].contains(package) && found[0].contains(dependency));
        }
    }

    #[test]
    fn unknown_and_missing_crates_are_found() {
        let found = problems(&json!({"packages": [{"name": "new", "dependencies": []}]}));
        assert!(found[0].contains("new is not in the table"));
        assert_eq!(found.len(), 1 + LAWS.len());
    }
}
