//! `brickcast verify`: whether a store is, byte for byte, what its manifest says.

use std::collections::HashMap;

use anyhow::anyhow;
use brickcast_remote::Place;
use brickcast_volume::store::{Fault, FaultKind, Inspected, Progress, inspect_objects, inspect_series};
use serde_json::json;

use crate::cli::args::VerifyArgs;
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::{answer, print, tell};
use crate::cli::source::{is_series, place};
use crate::stored;
use crate::words::{bytes, short};

/// Broken parts of one file that are told one by one, unless `--json` asks for all.
const TOLD: usize = 8;

/// # Errors
/// Anything of the store is broken or missing, or its folder holds something that is not the store's.
pub fn run(args: &VerifyArgs, quiet: bool) -> Result<(), Failure> {
    let bar = Bar::new(&format!("reading {}", args.store.display()));
    let mut at = |p: Progress| bar.at(p.done, p.total);
    let (place, series) = (place(&args.store)?, is_series(&args.store)?);
    let folder = match &place {
        Place::Folder(folder) => Some(folder.as_path()),
        Place::Far(_) => None,
    };
    let found = match series {
        false => inspect_objects(stored::objects(&place)?, folder, &mut at)?,
        true => inspect_series(place.objects(), folder, &mut at)?,
    };
    bar.finish();
    let what = if series { "series" } else { "store" };
    let name = args.store.display().to_string();
    if args.json {
        print(&format!("{:#}\n", as_json(&name, &found)))?;
    } else {
        for line in lines(&found.faults) {
            tell(&format!("{line}\n"))?;
        }
    }
    if let Some(words) = summary(&found.faults) {
        return Err(anyhow!("{name}: {words}; copy what is broken or missing again, or prepare the store again").into());
    }
    if !args.json {
        let (hash, size) = (short(found.hash), bytes(found.bytes));
        answer(quiet, &format!("{name}: {what} {hash}, {size}: every byte is as the manifest says"))?;
        if !found.binds_chunks {
            let version = found.version.unwrap_or_default();
            let note = "renders would not notice where parts of another store take the place of its own later; prepare \
                        it again for that";
            answer(quiet, &format!("  of format version {version}: {note}"))?;
        }
    }
    Ok(())
}

fn as_json(name: &str, found: &Inspected) -> serde_json::Value {
    let fault = |f: &Fault| json!({ "kind": f.kind.name(), "file": f.file, "what": f.what });
    json!({
        "store": name,
        "hash": found.hash.to_string(),
        "version": found.version,
        "bytes": found.bytes,
        "binds_chunks": found.binds_chunks,
        "whole": found.faults.is_empty(),
        "faults": found.faults.iter().map(fault).collect::<Vec<_>>(),
    })
}

/// One for each fault, some for a file that has very many.
fn lines(faults: &[Fault]) -> Vec<String> {
    let mut of_file: HashMap<&str, usize> = HashMap::new();
    let mut lines = Vec::new();
    for (i, fault) in faults.iter().enumerate() {
        let count = of_file.entry(&fault.file).or_default();
        *count += 1;
        if *count <= TOLD {
            lines.push(format!("{:<8} {}: {}", fault.kind.name(), fault.file, fault.what));
        }
        let more = count.saturating_sub(TOLD);
        if more > 0 && faults.get(i + 1).is_none_or(|next| next.file != fault.file) {
            lines.push(format!(
                "{:<8} {}: and {more} more parts of it, all with --json",
                fault.kind.name(),
                fault.file
            ));
        }
    }
    lines
}

/// How many of each kind; nothing where there are none.
fn summary(faults: &[Fault]) -> Option<String> {
    let count = |kind| faults.iter().filter(|f| f.kind == kind).count();
    let kinds = [FaultKind::Broken, FaultKind::Missing, FaultKind::Foreign];
    let told = kinds.into_iter().map(|kind| (count(kind), kind.name())).filter(|(n, _)| *n > 0);
    let told: Vec<String> = told.map(|(n, name)| format!("{n} {name}")).collect();
    (!told.is_empty()).then(|| format!("parts of the store that are not as they should be: {}", told.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_told_and_a_file_in_shreds_is_not_told_a_thousand_times() {
        let fault = |kind, file: &str| Fault { kind, file: file.to_owned(), what: "x".to_owned() };
        let mut faults = vec![fault(FaultKind::Broken, "0/c/0/0/0"); 1000];
        faults.push(fault(FaultKind::Missing, "zarr.json"));
        faults.push(fault(FaultKind::Foreign, "notes.txt"));
        let lines = lines(&faults);
        assert_eq!(lines.len(), TOLD + 3);
        assert!(lines[TOLD].contains("and 992 more"), "{}", lines[TOLD]);
        assert!(lines[TOLD + 1].starts_with("missing  zarr.json"), "{}", lines[TOLD + 1]);
        assert!(summary(&faults).unwrap().ends_with("1000 broken, 1 missing, 1 foreign"));
        assert_eq!(summary(&[]), None);
    }
}
