//! Settings: flag over environment over configuration file over default, told by `brickcast config` and obeyed by the
//! others.

use std::path::Path;
use std::process::{Command, Output};

use brickcast_tests::process::{brickcast_command, brickcast_ok};
use serde_json::Value;

/// A folder with a configuration file in another folder.
struct Site(tempfile::TempDir);

impl Site {
    fn new(config: &str) -> Self {
        let site = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(site.at().join("etc")).unwrap();
        site.configure(config);
        site
    }

    fn at(&self) -> &Path {
        self.0.path()
    }

    fn configure(&self, text: &str) {
        std::fs::write(self.at().join("etc/c.toml"), text).unwrap();
    }

    /// `brickcast` without any setting but those of `variables`.
    fn command(&self, variables: &[(&str, &str)], args: &[&str]) -> Command {
        let mut command = brickcast_command(self.at());
        command.env_remove("BRICKCAST_CACHE_DIR").env("XDG_CACHE_HOME", self.at().join("users"));
        command.envs(variables.iter().copied()).args(args);
        command
    }

    fn run(&self, variables: &[(&str, &str)], args: &[&str]) -> Output {
        self.command(variables, args).output().unwrap()
    }

    fn told(&self, variables: &[(&str, &str)], args: &[&str]) -> Value {
        let output = self.run(variables, &[&["config", "--json"], args].concat());
        assert!(output.status.success(), "{}", error(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn part(&self) {
        brickcast_ok(self.at(), &["phantom", "part.nrrd", "--dims", "40,40,40", "--pores", "1"]);
    }
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const FILE: [&str; 2] = ["--config", "etc/c.toml"];
const RENDER: [&str; 6] = ["render", "part.nrrd", "-o", "x.png", "--size", "32x32"];

#[test]
fn each_value_is_told_with_where_it_came_from() {
    let site = Site::new(
        "nodes = [\"a:1\", \"file:list\"]\ntls = \"tls\"\ntoken_file = \"t\"\ncache_dir = \"/c\"\n\
         cache_size = \"9G\"\ndeadline = \"2s\"\nbackend = \"cpu\"\nmemory_budget = \"1GiB\"\n",
    );
    let check = |told: &Value, key: &str, value: Value, source: &str, from: &str| {
        let got = &told["settings"][key];
        assert!(got["value"] == value && got["source"] == source, "{key}: {got}");
        assert!(got["from"].as_str().unwrap_or_default().contains(from), "{key}: {got}");
    };
    let told = site.told(&[], &[]);
    assert_eq!(told["file"], Value::Null);
    check(&told, "nodes", Value::from(Vec::<String>::new()), "default", "");
    check(&told, "tls", Value::Null, "default", "");
    check(&told, "token_file", Value::Null, "default", "");
    check(&told, "deadline", "30s".into(), "default", "");
    check(&told, "cache_size", "50GiB".into(), "default", "");
    check(&told, "cache_dir", site.at().join("users/brickcast").to_str().unwrap().into(), "default", "");

    let told = site.told(&[], &FILE);
    assert_eq!(told["file"], "etc/c.toml");
    check(&told, "nodes", vec!["a:1", "file:etc/list"].into(), "file", "etc/c.toml:1");
    check(&told, "tls", "etc/tls".into(), "file", "etc/c.toml:2");
    check(&told, "token_file", "etc/t".into(), "file", "etc/c.toml:3");
    check(&told, "cache_dir", "/c".into(), "file", "etc/c.toml:4");
    check(&told, "cache_size", "9G".into(), "file", "etc/c.toml:5");
    check(&told, "deadline", "2s".into(), "file", "etc/c.toml:6");
    check(&told, "backend", "cpu".into(), "file", "etc/c.toml:7");
    check(&told, "memory_budget", "1GiB".into(), "file", "etc/c.toml:8");

    let variables = [
        ("BRICKCAST_CONFIG", "etc/c.toml"),
        ("BRICKCAST_NODES", "b:1,b:2"),
        ("BRICKCAST_TLS", "etls"),
        ("BRICKCAST_TOKEN_FILE", "et"),
        ("BRICKCAST_CACHE_DIR", "ec"),
        ("BRICKCAST_CACHE_SIZE", "8G"),
    ];
    let told = site.told(&variables, &[]);
    check(&told, "nodes", vec!["b:1", "b:2"].into(), "environment", "BRICKCAST_NODES");
    check(&told, "tls", "etls".into(), "environment", "BRICKCAST_TLS");
    check(&told, "token_file", "et".into(), "environment", "BRICKCAST_TOKEN_FILE");
    check(&told, "cache_dir", "ec".into(), "environment", "BRICKCAST_CACHE_DIR");
    check(&told, "cache_size", "8G".into(), "environment", "BRICKCAST_CACHE_SIZE");
    check(&told, "deadline", "2s".into(), "file", "etc/c.toml:6");

    let mut flags =
        vec!["--nodes", "c:1", "--tls", "ftls", "--token-file", "ft", "--cache-dir", "fc", "--deadline", "9s"];
    flags.extend(["--cache-size", "7G"]);
    let told = site.told(&variables, &flags);
    check(&told, "cache_size", "7G".into(), "flag", "--cache-size");
    check(&told, "nodes", vec!["c:1"].into(), "flag", "--nodes");
    check(&told, "tls", "ftls".into(), "flag", "--tls");
    check(&told, "token_file", "ft".into(), "flag", "--token-file");
    check(&told, "cache_dir", "fc".into(), "flag", "--cache-dir");
    check(&told, "deadline", "9s".into(), "flag", "--deadline");
    check(&told, "memory_budget", "1GiB".into(), "file", "etc/c.toml:8");

    // Set to nothing is not set; the token is the folder's.
    let told = site.told(&[("BRICKCAST_NODES", ""), ("BRICKCAST_CONFIG", ""), ("BRICKCAST_TLS", "x")], &[]);
    check(&told, "nodes", Value::from(Vec::<String>::new()), "default", "");
    check(&told, "token_file", "x/token".into(), "default", "");
}

/// Nothing listens on these ports, so that the errors say which were tried.
#[test]
fn nodes_and_certificates_are_taken_from_flag_environment_and_file_in_this_order() {
    let site = Site::new("nodes = \"127.0.0.1:1\"\n");
    site.part();
    let (variable, flag) = ([("BRICKCAST_NODES", "127.0.0.1:2")], ["--nodes", "127.0.0.1:3"]);
    for command in [&["nodes"][..], &RENDER] {
        let tried = |variables: &[(&str, &str)], more: &[&str], one: &str| {
            let output = site.run(variables, &[command, &FILE, more].concat());
            let error = error(&output);
            assert_eq!(output.status.code(), Some(1), "{error}");
            let ports = ["127.0.0.1:1", "127.0.0.1:2", "127.0.0.1:3"].into_iter().filter(|port| error.contains(port));
            assert_eq!(ports.collect::<Vec<_>>(), [one], "{error}");
        };
        tried(&[], &[], "127.0.0.1:1");
        tried(&variable, &[], "127.0.0.1:2");
        tried(&variable, &flag, "127.0.0.1:3");
    }
    site.configure("nodes = \"127.0.0.1:1\"\ntls = \"from-file\"\n");
    for (variables, more, folder) in [
        (&[][..], &[][..], "etc/from-file"),
        (&[("BRICKCAST_TLS", "from-variable")], &[], "from-variable"),
        (&[("BRICKCAST_TLS", "from-variable")], &["--tls", "from-flag"], "from-flag"),
    ] {
        let error = error(&site.run(variables, &[&["nodes"], &FILE[..], more].concat()));
        assert!(error.contains(&format!("{folder}/ca.pem")), "{folder}: {error}");
    }
    let output = site.run(&[], &["nodes"]);
    let error = error(&output);
    assert!(
        output.status.code() == Some(2) && error.contains("--nodes") && error.contains("BRICKCAST_NODES"),
        "{error}"
    );
}

#[test]
fn cache_deadline_and_backend_are_taken_from_the_file_unless_a_flag_says_otherwise() {
    let site = Site::new("cache_dir = \"file-cache\"\nbackend = \"cpu\"\n");
    site.part();
    let render = |variables: &[(&str, &str)], more: &[&str]| site.run(variables, &[&RENDER, &FILE[..], more].concat());
    let cached = |folder: &str| std::fs::read_dir(site.at().join(folder)).is_ok_and(|mut list| list.next().is_some());
    assert!(render(&[], &[]).status.success());
    assert!(cached("etc/file-cache") && !cached("users"));
    let manifest: Value = serde_json::from_slice(&std::fs::read(site.at().join("x.png.json")).unwrap()).unwrap();
    assert_eq!(manifest["nodes"][0]["backend"], "cpu");
    let variable = [("BRICKCAST_CACHE_DIR", "variable-cache")];
    assert!(render(&variable, &[]).status.success() && cached("variable-cache") && !cached("flag-cache"));
    assert!(render(&variable, &["--cache-dir", "flag-cache"]).status.success() && cached("flag-cache"));
    let demo = ["demo", "--dims", "32,32,32", "--size", "32x32", "-o", "d.png"];
    assert!(site.run(&[], &[&demo, &FILE[..]].concat()).status.success());
    let made = std::fs::read_dir(site.at().join("etc/file-cache")).unwrap();
    assert!(made.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("demo-")));

    // Not even an empty frame is complete within a nanosecond.
    site.configure("cache_dir = \"file-cache\"\nbackend = \"cpu\"\ndeadline = \"1ns\"\n");
    assert_eq!(render(&[], &[]).status.code(), Some(3));
    assert!(render(&[], &["--deadline", "60s"]).status.success());
}

/// Whoever has nodes in the environment or in the file can still render here.
#[test]
fn local_nodes_rule_out_nodes_of_environment_and_file() {
    let site = Site::new("nodes = [\"127.0.0.1:1\"]\n");
    site.part();
    let elsewhere = [("BRICKCAST_NODES", "127.0.0.1:2")];
    for variables in [&[][..], &elsewhere] {
        let inside = ["--local", "2", "--backend", "cpu", "--memory-budget", "1GiB"];
        let output = site.run(variables, &[&RENDER, &FILE[..], &inside].concat());
        assert!(output.status.success(), "{}", error(&output));
        let told = site.told(variables, &[&FILE[..], &inside].concat());
        let nodes = &told["settings"]["nodes"];
        assert!(nodes["value"] == Value::Array(Vec::new()) && nodes["from"] == "--local", "{nodes}");
    }
    // What is only for nodes inside this process does not silently send them away, nor is it silently dropped.
    let conflict = |variables: &[(&str, &str)], more: &[&str], words: &[&str]| {
        let output = site.run(variables, &[&RENDER, more].concat());
        let error = error(&output);
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    conflict(&elsewhere, &["--backend", "cpu"], &["--backend", "BRICKCAST_NODES", "127.0.0.1:2", "--local"]);
    conflict(&[], &["--memory-budget", "1GiB", FILE[0], FILE[1]], &["--memory-budget", "etc/c.toml:1", "--local"]);
    conflict(&elsewhere, &["--nodes", "127.0.0.1:3", "--local", "2"], &["--nodes", "--local"]);
    conflict(&[], &["--nodes", "127.0.0.1:3", "--backend", "cpu"], &["--nodes", "--backend"]);
}

#[test]
fn a_file_that_is_wrong_stops_every_command_with_file_and_line() {
    let site = Site::new("deadline = \"2s\"\ndedline = \"3s\"\n");
    for command in [&["config"][..], &["render", "none", "-o", "x.png"], &["nodes"], &["info", "none"]] {
        let output = site.run(&[], &[command, &FILE].concat());
        let error = error(&output);
        assert_eq!(output.status.code(), Some(2), "{command:?}: {error}");
        for word in ["etc/c.toml:2", "dedline", "deadline", "token_file"] {
            assert!(error.contains(word), "{command:?} does not say {word}: {error}");
        }
    }
    site.configure("backend = 3\n");
    let output = site.run(&[("BRICKCAST_CONFIG", "etc/c.toml")], &["config"]);
    assert!(output.status.code() == Some(2) && error(&output).contains("etc/c.toml:1"), "{}", error(&output));
    let output = site.run(&[], &["config", "--config", "etc/none.toml"]);
    assert!(output.status.code() == Some(2) && error(&output).contains("etc/none.toml"), "{}", error(&output));
}

#[test]
fn the_users_own_file_is_found() {
    let site = Site::new("");
    let place = |base: &str, deadline: &str| {
        std::fs::create_dir_all(site.at().join(base).join("brickcast")).unwrap();
        let text = format!("deadline = \"{deadline}\"\n");
        std::fs::write(site.at().join(base).join("brickcast/config.toml"), text).unwrap();
    };
    place("home/.config", "7s");
    place("xdg", "8s");
    let deadline = |xdg: Option<&str>, args: &[&str]| {
        let mut command = site.command(&[], &[&["config", "--json"], args].concat());
        command.env("HOME", site.at().join("home")).env_remove("XDG_CONFIG_HOME");
        if let Some(folder) = xdg {
            command.env("XDG_CONFIG_HOME", site.at().join(folder));
        }
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", error(&output));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        told["settings"]["deadline"]["value"].as_str().unwrap().to_owned()
    };
    assert_eq!(deadline(None, &[]), "7s");
    assert_eq!(deadline(Some("xdg"), &[]), "8s");
    // Only one file is read.
    assert_eq!(deadline(Some("xdg"), &FILE), "30s");
    assert_eq!(deadline(Some("nothing-there"), &[]), "30s");
}

#[test]
fn secrets_are_not_shown() {
    let site = Site::new("tls = \"../tls\"\n");
    brickcast_ok(site.at(), &["tls", "init", "tls"]);
    let token = std::fs::read_to_string(site.at().join("tls/token")).unwrap();
    for args in [&["config"][..], &["config", "--json"], &["-vv", "config"]] {
        let output = site.run(&[("BRICKCAST_NODES", "a:1")], &[args, &FILE].concat());
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(said.contains("tls/token"), "{said}");
        assert!(!said.contains(token.trim()) && !said.contains("PRIVATE"), "{said}");
    }
}
