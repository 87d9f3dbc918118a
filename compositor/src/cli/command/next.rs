//! What to try after the demo: lines to paste where one stands.

use std::ffi::OsStr;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

/// Each indented line works as it is: programs by their name only where the shell finds them, a port that is free, the
/// store as it is called from here.
pub(super) fn lines(store: &Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    let paths = std::env::var_os("PATH").unwrap_or_default();
    // A program that cannot be found again was removed meanwhile.
    let own = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("brickcast"));
    let node = own.with_file_name(format!("brickcast-node{}", std::env::consts::EXE_SUFFIX));
    let brickcast = called(&own, &here, &paths);
    let node = if node.is_file() { Some(called(&node, &here, &paths)) } else { on_path("brickcast-node", &paths) };
    // A node has what lies below a folder.
    let (store, above) = (from(store, &here), from(store.parent().unwrap_or(store), &here));
    let mut lines = vec![
        "Next, from this folder:".to_owned(),
        format!("  {brickcast} info {store}"),
        format!("  {brickcast} render {store} -o turn.apng --frames 24 --colormap viridis"),
    ];
    match node {
        Some(node) => {
            let address = format!("127.0.0.1:{}", free_port());
            lines.extend([
                format!("  {node} --listen {address} --data {above} &"),
                format!("  until {node} --health {address}; do sleep 0.2; done"),
                format!("  {brickcast} render {store} -o part.png --nodes {address}"),
                "  kill $!".to_owned(),
            ]);
        }
        None => lines.push(
            "Nodes on other machines are a program of their own, brickcast-node, which is not built yet: `cargo build \
             --release --locked` makes both."
                .to_owned(),
        ),
    }
    lines.push("With a scan of your own:".to_owned());
    lines.push(format!("  {brickcast} render --help"));
    lines.join("\n")
}

/// How the shell runs `program`: by name where that is what it finds, else by its path.
fn called(program: &Path, here: &Path, paths: &OsStr) -> String {
    let name = program.file_name().unwrap_or_default();
    let found = std::env::split_paths(paths).map(|folder| folder.join(name)).find(|path| path.is_file());
    let same = |path: PathBuf| path.canonicalize().ok() == program.canonicalize().ok();
    if found.is_some_and(same) { quoted(Path::new(name)) } else { from(program, here) }
}

fn on_path(name: &str, paths: &OsStr) -> Option<String> {
    let is_there = |folder: PathBuf| folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX)).is_file();
    std::env::split_paths(paths).any(is_there).then(|| name.to_owned())
}

/// Relative where it lies below the folder one stands in.
fn from(path: &Path, here: &Path) -> String {
    match path.strip_prefix(here) {
        Ok(below) if below.components().count() > 1 => quoted(below),
        Ok(below) => quoted(&Path::new(".").join(below)),
        Err(_) => quoted(path),
    }
}

/// In quotes where a shell would read anything else into it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+:@%".contains(c);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// 7001, or the first behind it that nobody has.
fn free_port() -> u16 {
    (7001..7100).find(|&port| TcpListener::bind(("127.0.0.1", port)).is_ok()).unwrap_or(7001)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_are_named_as_the_shell_finds_them() {
        let folder = tempfile::tempdir().unwrap();
        let bin = folder.path().join("bin");
        let program = bin.join("brickcast");
        std::fs::create_dir(&bin).unwrap();
        std::fs::write(&program, "").unwrap();
        let called = |here: &Path, paths: &Path| called(&program, here, paths.as_os_str());
        assert_eq!(called(folder.path(), &bin), "brickcast");
        assert_eq!(called(folder.path(), Path::new("/nowhere")), "bin/brickcast");
        assert_eq!(called(&bin, Path::new("/nowhere")), "./brickcast");
        assert_eq!(called(Path::new("/elsewhere"), Path::new("/nowhere")), program.display().to_string());
        // Another program of that name is not meant.
        let other = folder.path().join("other");
        std::fs::create_dir(&other).unwrap();
        std::fs::write(other.join("brickcast"), "").unwrap();
        assert_eq!(called(folder.path(), &other), "bin/brickcast");
    }

    #[test]
    fn what_a_shell_would_read_otherwise_is_quoted() {
        for (path, want) in
            [("a/b-c_1.2", "a/b-c_1.2"), ("my scans", "'my scans'"), ("it's", r"'it'\''s'"), ("$a", "'$a'")]
        {
            assert_eq!(quoted(Path::new(path)), want);
        }
    }
}
