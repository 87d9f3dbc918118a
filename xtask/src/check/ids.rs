//! Bricks and chunks travel as ids, never as bare integers.

use super::law::Check;
use crate::imports::imports;
use crate::source::code_only;
use crate::tokens::{closed, is_for_tests, is_word, item_end, tokens};
use crate::tree::Tree;

pub(super) const CHECK: Check = Check {
    name: "ids",
    law: "no field, parameter or answer called a brick or a chunk is a bare integer, or a collection of them, and ids \
          are made of integers only where grid, tree and tables number them (volume, node, proto but its convert/, \
          compositor; tests apart)",
    remedy: "take BrickId, ChunkId or PerChunk of volume/src, and get ids from BrickGrid, MergeTree or a table; what \
             is no id gets another name: positions, count",
    run: |tree| Ok(run(tree)),
};

const ROOTS: [&str; 6] = [
    "volume/src/lib.rs",
    "node/src/lib.rs",
    "node/src/main.rs",
    "proto/src/lib.rs",
    "compositor/src/lib.rs",
    "compositor/src/main.rs",
];
/// The wire's door: its messages have integers.
const DOOR: &str = "proto/src/convert/";

/// What holds, gives or takes bricks or chunks themselves.
const NAMES: [&str; 11] = [
    "brick",
    "bricks",
    "brick_id",
    "brick_ids",
    "bricks_in",
    "bricks_of",
    "chunk",
    "chunks",
    "chunk_id",
    "chunk_ids",
    "chunks_of",
];

/// Counts, sizes and other chunks that are called so on the wire, in JSON, in options or by Zarr: file, name and type.
const ALLOWED: [(&str, &str, &str); 11] = [
    // Counts in errors.
    ("volume/src/brick.rs", "bricks", "u64"),
    ("volume/src/store/regions/error.rs", "bricks", "u64"),
    // Zarr's inner chunks, which are not ours.
    ("volume/src/store/shard/write.rs", "chunks", "Vec<(usize,Option<Vec<u8>>)>"),
    // How many are resident, rendered, loaded: the names of the messages and of --stats.
    ("node/src/brick/residency.rs", "bricks", "usize"),
    ("proto/src/cluster.rs", "bricks", "u32"),
    ("proto/src/part.rs", "bricks", "u32"),
    ("compositor/src/frame/node_frame.rs", "bricks", "u32"),
    // How many there are: a key of --simulate, and of the balancer's report.
    ("compositor/src/balance/simulate/spec.rs", "chunks", "u32"),
    ("compositor/src/balance/report.rs", "chunks", "u64"),
    // The edge of a brick: --brick.
    ("compositor/src/cli/args/making.rs", "brick", "u32"),
    ("compositor/src/cli/args/on_the_way.rs", "brick", "u32"),
];

/// Where integers become ids, besides the wire's door.
const MAKERS: [&str; 4] = [
    "volume/src/brick.rs",
    "volume/src/merge.rs",
    "volume/src/per_chunk.rs",
    // The balancer's model has a grid of its own.
    "compositor/src/balance/simulate/grid.rs",
];

const INTEGERS: [&str; 10] = ["u8", "u16", "u32", "u64", "u128", "usize", "i16", "i32", "i64", "isize"];
/// With integers alone in them they name nothing.
const AROUND: [&str; 22] = [
    "mut",
    "impl",
    "dyn",
    "Option",
    "Vec",
    "VecDeque",
    "BTreeSet",
    "HashSet",
    "BTreeMap",
    "HashMap",
    "Box",
    "Arc",
    "Iterator",
    "IntoIterator",
    "Item",
    "Range",
    "use",
    "std",
    "ops",
    "f32",
    "f64",
    "bool",
];

fn run(tree: &Tree) -> Vec<String> {
    let mut problems = Vec::new();
    for path in ROOTS.iter().flat_map(|root| imports(tree, root).files).filter(|path| !path.starts_with(DOOR)) {
        let Some(file) = tree.file(&path) else { continue };
        let Found { bare, made } = Found::new(&code_only(&file.text));
        let bare = bare.iter().filter(|(_, name, of)| !ALLOWED.contains(&(&path[..], &name[..], &of[..])));
        problems.extend(bare.map(|(line, name, of)| format!("{path}:{line}: {name} is {of}")));
        let made = made.iter().filter(|_| !MAKERS.contains(&path.as_str()));
        problems.extend(made.map(|(line, id)| format!("{path}:{line}: makes a {id} of an integer")));
    }
    problems
}

