//! Which nodes there are: addresses, names that resolve to many (`dns:NAME:PORT`), and files (`file:PATH`).

use std::path::PathBuf;

use brickcast_volume::small_file::read_text;

/// The most nodes of a session.
pub const MAX_NODES: usize = 4096;
/// The largest file of addresses, bytes.
const MAX_FILE_BYTES: u64 = 1 << 20;

#[derive(Debug, thiserror::Error)]
pub enum DiscoveryError {
    #[error("`{0}` names no nodes: write dns:NAME:PORT, for example dns:node:7000")]
    DnsForm(String),
    #[error("`{0}` names no file of nodes: write file:PATH")]
    FileForm(String),
    #[error("dns:{name}:{port} cannot be resolved ({reason}); is the name right, and are its services up?")]
    Resolve { name: String, port: u16, reason: String },
    #[error("{0}; it holds one address (host:port) a line, # starts a comment")]
    File(String),
    #[error("{got} nodes are named, at most {MAX_NODES} can be")]
    TooMany { got: usize },
}

/// Where a node may be found.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Target {
    /// `host:port`.
    pub address: String,
    /// The name by which it was looked up, where that is not the address's host: what a certificate would be for.
    pub server_name: Option<String>,
    /// Named by the user one by one, so that its absence at the start is an error; else one of many.
    pub explicit: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum NodeSource {
    Address(String),
    Dns { name: String, port: u16 },
    File(PathBuf),
}

/// The nodes as the user names them; what they stand for is looked up again and again.
#[derive(Debug)]
pub struct NodeList {
    /// Each with what it last stood for, which stays valid while it cannot be looked up.
    sources: Vec<(NodeSource, Vec<Target>)>,
}

impl NodeList {
    /// # Errors
    /// A `dns:` or `file:` without what belongs there. Addresses are checked when they are connected.
    pub fn parse(words: &[String]) -> Result<Self, DiscoveryError> {
        let words = words.iter().map(|w| w.trim()).filter(|w| !w.is_empty());
        let sources = words.map(|word| Ok((NodeSource::parse(word)?, Vec::new()))).collect::<Result<_, _>>()?;
        Ok(Self { sources })
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// True where what the list stands for can change.
    #[must_use]
    pub fn changes(&self) -> bool {
        self.sources.iter().any(|(source, _)| !matches!(source, NodeSource::Address(_)))
    }

    /// What the list stands for now, none twice, and what could not be looked up.
    pub(crate) async fn resolve(&mut self) -> (Vec<Target>, Vec<DiscoveryError>) {
        let (mut all, mut problems) = (Vec::<Target>::new(), Vec::new());
        for (source, last) in &mut self.sources {
            match source.resolve().await {
                Ok(found) => *last = found,
                Err(error) => problems.push(error),
            }
            for target in last.iter() {
                if !all.iter().any(|t| t.address == target.address) {
                    all.push(target.clone());
                }
            }
        }
        if all.len() > MAX_NODES {
            problems.push(DiscoveryError::TooMany { got: all.len() });
            all.truncate(MAX_NODES);
        }
        (all, problems)
    }
}

impl NodeSource {
    fn parse(word: &str) -> Result<Self, DiscoveryError> {
        if let Some(rest) = word.strip_prefix("dns:") {
            let parts = rest.rsplit_once(':').filter(|(name, _)| !name.is_empty());
            let parsed = parts.and_then(|(name, port)| Some((name, port.parse().ok().filter(|&p| p != 0)?)));
            let (name, port) = parsed.ok_or_else(|| DiscoveryError::DnsForm(word.to_owned()))?;
            return Ok(Self::Dns { name: name.to_owned(), port });
        }
        match word.strip_prefix("file:") {
            Some("") => Err(DiscoveryError::FileForm(word.to_owned())),
            Some(path) => Ok(Self::File(PathBuf::from(path))),
            None => Ok(Self::Address(word.to_owned())),
        }
    }

    async fn resolve(&self) -> Result<Vec<Target>, DiscoveryError> {
        match self {
            Self::Address(address) => Ok(vec![Target { address: address.clone(), server_name: None, explicit: true }]),
            Self::Dns { name, port } => {
                let failed = |reason: String| DiscoveryError::Resolve { name: name.clone(), port: *port, reason };
                let found = tokio::net::lookup_host((name.as_str(), *port)).await.map_err(|e| failed(e.to_string()))?;
                let mut addresses: Vec<String> = found.map(|a| a.to_string()).collect();
                addresses.sort_unstable();
                let server_name = Some(name.clone());
                let target = |address| Target { address, server_name: server_name.clone(), explicit: false };
                Ok(addresses.into_iter().map(target).collect())
            }
            Self::File(path) => {
                let file = path.clone();
                let read = move || read_text("list of nodes", &file, MAX_FILE_BYTES).map_err(|e| e.to_string());
                let read = tokio::task::spawn_blocking(read).await;
                let text = read.map_err(|e| e.to_string()).and_then(|text| text).map_err(DiscoveryError::File)?;
                let lines = text.lines().map(|line| line.split('#').next().unwrap_or("").trim());
                let target = |line: &str| Target { address: line.to_owned(), server_name: None, explicit: false };
                Ok(lines.filter(|line| !line.is_empty()).map(target).collect())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[&str]) -> Vec<String> {
        words.iter().map(|w| (*w).to_owned()).collect()
    }

    #[test]
    fn malformed_sources_are_refused_in_words() {
        for bad in ["dns:", "dns:node", "dns::7000", "dns:node:0", "dns:node:port", "dns:node:70000"] {
            let error = NodeList::parse(&words(&[bad])).unwrap_err().to_string();
            assert!(error.contains(bad) && error.contains("dns:NAME:PORT"), "{error}");
        }
        assert!(NodeList::parse(&words(&["file:"])).unwrap_err().to_string().contains("file:PATH"));
        assert!(NodeList::parse(&words(&["", " "])).unwrap().is_empty());
    }

    #[tokio::test]
    async fn names_and_files_are_followed_and_nobody_is_named_twice() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nodes");
        std::fs::write(&path, "# mine\n127.0.0.1:7000\n\n  h:1 # slow\n127.0.0.1:9\n").unwrap();
        let file = format!("file:{}", path.display());
        let mut list = NodeList::parse(&words(&["127.0.0.1:7000", "dns:127.0.0.1:9", &file])).unwrap();
        assert!(list.changes() && !NodeList::parse(&words(&["a:1"])).unwrap().changes());
        let addresses = |found: &[Target]| found.iter().map(|t| t.address.clone()).collect::<Vec<_>>();
        let (found, problems) = list.resolve().await;
        assert_eq!(addresses(&found), ["127.0.0.1:7000", "127.0.0.1:9", "h:1"]);
        assert_eq!(found.iter().map(|t| t.explicit).collect::<Vec<_>>(), [true, false, false]);
        assert_eq!(found[1].server_name.as_deref(), Some("127.0.0.1"));
        assert!(problems.is_empty(), "{problems:?}");
        std::fs::write(&path, "new:2\n").unwrap();
        assert_eq!(addresses(&list.resolve().await.0), ["127.0.0.1:7000", "127.0.0.1:9", "new:2"]);
        // A file that is being replaced must not empty the cluster.
        std::fs::remove_file(&path).unwrap();
        let (found, problems) = list.resolve().await;
        assert_eq!(addresses(&found), ["127.0.0.1:7000", "127.0.0.1:9", "new:2"]);
        assert!(problems[0].to_string().contains("one address (host:port) a line"), "{problems:?}");
    }
}
