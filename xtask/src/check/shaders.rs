//! Every kernel parses and validates. Kernels are the files of `shaders/wgsl/`; parts that they are joined with by text
//! lie in its folders, so that a part alone need not be complete.

use std::collections::BTreeSet;

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::law::Check;
use crate::source::{code_only, words};
use crate::tree::{SourceFile, Tree};

pub(super) const CHECK: Check = Check {
    name: "shaders",
    law: "every kernel of shaders/wgsl/ parses and validates with every choice of the parts that it names",
    remedy: "mend the WGSL at the line named; a part that no kernel names can go",
    run: |tree| Ok(run(tree)),
};

const KERNELS: &str = "shaders/wgsl/";

/// More ways to join one kernel than this would be a module system of its own.
const MAX_CHOICES: usize = 64;

/// A file with what it declares and names.
struct Part<'a> {
    file: &'a SourceFile,
    declares: BTreeSet<String>,
    names: BTreeSet<String>,
}

impl<'a> Part<'a> {
    fn new(file: &'a SourceFile) -> Self {
        let code = code_only(&file.text);
        Self { file, declares: declared(&code), names: words(&code).map(|(_, word, ..)| word.to_owned()).collect() }
    }
}

fn run(tree: &Tree) -> Vec<String> {
    let is_part = |f: &&SourceFile| f.path[KERNELS.len()..].contains('/');
    let (shared, kernels): (Vec<_>, Vec<_>) =
        tree.with_extension("wgsl").filter(|f| f.path.starts_with(KERNELS)).partition(is_part);
    let shared: Vec<_> = shared.into_iter().map(Part::new).collect();
    let mut problems = BTreeSet::new();
    let mut used = BTreeSet::new();
    for kernel in kernels {
        let kernel = Part::new(kernel);
        let mut choices = Vec::new();
        choose(&kernel, &shared, BTreeSet::new(), &mut choices);
        if choices.is_empty() {
            problems
                .insert(format!("{}: no choice of parts declares all that it names, each name once", kernel.file.path));
        }
        for choice in choices {
            used.extend(choice.iter().copied());
            let files: Vec<_> = choice.iter().map(|i| shared[*i].file).chain([kernel.file]).collect();
            problems.extend(validate(&files).err());
        }
    }
    let unused = shared.iter().enumerate().filter(|(i, _)| !used.contains(i));
    problems.extend(unused.map(|(_, part)| format!("{}: no kernel names what it declares", part.file.path)));
    problems.into_iter().collect()
}

/// Completes `chosen` until every name that some part declares is declared; where several parts declare it (variants of
/// one function), each of them is a choice, unless it declares again what is declared already.
fn choose(kernel: &Part<'_>, shared: &[Part<'_>], chosen: BTreeSet<usize>, choices: &mut Vec<BTreeSet<usize>>) {
    let joined = || chosen.iter().map(|i| &shared[*i]).chain([kernel]);
    let open = joined().flat_map(|p| &p.names).find(|name| {
        shared.iter().any(|p| p.declares.contains(*name)) && !joined().any(|p| p.declares.contains(*name))
    });
    let Some(open) = open else {
        if choices.len() < MAX_CHOICES && !choices.contains(&chosen) {
            choices.push(chosen);
        }
        return;
    };
    let fits = |part: &Part<'_>| joined().all(|p| p.declares.is_disjoint(&part.declares));
    for (i, _) in shared.iter().enumerate().filter(|(_, p)| p.declares.contains(open) && fits(p)) {
        let mut more = chosen.clone();
        more.insert(i);
        choose(kernel, shared, more, choices);
    }
}

