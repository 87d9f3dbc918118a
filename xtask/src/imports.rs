//! Which file of a crate imports which: enough of a parser to follow `mod`, `use` and paths in code.

use std::collections::{BTreeMap, HashMap};

use crate::source::code_only;
use crate::tokens::{closed, is_for_tests, is_word, item_end, tokens};
use crate::tree::Tree;

/// The files of one crate, without those that are compiled for tests alone.
#[derive(Debug, Default)]
pub(crate) struct Imports {
    /// Paths in the repository.
    pub(crate) files: Vec<String>,
    /// By file: the files that it imports, each with one path that does.
    pub(crate) edges: Vec<BTreeMap<usize, String>>,
    /// Modules whose file was not found: `#[path]` is not followed.
    pub(crate) lost: Vec<String>,
}

type Segments = Vec<String>;

/// What one file says, in the order of its text.
#[derive(Debug, Default)]
struct Said {
    /// The module that each `mod` names, and whether its text is in another file.
    modules: Vec<(Segments, bool)>,
    /// The module that says it, the path that is named, and the name that a `use` gives it.
    paths: Vec<(Segments, Segments, Option<String>)>,
}

/// Follows the modules of the crate whose root is the file `root`, as `node/src/lib.rs`.
pub(crate) fn imports(tree: &Tree, root: &str) -> Imports {
    let mut found = Imports::default();
    // Modules that lie within a file belong to it.
    let mut file_of: HashMap<Segments, usize> = HashMap::new();
    let mut said = Vec::new();
    let mut open = vec![(Segments::new(), root.to_owned())];
    let source = root.rsplit_once('/').map_or("", |(folder, _)| folder);
    while let Some((module, path)) = open.pop() {
        let Some(file) = tree.file(&path) else { continue };
        let says = read(&file.text, &module);
        file_of.insert(module, found.files.len());
        for (child, is_elsewhere) in &says.modules {
            if !is_elsewhere {
                file_of.insert(child.clone(), found.files.len());
                continue;
            }
            let stem = format!("{source}/{}", child.join("/"));
            match [format!("{stem}.rs"), format!("{stem}/mod.rs")].into_iter().find(|p| tree.file(p).is_some()) {
                Some(path) => open.push((child.clone(), path)),
                None => found.lost.push(format!("{path}: mod {} has no file {stem}.rs", child.join("::"))),
            }
        }
        found.files.push(path);
        said.push(says);
    }
    let absolute = |path: &Segments, module: &Segments| absolute(path, module, &file_of);
    let by_root = said.first().into_iter().flat_map(|says| &says.paths).filter(|(module, ..)| module.is_empty());
    let by_root: HashMap<&String, Segments> =
        by_root.filter_map(|(module, path, name)| Some((name.as_ref()?, absolute(path, module)?))).collect();
    for (from, says) in said.iter().enumerate() {
        let mut edges = BTreeMap::new();
        for (module, path, _) in &says.paths {
            let Some(mut meant) = absolute(path, module) else { continue };
            // What the root only hands on is imported from where it is.
            if let [first, rest @ ..] = &meant[..]
                && !file_of.contains_key(&meant[..1])
                && let Some(there) = by_root.get(first)
            {
                meant = there.iter().chain(rest).cloned().collect();
            }
            let to = (0..=meant.len()).rev().find_map(|n| file_of.get(&meant[..n]));
            if let Some(&to) = to.filter(|to| **to != from) {
                edges.entry(to).or_insert_with(|| path.join("::"));
            }
        }
        found.edges.push(edges);
    }
    found
}

/// `path`, named in `module`, from the crate's root on; `None` where it leads into another crate.
fn absolute(path: &Segments, module: &Segments, known: &HashMap<Segments, usize>) -> Option<Segments> {
    let (first, rest) = path.split_first()?;
    let mut base = module.clone();
    match first.as_str() {
        "crate" => base.clear(),
        "self" => {}
        "super" => {
            base.pop();
            let more = rest.iter().take_while(|word| *word == "super").count();
            base.truncate(base.len().saturating_sub(more));
            return Some(base.into_iter().chain(rest[more..].iter().cloned()).collect());
        }
        child => {
            base.push(child.to_owned());
            known.get(&base)?;
        }
    }
    Some(base.into_iter().chain(rest.iter().cloned()).collect())
}

