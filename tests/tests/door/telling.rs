//! What a node tells: its log, its start, and `brickcast nodes`.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use brickcast_node::clients::limits::MAX_QUESTIONS;
use brickcast_node::serve::connections::MAX_CONNECTIONS_EACH;
use brickcast_proto::PROTOCOL_VERSION;
use brickcast_tests::patience::ends;
use brickcast_tests::process::{NodeProcess, binaries, brickcast, brickcast_ok};
use brickcast_tests::{rig, turn};
use serde_json::Value;

use crate::site::{Site, said};

/// A node with its log, on a site.
struct Teller {
    node: NodeProcess,
    log: PathBuf,
}

impl Teller {
    fn start(site: &Site, extra: &[&str]) -> Self {
        let log = site.at().join("node.log");
        let node = NodeProcess::start_logging(site.at(), &[&["--backend", "cpu"], extra].concat(), &log);
        Self { node, log }
    }

    fn text(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap()
    }

    /// Its entries; each is an object with a time and a level.
    fn entries(&self) -> Vec<Value> {
        let text = self.text();
        // The last may be on its way.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        let entries: Vec<Value> = whole.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
        assert!(entries.iter().all(|e| e["timestamp"].is_string() && e["level"].is_string()), "{text}");
        entries
    }

    /// The entries with this message, once there are so many.
    fn told(&self, message: &str, count: usize) -> Vec<Value> {
        let started = Instant::now();
        loop {
            let found: Vec<Value> = self.entries().into_iter().filter(|e| e["message"] == message).collect();
            if found.len() >= count {
                return found;
            }
            assert!(started.elapsed() < Duration::from_secs(20), "no `{message}`: {}", self.text());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Says `bytes` to it, and hears what it answers until it ends.
    fn say(&self, bytes: &[u8]) {
        let mut line = TcpStream::connect(&self.node.address).unwrap();
        line.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        line.write_all(bytes).unwrap();
        let mut answer = Vec::new();
        // A reset is an end as well.
        let _ = line.read_to_end(&mut answer);
    }
}

const HTTP_1: &[u8] = b"GET / HTTP/1.1\r\nHost: node\r\nAccept: everything\r\n\r\n";

fn ask(at: &Path, node: &NodeProcess, extra: &[&str]) -> Output {
    brickcast(at, &[&["nodes", "--nodes", &node.address][..], extra].concat())
}

fn start(at: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut command = Command::new(binaries().join("brickcast-node"));
    // One that starts though it should not would serve for ever.
    ends(command.current_dir(at).args(arguments).envs(variables.iter().copied()), Duration::from_secs(20))
}

/// `tls` as it should be, `foreign` with a client of another authority, `guest` with another token.
fn secured() -> Site {
    let site = Site::new(48);
    let at = site.at();
    for name in ["tls", "other"] {
        brickcast_ok(at, &["tls", "init", name]);
    }
    for (name, files) in [
        ("foreign", [("ca.pem", "tls"), ("client.pem", "other"), ("client.key", "other"), ("token", "tls")]),
        ("guest", [("ca.pem", "tls"), ("client.pem", "tls"), ("client.key", "tls"), ("token", "other")]),
    ] {
        std::fs::create_dir(at.join(name)).unwrap();
        for (file, from) in files {
            std::fs::copy(at.join(from).join(file), at.join(name).join(file)).unwrap();
        }
    }
    site
}

#[test]
fn a_log_has_a_line_for_each_client_store_frame_and_refusal() {
    let _turn = turn(module_path!());
    let site = secured();
    let at = site.at();
    let tls = at.join("tls");
    let teller = Teller::start(&site, &["--tls", tls.to_str().unwrap(), "-v"]);
    site.render(&teller.node, &["--tls", "tls"]);
    let client = &teller.told("client", 1)[0];
    assert!(client["address"].as_str().unwrap().starts_with("127.0.0.1:"), "{client}");
    assert_eq!(client["certificate"], "brickcast client");
    let version = client["version"].as_str().unwrap();
    assert!(version.starts_with(concat!("brickcast/", env!("CARGO_PKG_VERSION"))), "{version}");
    assert_eq!(teller.told("store opened", 1)[0]["store"], "part.store");
    let frame = &teller.told("frame", 1)[0];
    assert_eq!((&frame["view"], &frame["level"]), (&"64x64".into(), &"DEBUG".into()));
    assert!(frame["bricks"].as_u64() > Some(0) && frame["samples"].as_u64() > Some(0), "{frame}");
    assert!(frame["ms"].as_f64() > Some(0.0), "{frame}");
    // A second frame is another client, but not another store.
    site.render(&teller.node, &["--tls", "tls"]);
    assert_eq!(teller.told("client", 2).len(), 2);
    assert_eq!(teller.told("store opened", 1).len(), 1);

    assert!(!ask(at, &teller.node, &["--tls", "guest"]).status.success());
    assert!(!ask(at, &teller.node, &["--tls", "foreign"]).status.success());
    teller.say(HTTP_1);
    let token = &teller.told("refused: wrong token", 1)[0];
    assert_eq!((&token["client"], &token["level"]), (&"127.0.0.1".into(), &"WARN".into()));
    let certificate = &teller.told("refused: certificate", 1)[0];
    let detail = certificate["detail"].as_str().unwrap();
    assert!(detail.contains("UnknownIssuer") || detail.contains("BadSignature"), "{certificate}");
    assert_eq!(teller.told("refused: foreign protocol", 1)[0]["detail"], "not TLS");
    // Whoever reads a log learns no secret.
    let token = std::fs::read_to_string(at.join("tls/token")).unwrap();
    assert!(!teller.text().contains(token.trim()));
}

#[test]
fn a_flood_of_one_refusal_is_summed() {
    let _turn = turn(module_path!());
    let site = secured();
    let token = site.at().join("tls/token");
    let teller = Teller::start(&site, &["--token-file", token.to_str().unwrap()]);
    let started = Instant::now();
    for _ in 0..300 {
        teller.say(HTTP_1);
    }
    assert!(!ask(site.at(), &teller.node, &[]).status.success());
    let none = &teller.told("refused: no token", 1)[0];
    assert_eq!((&none["client"], &none["count"]), (&"127.0.0.1".into(), &1.into()));
    let told = teller.told("refused: foreign protocol", 2);
    assert_eq!((&told[0]["detail"], &told[0]["count"]), (&"HTTP/1".into(), &1.into()));
    let most = 2 + started.elapsed().as_secs() / 10;
    assert!((told.len() as u64) <= most, "{} lines", told.len());
    let sum: u64 = teller.told("refused: foreign protocol", 2).iter().map(|e| e["count"].as_u64().unwrap()).sum();
    assert!(sum <= 300 && (sum == 300 || told.len() > 2), "{told:?}");
    // Frames are told only to whoever wants to know more.
    site.render(&teller.node, &["--token-file", "tls/token"]);
    assert!(teller.entries().iter().all(|entry| entry["message"] != "frame"));
}

/// A question of which only the head comes: it keeps its place.
fn question(agent: &str) -> http::Request<()> {
    let question = http::Request::post("http://node/brickcast.v1.Cluster/Describe");
    let question = question.header("content-type", "application/grpc").header("te", "trailers");
    question.header("user-agent", agent).body(()).unwrap()
}

/// A client of another protocol finds out by itself and leaves; both ends are to know why.
#[test]
fn limits_that_are_reached_and_clients_of_another_protocol_are_told() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let teller = Teller::start(&site, &[]);
    rig::run(async {
        let tcp = tokio::net::TcpStream::connect(&teller.node.address).await.unwrap();
        let (mut send, connection) = h2::client::handshake(tcp).await.unwrap();
        tokio::spawn(connection);
        let theirs = format!("brickcast/0.0.1 brickcast.v1/{}", PROTOCOL_VERSION - 1);
        let ask = |_| send.send_request(question(&theirs), false).unwrap();
        let held: Vec<_> = (0..=MAX_QUESTIONS).map(ask).collect();
        assert_eq!(teller.told("client", 1)[0]["version"], theirs.as_str());
        let foreign = &teller.told("refused: foreign protocol", 1)[0];
        let detail = format!("protocol {}, this node has {PROTOCOL_VERSION}", PROTOCOL_VERSION - 1);
        assert_eq!((&foreign["detail"], &foreign["count"]), (&detail.into(), &1.into()));
        let many = &teller.told("refused: more questions than one client may have", 1)[0];
        let want = (&"127.0.0.1".into(), &1.into(), &"WARN".into());
        assert_eq!((&many["client"], &many["count"], &many["level"]), want);
        drop(held);
    });
    let crowd: Vec<_> = (0..=MAX_CONNECTIONS_EACH).map(|_| TcpStream::connect(&teller.node.address).unwrap()).collect();
    let many = &teller.told("refused: more connections than one client may have open", 1)[0];
    assert_eq!((&many["client"], &many["level"]), (&"127.0.0.1".into(), &"WARN".into()));
    drop(crowd);
}

#[test]
fn a_log_for_people_is_no_json_and_one_that_is_quiet_is_empty() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let teller = Teller::start(&site, &["--log", "text"]);
    site.render(&teller.node, &[]);
    let text = teller.text();
    assert!(text.contains("client address=\"127.0.0.1:") && !text.contains(['{', '\x1b']), "{text}");
    drop(teller);
    let teller = Teller::start(&site, &["--quiet"]);
    site.render(&teller.node, &[]);
    teller.say(HTTP_1);
    assert_eq!(teller.text(), "");
}

