//! One concept, one file: none grows beyond what can be read at a sitting.

use super::law::Check;
use crate::tree::Tree;

const MAX_LINES: usize = 400;

pub(super) const CHECK: Check = Check {
    name: "file-length",
    law: "no .rs or .wgsl file has more than 400 lines",
    remedy: "split the file: one concept, one file, named after it",
    run: |tree| Ok(run(tree)),
};

fn run(tree: &Tree) -> Vec<String> {
    let files = tree.with_extension("rs").chain(tree.with_extension("wgsl"));
    files
        .map(|f| (f, f.text.lines().count()))
        .filter(|(_, n)| *n > MAX_LINES)
        .map(|(f, n)| format!("{}: {n} lines", f.path))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sources_are_found_and_long_documents_are_not() {
        let (long, short) = ("x\n".repeat(401), "x\n".repeat(400));
        let tree = Tree::of(&[("a.rs", &long), ("b.rs", &short), ("c.wgsl", &long), ("d.md", &long)]);
        assert_eq!(run(&tree), ["a.rs: 401 lines", "c.wgsl: 401 lines"]);
    }
}
