//! Files that import each other in a circle can only be read, changed and tested together.

use std::collections::BTreeSet;

use super::law::Check;
use crate::imports::{Imports, imports};
use crate::tree::Tree;

/// Two may belong together: a type, and what else is done with it.
const MOST: usize = 2;

pub(super) const CHECK: Check = Check {
    name: "circles",
    law: "no more than 2 files of a crate's src import each other in a circle (tests apart; a folder's mod.rs is a \
          file)",
    remedy: "move what all of them need into a file of its own below them; import a sibling from its file, not through \
             mod.rs",
    run: |tree| Ok(run(tree)),
};

fn run(tree: &Tree) -> Vec<String> {
    // The whole-system tests hold a library of helpers, which are tests.
    let is_root = |path: &str| path.ends_with("/src/lib.rs") || path.ends_with("/src/main.rs");
    let roots = tree.files.iter().map(|f| f.path.as_str()).filter(|path| is_root(path) && !path.starts_with("tests/"));
    roots.flat_map(|root| problems(imports(tree, root))).collect()
}

fn problems(imports: Imports) -> Vec<String> {
    let circles = circles(&imports).into_iter().filter(|circle| circle.len() > MOST);
    let circles = circles.map(|circle| {
        let mut files: Vec<(&str, usize)> = circle.iter().map(|file| (imports.files[*file].as_str(), *file)).collect();
        files.sort_unstable();
        let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
        let mut text = format!("{} files in a circle: {}", names.len(), names.join(", "));
        for (name, from) in files {
            for (to, path) in imports.edges[from].iter().filter(|(to, _)| circle.contains(to)) {
                text += &format!("\n        {name} imports {} ({path})", imports.files[*to]);
            }
        }
        text
    });
    circles.chain(imports.lost.clone()).collect()
}

/// Every set of files each of which imports every other, directly or through others.
fn circles(imports: &Imports) -> Vec<BTreeSet<usize>> {
    let reached: Vec<BTreeSet<usize>> = (0..imports.files.len()).map(|from| reached(imports, from)).collect();
    let circle = |from: usize| -> BTreeSet<usize> {
        reached[from].iter().copied().filter(|to| reached[*to].contains(&from)).collect()
    };
    // Each is found once, by its first file.
    (0..imports.files.len())
        .map(|from| (from, circle(from)))
        .filter(|(f, c)| c.first() == Some(f))
        .map(|(_, c)| c)
        .collect()
}

/// The files that `from` imports, directly or through others; itself among them where it is in a circle.
fn reached(imports: &Imports, from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(file) = open.pop() {
        open.extend(imports.edges[file].keys().filter(|to| reached.insert(**to)));
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: (&str, &str) = ("a/src/lib.rs", "mod b; mod c; mod d;");

    fn found(b: &str, c: &str, d: &str) -> Vec<String> {
        run(&Tree::of(&[ROOT, ("a/src/b.rs", b), ("a/src/c.rs", c), ("a/src/d.rs", d)]))
    }

    #[test]
    fn three_files_in_a_circle_are_found_with_an_import_of_each_edge() {
        let found = found("use crate::c::C;", "use super::d;", "fn f() -> crate::b::B {}");
        assert_eq!(found.len(), 1, "{found:?}");
        for part in [
            "3 files in a circle",
            "a/src/b.rs imports a/src/c.rs (crate::c::C)",
            "a/src/c.rs imports a/src/d.rs (super::d)",
            "a/src/d.rs imports a/src/b.rs (crate::b::B)",
        ] {
            assert!(found[0].contains(part), "{part}: {}", found[0]);
        }
    }

    #[test]
    fn a_chain_a_pair_and_a_circle_only_in_tests_pass() {
        assert_eq!(found("use crate::c::C;", "use crate::d::D;", ""), [""; 0]);
        assert_eq!(found("use crate::c::C;", "use crate::{b::B, d::D};", ""), [""; 0]);
        let in_tests = "#[cfg(test)]\nmod tests { use crate::b::B; }";
        assert_eq!(found("use crate::c::C;", "use crate::d::D;", in_tests), [""; 0]);
    }

    #[test]
    fn siblings_that_import_through_their_folder_are_in_a_circle_with_it() {
        let folder = |x: &'static str| {
            let files = [
                ("a/src/main.rs", "mod b;"),
                ("a/src/b/mod.rs", "mod x; mod y; pub use x::X; pub use y::Y;"),
                ("a/src/b/x.rs", x),
                ("a/src/b/y.rs", "use super::X;"),
            ];
            run(&Tree::of(&files)).len()
        };
        assert_eq!((folder(""), folder("use super::Y;"), folder("use super::y::Y;")), (0, 1, 1));
        assert_eq!(run(&Tree::of(&[("tests/src/lib.rs", "mod b; use b::X;"), ("tests/src/b.rs", "")])), [""; 0]);
    }
}