#[test]
fn a_node_whose_certificate_does_not_hold_does_not_start() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let at = site.at();
    for (name, days) in [("ended", "-2"), ("soon", "20"), ("tls", "365")] {
        brickcast_ok(at, &["tls", "init", name, "--days", days]);
    }
    let output = start(at, &["--listen", "127.0.0.1:0", "--data", ".", "--tls", "ended", "--log", "text"], &[]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for word in ["ended/node.pem", "it ended on 20", "brickcast tls init"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert_eq!(text.matches("it ended on").count(), 1, "told once: {text}");
    // The authority's alone.
    std::fs::copy(at.join("ended/ca.pem"), at.join("tls/ca.pem")).unwrap();
    let output = start(at, &["--listen", "127.0.0.1:0", "--data", ".", "--tls", "tls"], &[]);
    assert!(output.status.code() == Some(1) && said(&output).contains("tls/ca.pem"), "{}", said(&output));

    let folder = at.join("soon");
    let teller = Teller::start(&site, &["--tls", folder.to_str().unwrap(), "--log", "text"]);
    let started = Instant::now();
    while !teller.text().contains("node.pem: it ends on 20") {
        assert!(started.elapsed() < Duration::from_secs(20), "{}", teller.text());
        std::thread::sleep(Duration::from_millis(50));
    }
    let output = ask(at, &teller.node, &["--tls", "soon", "--json"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && error.contains("client.pem: it ends on 20") && error.contains(" days"),
        "{error}"
    );
    assert_eq!(error.matches("it ends on").count(), 1, "told once, also of the authority: {error}");
    let list: Value = serde_json::from_slice(&output.stdout).unwrap();
    let days = list[0]["certificate_days"].as_i64();
    assert!(matches!(days, Some(19 | 20)), "{days:?}");
}

#[test]
fn nodes_lists_why_and_what_became_of_them() {
    let _turn = turn(module_path!());
    let site = secured();
    let at = site.at();
    let secure = site.node(&["--tls", "tls"]);
    let guarded = site.node(&["--token-file", "tls/token"]);
    let ask_json = |nodes: &str, extra: &[&str]| -> Vec<Value> {
        let output = brickcast(at, &[&["nodes", "--json", "--nodes", nodes][..], extra].concat());
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let both = format!("{},127.0.0.1:1,{}", secure.address, guarded.address);
    let reasons: Vec<Value> = ask_json(&both, &["--tls", "guest"]).into_iter().map(|n| n["reason"].clone()).collect();
    assert_eq!(reasons, ["refused: token", "unreachable: connection refused", "foreign protocol: no TLS"]);
    assert_eq!(ask_json(&secure.address, &["--tls", "foreign"])[0]["reason"], "refused: certificate");
    assert_eq!(ask_json(&secure.address, &[])[0]["reason"], "foreign protocol, or TLS");
    assert_eq!(ask_json(&guarded.address, &[])[0]["reason"], "refused: token");
    // For people too, and the whole reason once.
    let output = brickcast(at, &["nodes", "--nodes", "127.0.0.1:1"]);
    let text = said(&output);
    assert_eq!(text.matches("refused").count(), 2, "the row, and the error: {text}");
    assert!(text.contains("unreachable: connection refused") && text.contains("is brickcast-node running"), "{text}");

    let ask = || ask_json(&guarded.address, &["--token-file", "tls/token"]).remove(0);
    let before = ask();
    assert_eq!((&before["frames"], &before["last_error"]), (&0.into(), &Value::Null));
    assert_eq!(before["certificate_days"], Value::Null);
    assert!(before["commit"].as_str().is_some_and(|commit| !commit.is_empty()), "{before}");
    site.render(&guarded, &["--token-file", "tls/token"]);
    let after = ask();
    assert_eq!(after["frames"], 1);
    assert!(after["uptime_s"].as_f64() > before["uptime_s"].as_f64(), "{after}");
    // A disk that loses a file.
    brickcast_ok(at, &["prepare", "part.nrrd", "broken.store", "--brick", "16"]);
    std::fs::write(at.join("broken.store/bricks.bin"), "gone").unwrap();
    let client = at.join("client");
    std::fs::create_dir(&client).unwrap();
    let token = at.join("tls/token");
    let render = ["render", "broken.store", "-o", "x.png", "--nodes", &guarded.address, "--token-file"];
    let output = brickcast(&client, &[&render[..], &[token.to_str().unwrap()]].concat());
    assert!(!output.status.success());
    let broken = ask();
    assert!(broken["last_error"].as_str().is_some_and(|error| error.contains("broken.store")), "{broken}");
    assert!(broken["last_error_s"].as_f64().is_some_and(|age| age < 60.0), "{broken}");
    let table = brickcast_ok(at, &["nodes", "--nodes", &guarded.address, "--token-file", "tls/token"]);
    assert!(table.contains("last error, ") && table.contains("ago: "), "{table}");
}

#[test]
fn a_nodes_flags_come_from_a_file_and_from_variables_too() {
    let _turn = turn(module_path!());
    let site = Site::new(32);
    let at = site.at();
    std::fs::create_dir(at.join("etc")).unwrap();
    let file = at.join("etc/node.toml");
    std::fs::write(&file, "throttle = 4\nmemory_budget = '64MiB'\nbackend = 'cpu'\nlog = 'text'\n").unwrap();
    let config = file.to_str().unwrap();
    let variables = [("BRICKCAST_NODE_CONFIG", config), ("BRICKCAST_NODE_THROTTLE", "3"), ("BRICKCAST_NODE_LOG", "")];
    // Of 64 MiB an eighth is for decoded chunks.
    let told = |node: &NodeProcess| {
        let json = brickcast_ok(at, &["nodes", "--nodes", &node.address, "--json"]);
        let node = serde_json::from_str::<Value>(&json).unwrap()[0].clone();
        (node["throttle"].as_f64().unwrap(), node["memory_budget"].as_u64().unwrap() >> 20, node["backend"].clone())
    };
    let node = NodeProcess::start(at, &["--config", config]);
    assert_eq!(told(&node), (4.0, 56, "cpu".into()), "the file");
    let node = NodeProcess::start_with(at, &[], &variables);
    assert_eq!(told(&node), (3.0, 56, "cpu".into()), "a variable above it");
    let node = NodeProcess::start_with(at, &["--throttle", "2"], &variables);
    assert_eq!(told(&node), (2.0, 56, "cpu".into()), "a flag above both");
    // Relative to the file, and nothing else is needed.
    std::fs::write(&file, "data = '../no-such-folder'\nlisten = '127.0.0.1:0'\n").unwrap();
    let output = start(at, &["--config", config, "--log", "text"], &[]);
    assert!(output.status.code() == Some(1) && said(&output).contains("etc/../no-such-folder"), "{}", said(&output));
    std::fs::write(&file, "listen = '127.0.0.1:0'\n\nthrotle = 2\n").unwrap();
    let output = start(at, &["--config", config], &[]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("node.toml:3: there is no `throtle`"), "{}", said(&output));
    // A probe beside the settings of the node that it asks.
    let variables = [("BRICKCAST_NODE_DATA", "."), ("BRICKCAST_NODE_LISTEN", "0.0.0.0:7000")];
    assert_eq!(start(at, &["--health", &node.address], &variables).status.code(), Some(0));
    assert_eq!(start(at, &["--listen", "127.0.0.1:0"], &[]).status.code(), Some(2), "no data");
}

#[test]
fn both_programs_tell_the_commit_that_they_were_built_from() {
    let folder = tempfile::tempdir().unwrap();
    let own = said(&start(folder.path(), &["--version"], &[]));
    let version = brickcast_ok(folder.path(), &["--version"]);
    let (version, own) = (version.trim(), own.trim());
    let protocol = brickcast_proto::PROTOCOL_VERSION;
    let begin = format!("brickcast {} (protocol {protocol}), commit ", env!("CARGO_PKG_VERSION"));
    let commit = version.strip_prefix(&begin).unwrap_or_else(|| panic!("{version}"));
    assert_eq!(own, version.replacen("brickcast", "brickcast-node", 1));
    // `0123abc of 2026-11-30`, perhaps `or later`, or `unknown`.
    let is_known = commit.split(' ').next().is_some_and(|hash| hash.bytes().all(|b| b.is_ascii_hexdigit()));
    assert!(is_known && commit.contains(" of 20") || commit.starts_with("unknown"), "{version}");
}
