//! A real S3 server for tests: moto's, from PyPI, which checks signatures.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use brickcast_harness::ignore;
use serde_json::Value;

/// A running server, with the buckets `scans` and `other`; ended when dropped.
#[derive(Debug)]
pub struct S3Server {
    child: Child,
    /// `http://127.0.0.1:PORT`
    pub address: String,
    key: String,
    pub secret: String,
    region: String,
}

impl S3Server {
    /// With the files of `folder` as objects of both buckets. Where Python lacks the server, the test is ignored.
    ///
    /// # Panics
    /// It does not start.
    #[must_use]
    pub fn start(folder: &Path) -> Self {
        let mut probe = Command::new("python3");
        let probe = probe.args(["-c", "import boto3, moto.server"]).stderr(Stdio::null()).status();
        if !probe.is_ok_and(|status| status.success()) {
            ignore("python3 with moto[server] is missing: pip install 'moto[server]'");
        }
        let mut python = Command::new("python3");
        python.args(["-c", include_str!("s3_server.py")]).arg(folder);
        let pipes = python.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = pipes.spawn().expect("python3 runs");
        // What it says of its start comes first.
        let lines = BufReader::new(child.stdout.take().expect("a pipe")).lines().map_while(Result::ok);
        let told =
            lines.filter(|line| line.starts_with('{')).find_map(|line| serde_json::from_str::<Value>(&line).ok());
        let told = told.expect("the server says where it listens");
        let of = |name: &str| told[name].as_str().expect("a text").to_owned();
        Self { child, address: of("address"), key: of("key"), secret: of("secret"), region: of("region") }
    }

    /// What a program must know to read from it, at `address`: the server's own, or a proxy's before it.
    #[must_use]
    pub fn variables<'a>(&'a self, address: &'a str) -> [(&'static str, &'a str); 5] {
        [
            ("AWS_ENDPOINT_URL", address),
            ("AWS_ACCESS_KEY_ID", &self.key),
            ("AWS_SECRET_ACCESS_KEY", &self.secret),
            ("AWS_REGION", &self.region),
            ("AWS_ALLOW_HTTP", "true"),
        ]
    }
}

impl Drop for S3Server {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