/// What code has to do with bare integers; what is compiled for tests alone is left out.
#[derive(Debug, Default)]
struct Found {
    /// Line, name and type of what is called a brick or a chunk.
    bare: Vec<(usize, String, String)>,
    /// Line and type of an id that is made of one.
    made: Vec<(usize, String)>,
}

impl Found {
    fn new(code: &str) -> Self {
        let on_lines = (1..).zip(code.lines());
        let (lines, tokens): (Vec<usize>, Vec<&str>) =
            on_lines.flat_map(|(number, line)| tokens(line).into_iter().map(move |token| (number, token))).unzip();
        let mut found = Self::default();
        let mut look = |name: usize, of: &[&str]| {
            if is_bare(of) {
                found.bare.push((lines[name], tokens[name].to_owned(), of.concat()));
            }
        };
        let mut i = 0;
        while let Some(&token) = tokens.get(i) {
            match token {
                "#" => {
                    let end = closed(&tokens, i + 1);
                    i = if is_for_tests(&tokens[i..end]) { item_end(&tokens, end) } else { end };
                    continue;
                }
                "struct" | "enum" => {
                    let end = item_end(&tokens, i);
                    named(&tokens, i..end, &mut look);
                    i = end;
                    continue;
                }
                "fn" if tokens.get(i + 1).is_some_and(|name| *name != "(") => {
                    let Some(open) = parameters(&tokens, i + 2) else { break };
                    let end = closed(&tokens, open);
                    named(&tokens, open + 1..end, &mut look);
                    if NAMES.contains(&tokens[i + 1]) && tokens.get(end..end + 2) == Some(&["-", ">"][..]) {
                        look(i + 1, &tokens[end + 2..type_end(&tokens, end + 2)]);
                    }
                    i = end;
                    continue;
                }
                "ChunkId" | "BrickId" if matches!(tokens.get(i + 1..i + 3), Some(["::", "new" | "finest"])) => {
                    found.made.push((lines[i], token.to_owned()));
                }
                _ => {}
            }
            i += 1;
        }
        found
    }
}

/// Looks at what is called a brick or a chunk within `range`, with its type.
fn named(tokens: &[&str], range: std::ops::Range<usize>, look: &mut impl FnMut(usize, &[&str])) {
    for i in range {
        if NAMES.contains(&tokens[i]) && tokens.get(i + 1) == Some(&":") {
            look(i, &tokens[i + 2..type_end(tokens, i + 2)]);
        }
    }
}

/// Where the parameters of a function open, behind its name and its generics.
fn parameters(tokens: &[&str], from: usize) -> Option<usize> {
    let mut depth = 0_usize;
    (from..tokens.len()).find(|&i| {
        match tokens[i] {
            "<" => depth += 1,
            ">" if tokens[i - 1] != "-" => depth = depth.saturating_sub(1),
            _ => {}
        }
        tokens[i] == "(" && depth == 0
    })
}

/// Behind the type that begins at `from`.
fn type_end(tokens: &[&str], from: usize) -> usize {
    let mut depth = 0_usize;
    for (i, token) in tokens.iter().enumerate().skip(from) {
        match *token {
            "(" | "[" | "<" => depth += 1,
            ">" if tokens[i - 1] == "-" => {}
            ")" | "]" | ">" | "}" if depth == 0 => return i,
            ")" | "]" | ">" => depth -= 1,
            "," | ";" | "{" | "where" if depth == 0 => return i,
            _ => {}
        }
    }
    tokens.len()
}

