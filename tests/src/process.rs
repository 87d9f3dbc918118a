//! The project's binaries as processes: nodes that listen on ports of their own, and the command line.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use brickcast_harness::{ignore, leave_out};

/// The folder that holds the built binaries. `cargo test --workspace` builds no binaries of other packages, so the
/// first caller builds them.
///
/// # Panics
/// The build fails.
#[must_use]
pub fn binaries() -> PathBuf {
    static BUILT: std::sync::OnceLock<PathBuf> = std::sync::OnceLock::new();
    BUILT
        .get_or_init(|| {
            let test = std::env::current_exe().expect("the test's own path");
            let folder = test.parent().and_then(Path::parent).expect("target/<profile>/deps/<test>").to_path_buf();
            let mut build = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
            // With the program that runs, and of the whole workspace: otherwise dependencies would have other features
            // than the tests' (of tokio, for one), and half of the tree would be built again.
            let program = test.file_stem().and_then(|name| name.to_str()?.rsplit_once('-')).expect("<test>-<hash>").0;
            build.args(["build", "--quiet", "--workspace", "--bins", "--test", program]);
            build.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
            build.env("CARGO_TARGET_DIR", folder.parent().expect("target"));
            // Cargo tells tests about their package; build scripts that read that would all run again.
            for (name, _) in std::env::vars_os() {
                if name.to_str().is_some_and(|n| n.starts_with("CARGO_PKG_") || n.starts_with("CARGO_MANIFEST_")) {
                    build.env_remove(name);
                }
            }
            if folder.ends_with("release") {
                build.arg("--release");
            }
            assert!(build.status().expect("cargo runs").success(), "the binaries do not build");
            folder
        })
        .clone()
}

/// `brickcast` in `folder`, its cache there too, untouched by the settings of whoever runs the tests.
#[must_use]
pub fn brickcast_command(folder: &Path) -> Command {
    let mut command = Command::new(binaries().join("brickcast"));
    for name in ["RUST_LOG", "BRICKCAST_CONFIG", "BRICKCAST_NODES", "BRICKCAST_TLS", "BRICKCAST_TOKEN_FILE"] {
        command.env_remove(name);
    }
    command.env_remove("BRICKCAST_CACHE_SIZE");
    for (name, _) in std::env::vars_os().filter(|(name, _)| name.to_str().is_some_and(|n| n.starts_with("AWS_"))) {
        command.env_remove(name);
    }
    command.env("XDG_CONFIG_HOME", folder.join("no-configuration"));
    command.current_dir(folder).env("BRICKCAST_CACHE_DIR", folder.join("cache"));
    command
}

/// `brickcast` with arguments; its cache stays in `folder`.
#[must_use]
pub fn brickcast(folder: &Path, args: &[&str]) -> Output {
    brickcast_command(folder).args(args).output().expect("brickcast runs")
}

/// As [`brickcast`], and it must have ended well.
///
/// # Panics
/// Another exit code than 0.
pub fn brickcast_ok(folder: &Path, args: &[&str]) -> String {
    brickcast_both(folder, args).0
}

/// As [`brickcast_ok`]: its results (stdout), and what it says beside them (stderr).
///
/// # Panics
/// As [`brickcast_ok`].
pub fn brickcast_both(folder: &Path, args: &[&str]) -> (String, String) {
    let output = brickcast(folder, args);
    let [results, talk] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{args:?}: {}\n{talk}", output.status);
    (results, talk)
}

/// The stores in a cache folder; there are none where there is no folder.
///
/// # Panics
/// An entry that cannot be looked at.
#[must_use]
pub fn cached_stores(cache: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(cache).into_iter().flatten().map(|entry| entry.expect("an entry").path());
    let mut stores: Vec<_> = entries.filter(|path| path.join("brickcast.json").is_file()).collect();
    stores.sort();
    stores
}

/// A running `brickcast-node`, killed when dropped.
#[derive(Debug)]
pub struct NodeProcess {
    child: Child,
    pub address: String,
}

