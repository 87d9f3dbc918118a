//! Which names may stand in which files.

use super::law::Check;
use crate::source::{code_only, words};
use crate::tree::Tree;

pub(super) const CHECK: Check = Check {
    name: "names",
    law: "wgpu only in node/src/gpu/, wire types only in proto and service.rs, the node in the compositor only in \
          embedded.rs, tokio::test in no program of brickcast-harness, which would never run it",
    remedy: "convert at the door (proto, service.rs, gpu/, embedded.rs) and pass our own types on; in place of \
             #[tokio::test], #[test] #[tokio::main]",
    run: |tree| Ok(run(tree)),
};

struct Law {
    what: &'static str,
    /// True where a word, with what stands before and behind it on its line, is the name in question.
    is: fn(&str, &str, &str) -> bool,
    /// True for files that the law is about.
    holds_in: fn(&str) -> bool,
}

const LAWS: [Law; 5] = [
    Law {
        what: "wgpu",
        is: |word, _, _| word == "wgpu" || word.starts_with("wgpu_"),
        holds_in: |path| !path.starts_with("node/src/gpu/") && !path.starts_with("xtask/"),
    },
    Law {
        what: "wire",
        is: is_wire,
        // Whole-system tests forge messages.
        holds_in: |path| !path.starts_with("proto/") && !path.ends_with("/service.rs") && !path.starts_with("tests/"),
    },
    Law {
        what: "brickcast_node",
        is: |word, _, _| word == "brickcast_node",
        holds_in: |path| path.starts_with("compositor/") && !path.ends_with("/embedded.rs"),
    },
    Law {
        what: "brickcast_shaders",
        is: |word, _, _| word == "brickcast_shaders",
        holds_in: |path| path.starts_with("compositor/"),
    },
    Law {
        what: "tokio::test",
        is: |word, before, _| word == "test" && before.ends_with("#[tokio::"),
        holds_in: |path| HARNESSED.iter().any(|program| path.starts_with(program)),
    },
];

/// Programs without the compiler's harness: what its own attribute marks, as tokio's does in the end, is left out of
/// them.
const HARNESSED: [&str; 4] = ["tests/tests/picture/", "tests/tests/cluster/", "tests/tests/words/", "node/tests/node/"];

/// The module `wire` as part of a path or of a `use` list, not a variable of that name; and prost itself.
fn is_wire(word: &str, before: &str, behind: &str) -> bool {
    let in_path = before.trim_end().ends_with("::") || behind.trim_start().starts_with("::");
    let in_use = before.trim_start().starts_with("use ") || before.trim_start().starts_with("pub use ");
    matches!(word, "prost" | "prost_types") || (word == "wire" && (in_path || in_use))
}

fn run(tree: &Tree) -> Vec<String> {
    let mut problems = Vec::new();
    for file in tree.with_extension("rs") {
        let laws: Vec<_> = LAWS.iter().filter(|l| (l.holds_in)(&file.path)).collect();
        let code = code_only(&file.text);
        for (line, word, before, behind) in words(&code) {
            if let Some(law) = laws.iter().find(|l| (l.is)(word, before, behind)) {
                problems.push(format!("{}:{line}: names {} ({})", file.path, law.what, word));
            }
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, text: &str) -> usize {
        run(&Tree::of(&[(path, text)])).len()
    }

    #[test]
    fn names_at_home_pass_and_strangers_are_found_by_line() {
        for (path, text) in [
            ("node/src/gpu/device.rs", "use wgpu::Device;"),
            ("node/src/serve/service.rs", "use brickcast_proto::wire::Tile;"),
            ("proto/src/convert.rs", "use crate::wire;\nuse prost::Message;"),
            ("compositor/src/embedded.rs", "use brickcast_node::serve;"),
            ("tests/src/lib.rs", "use brickcast_node::x; use brickcast_proto::wire;"),
            ("tests/tests/door/floods.rs", "#[tokio::test]\nasync fn f() {}"),
            ("tests/tests/words/cli.rs", "#[test]\n#[tokio::main]\nasync fn f() {}"),
        ] {
            assert_eq!(found(path, text), 0, "{path}");
        }
        for (path, text) in [
            ("node/src/render/mod.rs", "fn f(d: &wgpu::Device) {}"),
            ("compositor/src/lib.rs", "use wgpu_core::x;"),
            ("compositor/src/session/mod.rs", "use brickcast_proto::wire::Tile;"),
            ("compositor/src/session/mod.rs", "use brickcast_proto::{status, wire};"),
            ("node/src/render/mod.rs", "wire::Tile::default();"),
            ("node/src/render/mod.rs", "use prost::Message as _;"),
            ("compositor/src/cli/command/render/mod.rs", "brickcast_node::serve();"),
            ("compositor/src/cli/command/bench/mod.rs", "use brickcast_shaders::twin;"),
            ("tests/tests/cluster/shared.rs", "#[tokio::test(flavor = \"multi_thread\")]\nasync fn f() {}"),
        ] {
            assert_eq!(found(path, text), 1, "{path}: {text}");
        }
        let lines = run(&Tree::of(&[("node/src/a.rs", "// wgpu\n\nlet x = wgpu::y;")]));
        assert!(lines[0].starts_with("node/src/a.rs:3:"), "{lines:?}");
    }

    #[test]
    fn talk_of_names_is_no_use_of_them() {
        let text = "/// Like wgpu's, see wire::Tile.\nlet s = \"wgpu_hal=warn\"; let wire = 3; f(wire);";
        assert_eq!(found("node/src/main.rs", text), 0);
    }
}
