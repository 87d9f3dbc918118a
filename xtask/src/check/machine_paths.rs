//! The repository must work on any machine: no path or package mirror of the one it was written on.

use super::law::Check;
use crate::tree::SourceFile;

pub(super) const CHECK: Check = Check {
    name: "machine-paths",
    law: "no tracked file names a folder or a package mirror of one machine",
    remedy: "use paths relative to the repository, temporary folders from the system, and the registries' defaults",
    run: |tree| Ok(tree.files.iter().flat_map(problems).collect()),
};

/// Absolute folders that mean one machine, put together here so that this file does not contain them.
const FOLDERS: [&str; 4] = [concat!("/wo", "rk/"), concat!("/ro", "ot/"), concat!("/tm", "p/"), concat!("/ho", "me/")];

/// What points package managers somewhere else.
const MIRRORS: [&str; 7] = [
    concat!("replace", "-with"),
    concat!("CARGO_", "REGISTRIES_"),
    concat!("--index", "-url"),
    concat!("--extra-index", "-url"),
    concat!("PIP_", "INDEX_URL"),
    concat!("PIP_EXTRA_", "INDEX_URL"),
    concat!("GO", "PROXY"),
];

fn problems(file: &SourceFile) -> Vec<String> {
    let mut problems = Vec::new();
    for (number, line) in file.text.lines().enumerate() {
        let at = |what: &str| format!("{}:{}: {what}", file.path, number + 1);
        problems.extend(FOLDERS.iter().filter(|f| names_folder(line, f)).map(|f| at(f)));
        problems.extend(MIRRORS.iter().filter(|m| line.contains(*m)).map(|m| at(m)));
        let registry = line.trim_start().strip_prefix("source = \"registry+");
        if file.name() == "Cargo.lock"
            && registry.is_some_and(|r| !r.starts_with("https://github.com/rust-lang/crates.io-index"))
        {
            problems.push(at("a registry other than crates.io"));
        }
    }
    problems
}

/// True where the folder starts a path; `../x/` and `$HOME/x/` are other folders.
fn names_folder(line: &str, folder: &str) -> bool {
    line.match_indices(folder).any(|(at, _)| {
        !line[..at].ends_with(|c: char| c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '}' | ')' | '~' | '*'))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, text: &str) -> usize {
        problems(&SourceFile::new(path, text)).len()
    }

    #[test]
    fn machine_folders_and_mirrors_are_found() {
        for text in [
            format!("let p = \"{}x\";", FOLDERS[0]),
            format!("see {}.cargo/bin", FOLDERS[1]),
            format!("> {}log", FOLDERS[2]),
            format!("pip install {} https://x", MIRRORS[2]),
            format!("{} = \"mirror\"", MIRRORS[0]),
        ] {
            assert_eq!(found("a.md", &text), 1, "{text}");
        }
        assert_eq!(found("Cargo.lock", "source = \"registry+https://mirror.example/index\""), 1);
    }

    #[test]
    fn other_folders_of_such_names_pass() {
        for text in [
            format!("..{}x", FOLDERS[0]),
            format!("$HOME{}x", FOLDERS[0]),
            format!("a/frame{}x", FOLDERS[0]),
            "source = \"registry+https://github.com/rust-lang/crates.io-index\"".to_owned(),
        ] {
            assert_eq!(found("Cargo.lock", &text), 0, "{text}");
        }
    }
}
