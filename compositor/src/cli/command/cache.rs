//! `brickcast cache`: what was prepared on the way, listed and removed.

use std::time::SystemTime;

use anyhow::anyhow;
use comfy_table::Table;
use serde_json::json;

use crate::cache::{Item, Removal};
use crate::cli::args::{CacheArgs, CacheClearArgs, CacheCommand, CacheCommandArgs, CacheListArgs};
use crate::cli::failure::Failure;
use crate::cli::say::{print, say, tell};
use crate::words::bytes;

/// # Errors
/// A folder that cannot be read, or is someone else's; what was named and is not there, or stays.
pub fn run(args: &CacheCommandArgs, quiet: bool) -> Result<(), Failure> {
    match &args.command {
        CacheCommand::List(args) => list(args),
        CacheCommand::Clear(args) => clear(args, quiet),
    }
}

fn list(args: &CacheListArgs) -> Result<(), Failure> {
    let folder = args.cache.folder();
    // Opening would make it.
    let items = if folder.is_dir() { args.cache.open()?.items() } else { Vec::new() };
    let total: u64 = items.iter().map(|item| item.bytes).sum();
    let limit = args.cache.limit()?;
    if args.json {
        let report = json!({
            "folder": folder.display().to_string(),
            "bytes": total,
            "limit": limit,
            "entries": items.iter().map(entry_json).collect::<Vec<_>>(),
        });
        return print(&format!("{report:#}\n"));
    }
    if items.is_empty() {
        return tell(&format!("{}: nothing lies in the cache\n", folder.display()));
    }
    let mut table = Table::new();
    table.set_header(["entry", "made of", "size", "last used"]);
    for item in &items {
        let used = if item.in_use { "in use".to_owned() } else { ago(item.used) };
        table.add_row([item.name.clone(), item.input().to_owned(), bytes(item.bytes), used]);
    }
    let (count, sum) = (counted(items.len()), bytes(total));
    tell(&format!("{table}\n{}: {count}, {sum} of {} (--cache-size)\n", folder.display(), bytes(limit)))
}

fn entry_json(item: &Item) -> serde_json::Value {
    json!({
        "name": item.name,
        "store": item.path.display().to_string(),
        "input": item.input(),
        "bytes": item.bytes,
        "last_used": humantime::format_rfc3339_seconds(item.used).to_string(),
        "in_use": item.in_use,
    })
}

fn clear(args: &CacheClearArgs, quiet: bool) -> Result<(), Failure> {
    let folder = args.cache.folder();
    if !folder.is_dir() {
        missing(&args.what, &args.cache)?;
        return say(quiet, &format!("{}: nothing lies in the cache", folder.display()));
    }
    let cache = args.cache.open()?;
    let items = cache.items();
    let unknown: Vec<String> =
        args.what.iter().filter(|what| !items.iter().any(|item| item.is_named(what))).cloned().collect();
    missing(&unknown, &args.cache)?;
    let is_old = |item: &&Item| args.older_than.is_none_or(|age| item.used.elapsed().is_ok_and(|unused| unused >= age));
    let is_wanted = |item: &&Item| args.what.is_empty() || args.what.iter().any(|what| item.is_named(what));
    let wanted: Vec<&Item> = items.iter().filter(is_wanted).filter(is_old).collect();
    let (mut freed, mut gone, mut stay) = (0, 0, Vec::new());
    for (item, removal) in cache.clear(&wanted)? {
        let why = match removal {
            Removal::Done => {
                (freed, gone) = (freed + item.bytes, gone + 1);
                say(quiet, &format!("removed {} ({}, {})", item.name, bytes(item.bytes), item.input()))?;
                continue;
            }
            Removal::InUse => "a process uses it",
            Removal::Foreign => "it cannot be removed, or holds other files than a store's",
        };
        stay.push(format!("{} stays: {why}", item.path.display()));
    }
    say(quiet, &format!("{}: freed {}, {}", folder.display(), bytes(freed), counted(gone)))?;
    if !args.what.is_empty() && !stay.is_empty() {
        return Err(anyhow!("{}", stay.join("; ")).into());
    }
    stay.iter().for_each(|line| tracing::warn!("{line}"));
    Ok(())
}

/// # Errors
/// Something is asked for that is not there.
fn missing(what: &[String], cache: &CacheArgs) -> Result<(), Failure> {
    match what.first() {
        None => Ok(()),
        Some(first) => Err(anyhow!(
            "{first}: nothing in the cache {} has that name or was made of it; brickcast cache list shows what \
             is there",
            cache.folder().display()
        )
        .into()),
    }
}

fn counted(entries: usize) -> String {
    format!("{entries} {}", if entries == 1 { "entry" } else { "entries" })
}

/// For people: the largest unit is enough.
fn ago(then: SystemTime) -> String {
    let minutes = then.elapsed().map_or(0, |since| since.as_secs() / 60);
    let (count, unit) = match minutes {
        0 => return "now".to_owned(),
        1..60 => (minutes, "minute"),
        60..1440 => (minutes / 60, "hour"),
        _ => (minutes / 1440, "day"),
    };
    format!("{count} {unit}{} ago", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn times_are_told_in_their_largest_unit() {
        let of = |seconds| ago(SystemTime::now() - Duration::from_secs(seconds));
        assert_eq!([of(3), of(61), of(7300), of(90_000)], ["now", "1 minute ago", "2 hours ago", "1 day ago"]);
    }
}