/// Reads the text of `module`, leaving out what is compiled for tests alone.
fn read(text: &str, module: &Segments) -> Said {
    let code = code_only(text);
    let tokens = tokens(&code);
    let (mut said, mut here) = (Said::default(), module.clone());
    // Depths of braces at which the modules within this file began.
    let (mut depth, mut begun) = (0_usize, Vec::new());
    let mut i = 0;
    while let Some(&token) = tokens.get(i) {
        let at = |n: usize| tokens.get(i + n).copied().unwrap_or_default();
        match token {
            "#" => {
                let end = closed(&tokens, i + 1);
                // What others name is looked at like all else.
                i = if is_for_tests(&tokens[i..end]) { item_end(&tokens, end) } else { i + 1 };
                continue;
            }
            // Who may see it is no import.
            "pub" if at(1) == "(" => {
                i = closed(&tokens, i + 1);
                continue;
            }
            "mod" if matches!(at(2), ";" | "{") => {
                let child = here.iter().cloned().chain([at(1).to_owned()]).collect::<Segments>();
                said.modules.push((child.clone(), at(2) == ";"));
                if at(2) == "{" {
                    begun.push(depth);
                    here = child;
                    depth += 1;
                }
                i += 3;
                continue;
            }
            "use" => {
                let end = i + tokens[i..].iter().position(|t| *t == ";").unwrap_or(tokens.len() - i);
                for (path, name) in leaves(&tokens[i + 1..end]) {
                    said.paths.push((here.clone(), path, name));
                }
                i = end;
                continue;
            }
            "{" => depth += 1,
            "}" => {
                depth = depth.saturating_sub(1);
                if begun.last() == Some(&depth) {
                    begun.pop();
                    here.pop();
                }
            }
            _ if is_word(token) && at(1) == "::" && (i == 0 || tokens[i - 1] != "::") => {
                let mut path = vec![token.to_owned()];
                while tokens.get(i + 1) == Some(&"::") && tokens.get(i + 2).is_some_and(|t| is_word(t)) {
                    path.push(tokens[i + 2].to_owned());
                    i += 2;
                }
                said.paths.push((here.clone(), path, None));
            }
            _ => {}
        }
        i += 1;
    }
    said
}

