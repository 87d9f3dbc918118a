//! Refusals in the log: the first of its kind from an address at once, those that follow summed, one line in
//! [`PAUSE`]. A flood must not fill the disk as well, nor hide what else is said.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::clients::Client;

/// Between one line of a kind and an address, and the next.
const PAUSE: Duration = Duration::from_secs(10);
/// Kinds and addresses that are told apart; those of further addresses are summed by kind.
const TOLD_APART: usize = 32;

/// Of all nodes of this process: they share a log.
static REFUSALS: Mutex<Refusals> = Mutex::new(Refusals::new());

/// What was refused; without a client, to all those that are not told apart.
type Key = (&'static str, Option<Client>);

#[derive(Debug)]
struct Refusals {
    known: BTreeMap<Key, Entry>,
    /// Until when somebody sleeps to tell what was counted.
    awaited: Option<Instant>,
}

#[derive(Debug)]
struct Entry {
    /// When it was last told.
    told: Instant,
    /// Since then, and what was known of the last.
    count: u64,
    detail: String,
}

/// A line of the log.
#[derive(Debug, PartialEq)]
struct Line {
    key: Key,
    count: u64,
    detail: String,
}

impl Refusals {
    const fn new() -> Self {
        Self { known: BTreeMap::new(), awaited: None }
    }

    /// What is to be told now; [`Refusals::due`] tells the rest.
    fn count(&mut self, why: &'static str, client: Client, detail: String, now: Instant) -> Option<Line> {
        self.known.retain(|_, entry| entry.count > 0 || now < entry.told + PAUSE);
        let mut key = (why, Some(client));
        if self.known.len() >= TOLD_APART && !self.known.contains_key(&key) {
            key = (why, None);
        }
        if let Some(entry) = self.known.get_mut(&key) {
            (entry.count, entry.detail) = (entry.count + 1, detail);
            return (now >= entry.told + PAUSE).then(|| entry.line(key, now));
        }
        self.known.insert(key, Entry { told: now, count: 0, detail: String::new() });
        Some(Line { key, count: 1, detail })
    }

    /// The lines whose time has come, and when the next one's does.
    fn due(&mut self, now: Instant) -> (Vec<Line>, Option<Instant>) {
        let counted = self.known.iter_mut().filter(|(_, entry)| entry.count > 0);
        let (mut lines, mut next) = (Vec::new(), None::<Instant>);
        for (key, entry) in counted {
            let at = entry.told + PAUSE;
            if now >= at {
                lines.push(entry.line(*key, now));
            } else {
                next = Some(next.map_or(at, |next| next.min(at)));
            }
        }
        (lines, next)
    }

    /// When a sleeper is wanted that there is none of. One whose time is long over went with its runtime.
    fn wants_sleeper(&mut self, now: Instant) -> Option<Instant> {
        if self.awaited.is_some_and(|until| now < until + PAUSE) {
            return None;
        }
        let counted = self.known.values().filter(|entry| entry.count > 0);
        self.awaited = counted.map(|entry| entry.told + PAUSE).min();
        self.awaited
    }
}

impl Entry {
    fn line(&mut self, key: Key, now: Instant) -> Line {
        self.told = now;
        Line { key, count: std::mem::take(&mut self.count), detail: std::mem::take(&mut self.detail) }
    }
}

impl Line {
    fn tell(&self) {
        let (why, client) = self.key;
        let client = client.map_or_else(|| "others".to_owned(), |client| client.to_string());
        let (client, count, detail) = (client.as_str(), self.count, self.detail.as_str());
        if detail.is_empty() {
            tracing::warn!(client, count, "refused: {why}");
        } else {
            tracing::warn!(client, count, detail, "refused: {why}");
        }
    }
}

fn refusals() -> std::sync::MutexGuard<'static, Refusals> {
    REFUSALS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Counts a refusal for the log; `why` names its kind, `detail` what is particular of this one.
pub(crate) fn refused(why: &'static str, client: Client, detail: impl Into<String>) {
    let now = Instant::now();
    let (line, sleep) = {
        let mut refusals = refusals();
        (refusals.count(why, client, detail.into(), now), refusals.wants_sleeper(now))
    };
    line.iter().for_each(Line::tell);
    if let (Some(until), Ok(runtime)) = (sleep, tokio::runtime::Handle::try_current()) {
        runtime.spawn(tell_later(until));
    }
}

/// Until nothing is left to tell.
async fn tell_later(mut until: Instant) {
    loop {
        tokio::time::sleep_until(until).await;
        let (lines, next) = {
            let mut refusals = refusals();
            let due = refusals.due(Instant::now());
            refusals.awaited = due.1;
            due
        };
        lines.iter().for_each(Line::tell);
        match next {
            Some(next) => until = next,
            None => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::{IpAddr, Ipv4Addr};

    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn client(last: u8) -> Client {
        Some(IpAddr::V4(Ipv4Addr::new(10, 0, 0, last))).into()
    }

    fn line(why: &'static str, client: Client, count: u64, detail: &str) -> Line {
        Line { key: (why, Some(client)), count, detail: detail.to_owned() }
    }

    #[test]
    fn a_flood_is_one_line_in_ten_seconds_with_its_count() {
        let (mut refusals, start) = (Refusals::new(), Instant::now());
        let first = refusals.count("a frame too many", client(1), "first".to_owned(), start);
        assert_eq!(first, Some(line("a frame too many", client(1), 1, "first")), "told at once");
        for i in 1..10 {
            let at = start + SECOND * i;
            assert_eq!(refusals.count("a frame too many", client(1), i.to_string(), at), None, "{i}");
        }
        // Another kind, and another address, are not hidden by it.
        let other = start + SECOND * 5;
        assert!(refusals.count("wrong token", client(1), String::new(), other).is_some());
        assert!(refusals.count("a frame too many", client(2), String::new(), other).is_some());
        assert_eq!(refusals.due(start + SECOND * 9), (Vec::new(), Some(start + PAUSE)));
        let summed = vec![line("a frame too many", client(1), 9, "9")];
        assert_eq!(refusals.due(start + PAUSE), (summed, None));
        assert_eq!(refusals.due(start + PAUSE * 3), (Vec::new(), None));
        // After a pause without any, the next is told at once.
        let again = refusals.count("a frame too many", client(1), String::new(), start + PAUSE * 3);
        assert_eq!(again, Some(line("a frame too many", client(1), 1, "")));
    }

    #[test]
    fn many_addresses_are_summed_and_take_no_more_memory() {
        let (mut refusals, now) = (Refusals::new(), Instant::now());
        let told = (0..=255).filter_map(|last| refusals.count("wrong token", client(last), String::new(), now)).count();
        assert_eq!(told, TOLD_APART + 1, "each of the first, and one of all others");
        assert_eq!(refusals.known.len(), TOLD_APART + 1);
        let (lines, _) = refusals.due(now + PAUSE);
        let others = 256 - TOLD_APART as u64 - 1;
        assert_eq!(lines, [Line { key: ("wrong token", None), count: others, detail: String::new() }]);
    }

    #[test]
    fn one_sleeper_tells_the_rest_and_one_that_is_lost_is_replaced() {
        let (mut refusals, now) = (Refusals::new(), Instant::now());
        refusals.count("x", client(1), String::new(), now);
        assert_eq!(refusals.wants_sleeper(now), None, "nothing is left to tell");
        refusals.count("x", client(1), String::new(), now + SECOND);
        assert_eq!(refusals.wants_sleeper(now + SECOND), Some(now + PAUSE));
        refusals.count("x", client(1), String::new(), now + SECOND * 2);
        assert_eq!(refusals.wants_sleeper(now + SECOND * 2), None, "there is one");
        let late = now + PAUSE * 2;
        assert!(refusals.wants_sleeper(late).is_some(), "it went with its runtime");
        assert!(refusals.count("x", client(1), String::new(), late).is_some_and(|line| line.count == 3));
    }
}
