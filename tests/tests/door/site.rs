//! A folder with a store, nodes on it, and a client that must always be served.

use std::path::Path;
use std::process::Output;
use std::time::{Duration, Instant};

use brickcast_tests::process::{NodeProcess, binaries, brickcast_ok};

/// What a program said, both ways.
pub(crate) fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

/// A data root with `part.nrrd` and `part.store`.
pub(crate) struct Site(tempfile::TempDir);

impl Site {
    pub(crate) fn new(edge: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let dims = format!("{edge},{edge},{edge}");
        brickcast_ok(folder.path(), &["phantom", "part.nrrd", "--dims", &dims, "--pores", "2"]);
        brickcast_ok(folder.path(), &["prepare", "part.nrrd", "part.store"]);
        Self(folder)
    }

    pub(crate) fn at(&self) -> &Path {
        self.0.path()
    }

    /// A node on it; paths of `extra` are relative to it.
    pub(crate) fn node(&self, extra: &[&str]) -> NodeProcess {
        let extra: Vec<String> = extra.iter().map(|&word| self.absolute(word)).collect();
        let extra: Vec<&str> = extra.iter().map(String::as_str).chain(["--backend", "cpu"]).collect();
        NodeProcess::start(self.at(), &extra)
    }

    fn absolute(&self, word: &str) -> String {
        let path = self.at().join(word);
        if !word.starts_with('-') && path.exists() { path.to_str().unwrap().to_owned() } else { word.to_owned() }
    }

    /// A frame of `node`, complete; how long the client took.
    pub(crate) fn render(&self, node: &NodeProcess, extra: &[&str]) -> Duration {
        let started = Instant::now();
        let mut args = vec!["render", "part.store", "-o", "good.png", "--size", "64x64", "--nodes", &node.address];
        args.extend(extra);
        brickcast_ok(self.at(), &args);
        started.elapsed()
    }

    /// The exit code of a health probe.
    pub(crate) fn probe(&self, address: &str, extra: &[&str]) -> Option<i32> {
        let mut command = std::process::Command::new(binaries().join("brickcast-node"));
        command.current_dir(self.at()).args(["--health", address]).args(extra).output().unwrap().status.code()
    }
}