/// The paths of a `use`, and the name that each has then.
fn leaves(tokens: &[&str]) -> Vec<(Segments, Option<String>)> {
    let Some(brace) = tokens.iter().position(|t| *t == "{") else {
        let end = tokens.iter().position(|t| *t == "as").unwrap_or(tokens.len());
        let mut path: Segments = tokens[..end].iter().filter(|t| is_word(t)).map(|t| (*t).to_owned()).collect();
        // `a::{self}` is a; `self` at the beginning is this module.
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = tokens.get(end + 1).map(|t| (*t).to_owned()).or_else(|| path.last().cloned());
        return if path.is_empty() { Vec::new() } else { vec![(path, name)] };
    };
    let (prefix, inner) = (&tokens[..brace], &tokens[brace + 1..closed(tokens, brace).saturating_sub(1)]);
    let (mut found, mut depth, mut start) = (Vec::new(), 0_usize, 0);
    for (i, token) in inner.iter().chain([&","]).enumerate() {
        match *token {
            "{" => depth += 1,
            "}" => depth = depth.saturating_sub(1),
            "," if depth == 0 => {
                found.extend(leaves(&[prefix, &inner[start..i]].concat()).into_iter().filter(|_| i > start));
                start = i + 1;
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `from -> to (path)` of the crate `a`, by the names of files.
    fn edges(files: &[(&str, &str)]) -> Vec<String> {
        let found = imports(&Tree::of(files), "a/src/lib.rs");
        assert_eq!(found.lost, [""; 0]);
        let name = |file: usize| found.files[file].trim_start_matches("a/src/");
        let of = |(from, to): (usize, &BTreeMap<usize, String>)| -> Vec<String> {
            to.iter().map(|(to, path)| format!("{} -> {} ({path})", name(from), name(*to))).collect()
        };
        let mut edges: Vec<String> = found.edges.iter().enumerate().flat_map(of).collect();
        edges.sort();
        edges
    }

    #[test]
    fn groups_and_paths_in_code_are_imports_and_talk_of_them_is_not() {
        let found = edges(&[
            ("a/src/lib.rs", "mod b; mod c; mod d; mod e; // use crate::b;"),
            ("a/src/b.rs", "use crate::{c::{self, C}, d::D as E};\nuse std::fmt;\nlet s = \"crate::e::X\";"),
            ("a/src/c.rs", "fn f() { super::d::f(|| std::mem::take(x)) }\npub(in super::super) fn g() {}"),
            ("a/src/d.rs", "pub(crate) use crate::e::*;\n#[error(\"{}\", super::c::words())] struct D;"),
            ("a/src/e.rs", ""),
        ]);
        assert_eq!(
            found,
            [
                "b.rs -> c.rs (crate::c)",
                "b.rs -> d.rs (crate::d::D)",
                "c.rs -> d.rs (super::d::f)",
                "d.rs -> c.rs (super::c::words)",
                "d.rs -> e.rs (crate::e)"
            ]
        );
    }

    #[test]
    fn a_folder_hands_on_and_the_root_is_looked_through() {
        let found = edges(&[
            ("a/src/lib.rs", "mod b; mod c; pub use b::x::X; pub use b::Y as Z;"),
            ("a/src/b/mod.rs", "mod x; mod y; pub use x::X; fn f() { y::g() }"),
            ("a/src/b/x.rs", "use super::y::Y;"),
            ("a/src/b/y.rs", "use self::z::Z; mod z { use super::super::X; pub fn f() { super::g() } }"),
            ("a/src/c.rs", "use crate::{X, Z};"),
        ]);
        assert_eq!(
            found,
            [
                "b/mod.rs -> b/x.rs (x::X)",
                "b/mod.rs -> b/y.rs (y::g)",
                "b/x.rs -> b/y.rs (super::y::Y)",
                "b/y.rs -> b/mod.rs (super::super::X)",
                "c.rs -> b/mod.rs (crate::Z)",
                "c.rs -> b/x.rs (crate::X)",
                "lib.rs -> b/mod.rs (b::Y)",
                "lib.rs -> b/x.rs (b::x::X)",
            ]
        );
    }

    #[test]
    fn what_is_compiled_for_tests_alone_imports_nothing() {
        let b = "#[cfg(test)] use crate::c::{C, D};\n#[cfg(not(test))] use crate::d::D;\n\
                 #[cfg(test)]\n#[cfg(unix)]\nmod tests { use crate::c::C; }\n\
                 impl B { #[cfg(test)] fn f() -> HashMap<[u8; 2], C> { crate::c::f() } fn g() { crate::e::g() } }";
        let found = edges(&[
            ("a/src/lib.rs", "mod b; mod c; mod d; mod e; #[cfg(test)] mod testing;"),
            ("a/src/b.rs", b),
            ("a/src/c.rs", ""),
            ("a/src/d.rs", ""),
            ("a/src/e.rs", ""),
            ("a/src/testing.rs", "use crate::b::B;"),
        ]);
        assert_eq!(found, ["b.rs -> d.rs (crate::d::D)", "b.rs -> e.rs (crate::e::g)"]);
    }

    #[test]
    fn a_module_without_its_file_is_told() {
        let found = imports(&Tree::of(&[("a/src/lib.rs", "#[path = \"x.rs\"] mod b;")]), "a/src/lib.rs");
        assert_eq!(found.lost, ["a/src/lib.rs: mod b has no file a/src/b.rs"]);
    }
}
