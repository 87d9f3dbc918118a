//! What to simulate, as text: `nodes=64,chunks=512,views=60,throttle=3@0,kill=30@1,join=40,seed=1,path=dive`.

use std::str::FromStr;

use serde::Serialize;

/// An example for error texts.
const EXAMPLE: &str = "nodes=64,chunks=512,views=60,throttle=3@0,kill=30@1,join=40,seed=1,path=dive";

/// How the camera moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// Around the volume, into it and out again, 60 views a time.
    #[default]
    Dive,
    /// Every view for itself, half of them from inside.
    Random,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Throttled {
    /// How many times slower than the others.
    pub factor: f64,
    pub node: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Kill {
    /// The first view without the node.
    pub view: u32,
    pub node: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spec {
    pub nodes: u64,
    /// Asked for; the grid has about so many.
    pub chunks: u32,
    pub views: u32,
    pub throttles: Vec<Throttled>,
    pub kills: Vec<Kill>,
    /// Views before which another node joins.
    pub joins: Vec<u32>,
    pub seed: u64,
    pub path: PathKind,
    /// Memory of a node, in even shares of the volume; never less than 16 chunks.
    pub memory: f64,
    /// Pixels per side of the picture.
    pub size: u32,
    /// As [`crate::balance::Settings::replicas`].
    pub replicas: u32,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpecError {
    #[error("--simulate: `{0}` is not of the form key=value; an example: {EXAMPLE}")]
    NoValue(String),
    #[error(
        "--simulate: there is no `{0}`; there are nodes, chunks, views, throttle, kill, join, seed, path, memory, \
         size, replicas; an example: {EXAMPLE}"
    )]
    UnknownKey(String),
    #[error("--simulate: {key}={value}: must be {wanted}; an example: {EXAMPLE}")]
    Value { key: &'static str, value: String, wanted: &'static str },
    #[error("--simulate: {0} is given twice")]
    Twice(&'static str),
    #[error("--simulate: {key}: there is no node {node}; the nodes are 0 to {last}, and those that join follow")]
    NoSuchNode { key: &'static str, node: u64, last: u64 },
    #[error("--simulate: {key}: there is no view {view}; the views are 0 to {last}")]
    NoSuchView { key: &'static str, view: u32, last: u32 },
    #[error("--simulate: after the kills before view {0} no node is left")]
    NobodyLeft(u32),
}

const NODES: u64 = 4096;
const CHUNKS: u32 = 4096;
const VIEWS: u32 = 100_000;
/// Events of one kind.
const EVENTS: usize = 4096;

impl Default for Spec {
    fn default() -> Self {
        Self {
            nodes: 8,
            chunks: 512,
            views: 60,
            throttles: Vec::new(),
            kills: Vec::new(),
            joins: Vec::new(),
            seed: 1,
            path: PathKind::default(),
            memory: 3.0,
            size: 1024,
            replicas: 2,
        }
    }
}

impl FromStr for Spec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let mut spec = Self::default();
        let mut given: Vec<&'static str> = Vec::new();
        for word in text.split(',').map(str::trim) {
            let Some((key, value)) = word.split_once('=') else { return Err(SpecError::NoValue(word.to_owned())) };
            let (key, value) = (key.trim(), value.trim());
            let once = |given: &mut Vec<&'static str>, key| match given.contains(&key) {
                true => Err(SpecError::Twice(key)),
                false => {
                    given.push(key);
                    Ok(())
                }
            };
            match key {
                "nodes" => {
                    once(&mut given, "nodes")?;
                    spec.nodes = number("nodes", value, "a whole number from 1 to 4096", 1..=NODES)?;
                }
                "chunks" => {
                    once(&mut given, "chunks")?;
                    spec.chunks = number("chunks", value, "a whole number from 1 to 4096", 1..=CHUNKS)?;
                }
                "views" => {
                    once(&mut given, "views")?;
                    spec.views = number("views", value, "a whole number from 1 to 100000", 1..=VIEWS)?;
                }
                "seed" => {
                    once(&mut given, "seed")?;
                    spec.seed = number("seed", value, "a whole number", 0..=u64::MAX)?;
                }
                "memory" => {
                    once(&mut given, "memory")?;
                    let wanted = "a number from 1 to 4096: even shares of the volume that a node can hold";
                    spec.memory = number("memory", value, wanted, 1.0..=4096.0)?;
                }
                "size" => {
                    once(&mut given, "size")?;
                    spec.size = number("size", value, "pixels per side of the picture, from 64 to 8192", 64..=8192)?;
                }
                "replicas" => {
                    once(&mut given, "replicas")?;
                    spec.replicas = number("replicas", value, "holders of a chunk, from 1 to 64", 1..=64)?;
                }
                "path" => {
                    once(&mut given, "path")?;
                    let wanted = "dive or random";
                    spec.path = match value {
                        "dive" => PathKind::Dive,
                        "random" => PathKind::Random,
                        _ => return Err(SpecError::Value { key: "path", value: value.to_owned(), wanted }),
                    };
                }
                "throttle" => {
                    let (factor, node) = at("throttle", value, "FACTOR@NODE with a factor from 1 to 1000, e.g. 3@0")?;
                    let factor =
                        number("throttle", factor, "FACTOR@NODE with a factor from 1 to 1000, e.g. 3@0", 1.0..=1000.0)?;
                    let node = number("throttle", node, "FACTOR@NODE, e.g. 3@0", 0..=u64::MAX)?;
                    spec.throttles.push(Throttled { factor, node });
                }
                "kill" => {
                    let (view, node) = at("kill", value, "VIEW@NODE, e.g. 30@1")?;
                    let view = number("kill", view, "VIEW@NODE, e.g. 30@1", 0..=u32::MAX)?;
                    spec.kills.push(Kill { view, node: number("kill", node, "VIEW@NODE, e.g. 30@1", 0..=u64::MAX)? });
                }
                "join" => spec.joins.push(number("join", value, "a view, e.g. 40", 0..=u32::MAX)?),
                _ => return Err(SpecError::UnknownKey(key.to_owned())),
            }
        }
        spec.check()?;
        Ok(spec)
    }
}

fn at<'a>(key: &'static str, value: &'a str, wanted: &'static str) -> Result<(&'a str, &'a str), SpecError> {
    value.split_once('@').ok_or_else(|| SpecError::Value { key, value: value.to_owned(), wanted })
}