/// True for an integer, and for what has nothing in it but integers and numbers beside them.
fn is_bare(of: &[&str]) -> bool {
    let is_lifetime = |i: usize| i > 0 && of[i - 1] == "'";
    let mut words = (0..of.len()).filter(|&i| is_word(of[i]) && !is_lifetime(i));
    let has_integers = of.iter().any(|word| INTEGERS.contains(word));
    has_integers && words.all(|i| INTEGERS.contains(&of[i]) || AROUND.contains(&of[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<String> {
        run(&Tree::of(&[("node/src/lib.rs", "mod a; #[cfg(test)] mod tests;"), ("node/src/a.rs", text)]))
    }

    #[test]
    fn bare_bricks_and_chunks_are_found_with_line_and_type() {
        for text in [
            "struct A { pub bricks: Vec<u32> }",
            "enum A { B { chunk: u32, last: u64 } }",
            "struct A<'a> { chunks: &'a [usize] }",
            "struct A { chunks: BTreeMap<u32, f64> }",
            "fn f(&self, chunk: usize) -> u64 {}",
            "pub(crate) fn f<F: Fn(u32) -> bool>(f: F, bricks: &[u32]);",
            "trait A { fn chunks(&self) -> impl Iterator<Item = u32> + use<>; }",
            "fn bricks_of(node: usize) -> Vec<u32> where {}",
            "fn f() { fn g(brick: Option<u32>) {} }",
            "#[derive(Debug)] struct A { #[serde(default)] chunk_id: u32 }",
        ] {
            assert_eq!(found(text).len(), 1, "{text}: {:?}", found(text));
        }
        let at = found("struct A {\n    chunk: ChunkId,\n    brick:\n        u32,\n}");
        assert_eq!(at, ["node/src/a.rs:3: brick is u32"]);
    }

    #[test]
    fn ids_that_are_made_anywhere_are_found() {
        assert_eq!(found("fn f() { g(0, ChunkId::new(3)) }"), ["node/src/a.rs:1: makes a ChunkId of an integer"]);
        assert_eq!(found("let x = y.map(brickcast_volume::BrickId::finest);").len(), 1);
        assert_eq!(
            found("fn f(a: ChunkId) { let b = ChunkId::linear(a); }\n#[cfg(test)] const A: B = ChunkId::new(3);"),
            [""; 0]
        );
        let maker = [("volume/src/lib.rs", "mod merge;"), ("volume/src/merge.rs", "fn f() { ChunkId::new(3) }")];
        assert_eq!(run(&Tree::of(&maker)), [""; 0]);
    }

    #[test]
    fn ids_counts_local_variables_and_tests_pass() {
        for text in [
            "struct A { bricks: Vec<BrickId>, chunks: PerChunk<u64>, brick_size: u32, chunk_count: u64 }",
            "enum A { B { chunk: ChunkIndex, last: u64 } }",
            "fn f(chunk: ChunkId, position: usize, shown: &BTreeMap<ChunkId, u32>) -> usize {}",
            "fn chunks(&self) -> BTreeMap<ChunkId, u32> {}",
            "struct A { bricks: Vec<bool>, chunk: Chunk<u32> }",
            "fn f() { let bricks: Vec<usize> = g(|chunk: u32| chunk); }",
            "#[cfg(test)] mod t { struct A { brick: u32 } fn f(chunk: u32) {} }",
            "impl A { #[cfg(test)] fn f(chunk: u32) -> u32 {} }",
            "// fn f(chunk: u32)\nconst A: &str = \"chunk: u32\";",
        ] {
            assert_eq!(found(text), [""; 0], "{text}");
        }
        let elsewhere = [
            ("proto/src/lib.rs", "mod convert; mod part;"),
            ("proto/src/convert/mod.rs", "fn f(chunk: u32) {}"),
            ("proto/src/part.rs", "struct Receipt { bricks: u32 }"),
            ("tests/src/lib.rs", "fn f(chunk: u32) {}"),
            ("node/src/lib.rs", "#[cfg(test)] mod tests;"),
            ("node/src/tests.rs", "fn f(chunk: u32) {}"),
        ];
        assert_eq!(run(&Tree::of(&elsewhere)), [""; 0]);
    }

    /// What is allowed must be there, or the list says what is not so.
    #[test]
    fn every_exception_is_one() {
        let tree = Tree::of_repository().unwrap();
        let found = |path| Found::new(&code_only(&tree.file(path).unwrap_or_else(|| panic!("{path} is missing")).text));
        for (path, name, of) in ALLOWED {
            assert!(found(path).bare.iter().any(|(_, n, o)| (&n[..], &o[..]) == (name, of)), "{path}: {name}");
        }
        assert!(MAKERS.iter().all(|path| !found(path).made.is_empty()));
    }
}