impl NodeProcess {
    /// Starts a node on a free loopback port and waits until it listens.
    ///
    /// # Panics
    /// It does not say within 30 s where it listens.
    #[must_use]
    pub fn start(data: &Path, extra: &[&str]) -> Self {
        Self::start_at(data, "127.0.0.1:0", extra)
    }

    /// As [`NodeProcess::start`], with variables of the environment.
    ///
    /// # Panics
    /// As [`NodeProcess::start`].
    #[must_use]
    pub fn start_with(data: &Path, extra: &[&str], variables: &[(&str, &str)]) -> Self {
        let mut command = Command::new(binaries().join("brickcast-node"));
        command.envs(variables.iter().copied());
        Self::listening(command, data, "127.0.0.1:0", extra)
    }

    /// As [`NodeProcess::start`]; what it says on stderr goes into a file.
    ///
    /// # Panics
    /// As [`NodeProcess::start`], and where the file cannot be written.
    #[must_use]
    pub fn start_logging(data: &Path, extra: &[&str], log: &Path) -> Self {
        let mut command = Command::new(binaries().join("brickcast-node"));
        command.env_remove("RUST_LOG").stderr(std::fs::File::create(log).expect("a file for the log"));
        Self::listening(command, data, "127.0.0.1:0", extra)
    }

    /// As [`NodeProcess::start`], on a port that the test chose, e.g. of a node that died.
    ///
    /// # Panics
    /// As [`NodeProcess::start`].
    #[must_use]
    pub fn start_at(data: &Path, listen: &str, extra: &[&str]) -> Self {
        Self::listening(Command::new(binaries().join("brickcast-node")), data, listen, extra)
    }

    /// As [`NodeProcess::start`], on these cores of the machine only.
    ///
    /// # Panics
    /// As [`NodeProcess::start`].
    #[must_use]
    pub fn start_on(data: &Path, extra: &[&str], cores: &str) -> Self {
        let mut command = Command::new("taskset");
        command.args(["-c", cores]).arg(binaries().join("brickcast-node"));
        Self::listening(command, data, "127.0.0.1:0", extra)
    }

    fn listening(mut command: Command, data: &Path, listen: &str, extra: &[&str]) -> Self {
        command.args(["--listen", listen, "--data"]).arg(data).args(extra);
        let mut child = command.stdout(Stdio::piped()).spawn().expect("brickcast-node runs");
        let stdout = child.stdout.take().expect("a pipe");
        let (send, receive) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if let Some(address) = line.strip_prefix("listening on ") {
                    send.send(address.trim().to_owned()).ok();
                }
            }
        });
        let address = receive.recv_timeout(Duration::from_secs(30));
        if address.is_err() {
            child.kill().ok();
        }
        Self { address: address.expect("the node says where it listens"), child }
    }

    pub fn kill(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }

    /// Sends SIGTERM and waits for the exit code.
    ///
    /// # Panics
    /// It does not end within 15 s.
    pub fn terminate(&mut self) -> Option<i32> {
        Command::new("kill").arg(self.child.id().to_string()).status().expect("kill runs");
        self.wait()
    }

    /// The process's number.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for the exit code; `None` where a signal ended it.
    ///
    /// # Panics
    /// It does not end within 15 s.
    pub fn wait(&mut self) -> Option<i32> {
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status.code();
            }
            assert!(started.elapsed() < Duration::from_secs(15), "the node does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for NodeProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A file of the real volumes beside the project. Where it is missing, the test is ignored.
#[must_use]
pub fn shared_data(name: &str) -> PathBuf {
    find_shared_data(name).unwrap_or_else(|why| ignore(why))
}

/// As [`shared_data`], for tests that try something else, too: where it is missing, the test is ignored in part.
#[must_use]
pub fn shared_data_too(name: &str) -> Option<PathBuf> {
    find_shared_data(name).inspect_err(|why| leave_out(why)).ok()
}

fn find_shared_data(name: &str) -> Result<PathBuf, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if path.is_file() { Ok(path) } else { Err(format!("../shared/data/{name} is missing")) }
}