fn number<T: FromStr + PartialOrd>(
    key: &'static str,
    value: &str,
    wanted: &'static str,
    range: std::ops::RangeInclusive<T>,
) -> Result<T, SpecError> {
    let parsed = value.parse().ok().filter(|v| range.contains(v));
    parsed.ok_or_else(|| SpecError::Value { key, value: value.to_owned(), wanted })
}

impl Spec {
    /// How many times slower a node is.
    #[must_use]
    pub fn throttle_of(&self, node: u64) -> f64 {
        self.throttles.iter().rfind(|t| t.node == node).map_or(1.0, |t| t.factor)
    }

    /// Nodes that are there before a view's joins and kills.
    fn entered(&self, view: u32) -> u64 {
        self.nodes + self.joins.iter().filter(|at| **at <= view).count() as u64
    }

    fn check(&self) -> Result<(), SpecError> {
        let last = self.views - 1;
        for (key, count) in [("throttle", self.throttles.len()), ("kill", self.kills.len()), ("join", self.joins.len())]
        {
            if count > EVENTS {
                return Err(SpecError::Value {
                    key,
                    value: format!("{count} times"),
                    wanted: "given at most 4096 times",
                });
            }
        }
        if let Some(&view) = self.joins.iter().find(|at| **at > last) {
            return Err(SpecError::NoSuchView { key: "join", view, last });
        }
        let all = self.entered(last);
        if let Some(t) = self.throttles.iter().find(|t| t.node >= all) {
            return Err(SpecError::NoSuchNode { key: "throttle", node: t.node, last: all - 1 });
        }
        let mut kills = self.kills.clone();
        kills.sort_by_key(|kill| kill.view);
        let mut dead = std::collections::BTreeSet::new();
        for kill in kills {
            if kill.view > last {
                return Err(SpecError::NoSuchView { key: "kill", view: kill.view, last });
            }
            let there = self.entered(kill.view);
            if kill.node >= there {
                return Err(SpecError::NoSuchNode { key: "kill", node: kill.node, last: there - 1 });
            }
            dead.insert(kill.node);
            if dead.len() as u64 == there {
                return Err(SpecError::NobodyLeft(kill.view));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_is_read() {
        let spec: Spec = EXAMPLE.parse().unwrap();
        assert_eq!((spec.nodes, spec.chunks, spec.views, spec.seed, spec.path), (64, 512, 60, 1, PathKind::Dive));
        assert_eq!(spec.throttles, [Throttled { factor: 3.0, node: 0 }]);
        assert_eq!((spec.throttle_of(0), spec.throttle_of(1)), (3.0, 1.0));
        assert_eq!((spec.kills, spec.joins), (vec![Kill { view: 30, node: 1 }], vec![40]));
        // A node that joins may be killed later.
        assert!("nodes=2,join=5,kill=6@2".parse::<Spec>().is_ok());
    }

    #[test]
    fn what_cannot_be_is_named() {
        for (text, what) in [
            ("", "`` is not of the form key=value"),
            ("nodes", "`nodes` is not of the form key=value"),
            ("node=3", "there is no `node`"),
            ("nodes=0", "nodes=0: must be a whole number from 1 to 4096"),
            ("nodes=4097", "nodes=4097"),
            ("chunks=4097", "chunks=4097"),
            ("views=100001", "views=100001"),
            ("views=-1", "views=-1"),
            ("seed=x", "seed=x: must be a whole number"),
            ("memory=NaN", "memory=NaN"),
            ("path=orbit", "path=orbit: must be dive or random"),
            ("throttle=3", "throttle=3: must be FACTOR@NODE"),
            ("throttle=0.5@1", "throttle=0.5: must be"),
            ("throttle=3@8", "throttle: there is no node 8; the nodes are 0 to 7"),
            ("kill=3@x", "kill=x: must be VIEW@NODE"),
            ("kill=60@1", "kill: there is no view 60; the views are 0 to 59"),
            ("join=40,kill=39@8", "kill: there is no node 8"),
            ("join=60", "join: there is no view 60"),
            ("nodes=1,kill=3@0", "after the kills before view 3 no node is left"),
            ("nodes=2,nodes=2", "nodes is given twice"),
        ] {
            let error = text.parse::<Spec>().expect_err(text).to_string();
            assert!(error.contains(what), "{text}: {error}");
        }
    }
}
