//! The compositor is an engine and a command line: only the command line knows of flags.

use super::law::Check;
use crate::source::{code_only, words};
use crate::tree::Tree;

pub(super) const CHECK: Check = Check {
    name: "flags",
    law: "in compositor/src, only cli/ and main.rs name clap, Failure, a word that ends in Arg or Args, or cli itself",
    remedy: "take values of our own (a number, a path, an enum without clap) and fail with the folder's own error; \
             flags become values in cli/",
    run: |tree| Ok(run(tree)),
};

fn is_engine(path: &str) -> bool {
    path.starts_with("compositor/src/") && !path.starts_with("compositor/src/cli/") && path != "compositor/src/main.rs"
}

/// True where a word, with what stands before and behind it on its line, is the command line's.
fn is_flag(word: &str, before: &str, behind: &str) -> bool {
    let in_path = before.trim_end().ends_with("::") || behind.trim_start().starts_with("::");
    let in_use = before.trim_start().starts_with("use ") || before.trim_start().starts_with("pub use ");
    word == "clap"
        || word.starts_with("clap_")
        || word == "Failure"
        || word.ends_with("Arg")
        || word.ends_with("Args")
        || (word == "cli" && (in_path || in_use))
}

fn run(tree: &Tree) -> Vec<String> {
    let mut problems = Vec::new();
    for file in tree.with_extension("rs").filter(|f| is_engine(&f.path)) {
        let code = code_only(&file.text);
        for (line, word, before, behind) in words(&code) {
            if is_flag(word, before, behind) {
                problems.push(format!("{}:{line}: the engine names {word}", file.path));
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
    fn flags_in_the_engine_are_found_by_line() {
        for text in [
            "use clap::Args;",
            "clap_complete::generate();",
            "fn f() -> Result<(), Failure> {}",
            "fn open(backend: BackendArg) {}",
            "impl CacheArgs {}",
            "use crate::cli::say;",
            "use crate::{cli, plan};",
            "cli::say::tell();",
        ] {
            for path in ["compositor/src/session/mod.rs", "compositor/src/embedded.rs", "compositor/src/cache/key.rs"] {
                assert!(found(path, text) > 0, "{path}: {text}");
            }
        }
        let lines = run(&Tree::of(&[("compositor/src/frame/mod.rs", "// clap\n\nlet x = Failure::usage(y);")]));
        assert_eq!(lines, ["compositor/src/frame/mod.rs:3: the engine names Failure"]);
    }

    #[test]
    fn the_command_line_and_other_crates_may_name_them() {
        let text = "use clap::Args; fn run(args: RenderArgs) -> Result<(), Failure> {}";
        for path in
            ["compositor/src/cli/args/render.rs", "compositor/src/main.rs", "node/src/config.rs", "tests/src/lib.rs"]
        {
            assert_eq!(found(path, text), 0, "{path}");
        }
        assert_eq!(found("compositor/src/lib.rs", "pub mod cli;"), 0);
    }

    #[test]
    fn talk_of_flags_is_no_use_of_them() {
        let text = "/// As [`RenderArgs`], a Failure of clap, in `crate::cli`.\n\
                    /* BackendArg */ let s = \"--deadline: see cli::RenderArgs, clap\"; let r = r#\"Failure\"#;\n\
                    let args = target; let cli = 3; f(args, cli); let is_arg = Argument::Failures;";
        assert_eq!(found("compositor/src/session/mod.rs", text), 0);
    }
}