/// Names that WGSL code declares at module scope.
fn declared(code: &str) -> BTreeSet<String> {
    let mut depth = 0_u32;
    let outside: String = code
        .chars()
        .map(|c| {
            match c {
                '{' => depth += 1,
                '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 || c == '\n' { c } else { ' ' }
        })
        .collect();
    words(&outside)
        .filter(|(_, word, ..)| matches!(*word, "fn" | "struct" | "alias" | "const" | "override" | "var"))
        .filter_map(|(_, _, _, behind)| {
            let behind = behind.trim_start();
            let behind = if behind.starts_with('<') { behind.split_once('>')?.1 } else { behind };
            let name = behind.trim_start().split(|c: char| !(c == '_' || c.is_alphanumeric())).next()?;
            (!name.is_empty()).then(|| name.to_owned())
        })
        .collect()
}

/// The problem of the files joined in this order, at the file and line where it is.
fn validate(files: &[&SourceFile]) -> Result<(), String> {
    let joined = files.iter().map(|f| format!("{}\n", f.text.trim_end())).collect::<String>();
    let names = || files.iter().map(|f| f.name()).collect::<Vec<_>>().join(" + ");
    let at = |line: Option<u32>, what: String| {
        let mut line = line.unwrap_or(0) as usize;
        for file in files {
            let count = file.text.trim_end().lines().count();
            if (1..=count).contains(&line) {
                return format!("{}:{line}: {what} (joined: {})", file.path, names());
            }
            line = line.saturating_sub(count);
        }
        format!("{}: {what}", names())
    };
    let module = naga::front::wgsl::parse_str(&joined)
        .map_err(|e| at(e.location(&joined).map(|l| l.line_number), e.message().to_owned()))?;
    Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module).map_err(|e| {
        let mut what = e.as_inner().to_string();
        let mut cause = std::error::Error::source(e.as_inner());
        while let Some(inner) = cause {
            what = format!("{what}: {inner}");
            cause = inner.source();
        }
        at(e.location(&joined).map(|l| l.line_number), what)
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNEL: &str = "// one\n@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
        @compute @workgroup_size(1)\nfn main() {\n    out[0] = read(1.0);\n}\n";

    fn found(parts: &[(&str, &str)]) -> Vec<String> {
        let files: Vec<_> = [("shaders/wgsl/k.wgsl", KERNEL)].iter().chain(parts).copied().collect();
        run(&Tree::of(&files))
    }

    #[test]
    fn kernels_are_joined_with_what_they_name() {
        let half = ("shaders/wgsl/shared/half.wgsl", "const HALF: f32 = 0.5;");
        let read = ("shaders/wgsl/shared/read.wgsl", "fn read(x: f32) -> f32 { return x * HALF; }");
        assert_eq!(found(&[read, half]), [""; 0]);
        let missing = found(&[read]);
        assert!(
            missing.len() == 1 && missing[0].contains("read.wgsl:1:") && missing[0].contains("HALF"),
            "{missing:?}"
        );
    }

    /// A variant that nobody tests is where the error is.
    #[test]
    fn every_variant_of_a_part_is_checked() {
        let good = ("shaders/wgsl/shared/a.wgsl", "fn read(x: f32) -> f32 { return x; }");
        let bad = ("shaders/wgsl/shared/b.wgsl", "// b\nfn read(x: f32) -> u32 { return x; }");
        assert_eq!(found(&[good]), [""; 0]);
        let problems = found(&[good, bad]);
        assert!(problems.len() == 1 && problems[0].contains("b.wgsl"), "{problems:?}");
    }

    /// Two parts that both set up the same thing are never joined; where a kernel would need both, that is said.
    #[test]
    fn parts_that_declare_one_name_twice_are_no_choice() {
        let read = |set_up: &str| format!("fn read(x: f32) -> f32 {{ return x * set_up() * {set_up}; }}");
        let (one, other) =
            ("fn set_up() -> f32 { return 1.0; }\nconst ONE: f32 = 1.0;", "fn set_up() -> f32 { return 2.0; }");
        let parts = |read| {
            [
                ("shaders/wgsl/shared/a.wgsl", one),
                ("shaders/wgsl/shared/b.wgsl", other),
                ("shaders/wgsl/shared/r.wgsl", read),
            ]
        };
        let fine = read("ONE");
        let problems = found(&parts(&fine));
        assert!(problems.len() == 1 && problems[0].contains("b.wgsl: no kernel names"), "{problems:?}");
        let both = ("shaders/wgsl/shared/c.wgsl", "fn set_up() -> f32 { return 3.0; }\nconst TWO: f32 = 2.0;");
        let impossible = read("ONE * TWO");
        let all: Vec<_> = parts(&impossible).into_iter().chain([both]).collect();
        assert!(found(&all).iter().any(|p| p.contains("no choice of parts")), "{:?}", found(&all));
    }

    #[test]
    fn broken_kernels_and_idle_parts_are_found() {
        let idle = ("shaders/wgsl/shared/idle.wgsl", "fn idle() {}");
        let read = ("shaders/wgsl/shared/a.wgsl", "fn read(x: f32) -> f32 { return x; }");
        assert_eq!(found(&[read, idle]), ["shaders/wgsl/shared/idle.wgsl: no kernel names what it declares"]);
        let problems = found(&[]);
        assert!(problems.len() == 1 && problems[0].starts_with("shaders/wgsl/k.wgsl:5:"), "{problems:?}");
        let problems = run(&Tree::of(&[("shaders/wgsl/x.wgsl", "fn f( {")]));
        assert!(problems.len() == 1 && problems[0].starts_with("shaders/wgsl/x.wgsl:1:"), "{problems:?}");
    }
}
