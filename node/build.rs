//! Which commit this is built from, for `--version`.
//!
//! A release is built anew where the branch has moved. Other builds are not: each commit would build half of the tree
//! once more for nothing. They name the commit that they saw last, and say that it may be a later one.

use std::path::{Path, PathBuf};
use std::process::Command;

use time::OffsetDateTime;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src");
    // Set by whoever builds without the repository, such as packagers.
    println!("cargo:rerun-if-env-changed=BRICKCAST_COMMIT");
    println!("cargo:rerun-if-env-changed=SOURCE_DATE_EPOCH");
    let is_release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default()).join("..");
    let told = set("BRICKCAST_COMMIT");
    let seen = told.is_none().then(|| commit(&root)).flatten();
    let is_moving = seen.is_some() && !is_release;
    if seen.is_some() && is_release {
        watch(&root);
    }
    let (hash, seconds) = seen.map_or((told, None), |(hash, seconds)| (Some(hash), Some(seconds)));
    let seconds = set("SOURCE_DATE_EPOCH").or(seconds);
    let date = seconds.and_then(|seconds| OffsetDateTime::from_unix_timestamp(seconds.parse().ok()?).ok());
    let date = date.map_or_else(String::new, |at| format!(" of {}", at.date()));
    let later = if is_moving { " or later" } else { "" };
    let words = match &hash {
        Some(hash) => format!("{hash}{date}{later}"),
        None => format!("unknown{date}"),
    };
    println!("cargo:rustc-env=BRICKCAST_BUILT_FROM={words}");
}

fn set(name: &str) -> Option<String> {
    std::env::var(name).ok().map(|value| value.trim().to_owned()).filter(|value| !value.is_empty())
}

/// What git says; nothing where there is no git, or no repository.
fn git(root: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(root).args(arguments).output().ok()?;
    let said = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !said.is_empty()).then_some(said)
}

/// Hash and time of the last commit, where `root` is a repository of its own: sources without one may lie in another.
fn commit(root: &Path) -> Option<(String, String)> {
    let top = PathBuf::from(git(root, &["rev-parse", "--show-toplevel"])?);
    if top.canonicalize().ok()? != root.canonicalize().ok()? {
        return None;
    }
    let said = git(root, &["log", "-1", "--format=%h %ct"])?;
    let (hash, seconds) = said.split_once(' ')?;
    Some((hash.to_owned(), seconds.to_owned()))
}

/// Runs this again when another commit is checked out or made: HEAD, and the branch that it names.
fn watch(root: &Path) {
    let path = |name: &str| git(root, &["rev-parse", "--git-path", name]).map(|path| root.join(path));
    let branch = git(root, &["symbolic-ref", "-q", "HEAD"]).and_then(|branch| path(&branch));
    // A packed branch gets a file of its own with its next commit.
    let branch = branch.filter(|file| file.exists()).or_else(|| path("refs/heads"));
    for file in path("HEAD").into_iter().chain(branch).filter(|file| file.exists()) {
        println!("cargo:rerun-if-changed={}", file.display());
    }
}
