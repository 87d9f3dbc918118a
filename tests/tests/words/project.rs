//! A compose project of its own for a test: brought up, asked, hurt, and taken down whatever happens.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use brickcast_harness::ignore;
use brickcast_tests::process::binaries;

/// The repository's own files are used as they are; only the programs are those of this build.
pub(crate) struct Project {
    name: String,
    folder: tempfile::TempDir,
    compose: Vec<&'static str>,
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

fn works(program: &str, args: &[&str]) -> bool {
    Command::new(program).args(args).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// `docker-compose` or `docker compose`, or why there is none.
fn compose_program() -> Result<Vec<&'static str>, &'static str> {
    if !works("docker", &["info"]) {
        return Err("no Docker engine answers");
    }
    if works("docker-compose", &["version"]) {
        return Ok(vec!["docker-compose"]);
    }
    if works("docker", &["compose", "version"]) { Ok(vec!["docker", "compose"]) } else { Err("no docker-compose") }
}

pub(crate) fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        output.status.success(),
        "{command:?}: {}\n{}{}",
        output.status,
        text(&output.stdout),
        text(&output.stderr)
    );
    output
}

impl Project {
    /// Named for its purpose. Where there is no Docker, the test is ignored.
    pub(crate) fn new(purpose: &str) -> Self {
        let compose = compose_program().unwrap_or_else(|why| ignore(why));
        let folder = tempfile::tempdir().unwrap();
        for name in ["prebuilt", "out", "scans"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        for program in ["brickcast", "brickcast-node"] {
            std::fs::copy(binaries().join(program), folder.path().join("prebuilt").join(program)).unwrap();
        }
        for file in ["Dockerfile.prebuilt", ".dockerignore", "docker-compose.yml", "docker-compose.gpu.yml"] {
            std::fs::copy(repository().join(file), folder.path().join(file)).unwrap();
        }
        let name = format!("brickcast-test-{}-{purpose}", std::process::id());
        Self { name, folder, compose }
    }

    pub(crate) fn at(&self) -> &Path {
        self.folder.path()
    }

    /// A compose command, ready to run in the project.
    pub(crate) fn compose(&self, args: &[&str]) -> Command {
        let mut command = Command::new(self.compose[0]);
        command.args(&self.compose[1..]).args(args);
        self.settle(&mut command);
        command
    }

    /// Whatever `command` says to compose is about this project.
    pub(crate) fn settle(&self, command: &mut Command) {
        command.current_dir(self.at());
        let uid = String::from_utf8(Command::new("id").arg("-u").output().unwrap().stdout).unwrap();
        for (name, value) in [
            ("COMPOSE_PROJECT_NAME", self.name.as_str()),
            ("NODE_DOCKERFILE", "Dockerfile.prebuilt"),
            ("BRICKCAST_IMAGE", "brickcast:test"),
            ("BRICKCAST_BACKEND", "cpu"),
            ("BRICKCAST_UID", uid.trim()),
            // The programs of this build change often, the classic builder is enough for them.
            ("DOCKER_BUILDKIT", "0"),
            ("COMPOSE_DOCKER_CLI_BUILD", "0"),
        ] {
            command.env(name, value);
        }
    }

    /// `brickcast` in its container.
    pub(crate) fn brickcast(&self, args: &[&str]) -> Command {
        self.compose(&[&["run", "--rm", "brickcast"], args].concat())
    }

    /// Containers of the nodes, in the order of their numbers.
    pub(crate) fn nodes(&self) -> Vec<String> {
        let filters = [
            format!("label=com.docker.compose.project={}", self.name),
            "label=com.docker.compose.service=node".to_owned(),
        ];
        let output = run(Command::new("docker").args([
            "ps",
            "-a",
            "--filter",
            &filters[0],
            "--filter",
            &filters[1],
            "--format",
            "{{.Names}}",
        ]));
        let mut names: Vec<String> = String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect();
        names.sort();
        names
    }

    pub(crate) fn network(&self) -> String {
        format!("{}_cluster", self.name)
    }

    pub(crate) fn inspect(&self, container: &str, format: &str) -> String {
        let output = run(Command::new("docker").args(["inspect", "--format", format, container]));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    pub(crate) fn wait_healthy(&self, container: &str) {
        let started = Instant::now();
        while self.inspect(container, "{{.State.Health.Status}}") != "healthy" {
            assert!(started.elapsed() < Duration::from_secs(60), "{container} does not become healthy");
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}

impl Drop for Project {
    fn drop(&mut self) {
        for container in self.nodes() {
            let _ = Command::new("docker").args(["unpause", &container]).output();
        }
        let down = self.compose(&["down", "--volumes", "--remove-orphans", "--timeout", "2"]).output();
        if let Ok(output) = down
            && !output.status.success()
        {
            eprintln!("{}", String::from_utf8_lossy(&output.stderr));
        }
    }
}

pub(crate) fn docker(args: &[&str]) {
    run(Command::new("docker").args(args));
}

/// A render that goes on in the background.
pub(crate) struct Orbit {
    child: Child,
    out: PathBuf,
}

impl Orbit {
    pub(crate) fn start(mut command: Command, out: PathBuf) -> Self {
        Self { child: command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap(), out }
    }

    /// Waits until the frame is written.
    pub(crate) fn reaches(&mut self, frame: usize) {
        let path = self.out.join(format!("x_{frame:04}.png"));
        let started = Instant::now();
        while !path.is_file() {
            if let Some(status) = self.child.try_wait().unwrap() {
                assert!(path.is_file(), "the render ended before frame {frame}: {status}\n{}", self.said());
            }
            assert!(started.elapsed() < Duration::from_secs(90), "frame {frame} does not come");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn said(&mut self) -> String {
        let mut text = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            let _ = std::io::Read::read_to_string(&mut stderr, &mut text);
        }
        text
    }

    pub(crate) fn finish(self) {
        let output = self.child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
    }
}
