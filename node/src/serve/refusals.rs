//! Refusals in the log: one line a minute at most, with counts. A flood must not fill the disk as well, nor hide what
//! else is said.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

/// Between one line and the next.
const PAUSE: Duration = Duration::from_secs(60);

/// Of all nodes of this process: they share a log.
static REFUSALS: Mutex<Refusals> = Mutex::new(Refusals::new());

#[derive(Debug)]
struct Refusals {
    counts: BTreeMap<&'static str, u64>,
    /// When the last line was written.
    told: Option<Instant>,
    /// Somebody sleeps until the next line may be.
    is_awaited: bool,
}

/// What is to be done after a refusal was counted.
#[derive(Debug, PartialEq)]
enum Next {
    Tell(String),
    Wait(Instant),
    Nothing,
}

impl Refusals {
    const fn new() -> Self {
        Self { counts: BTreeMap::new(), told: None, is_awaited: false }
    }

    fn count(&mut self, why: &'static str, now: Instant) -> Next {
        *self.counts.entry(why).or_default() += 1;
        match self.told {
            Some(told) if now < told + PAUSE && self.is_awaited => Next::Nothing,
            Some(told) if now < told + PAUSE => {
                self.is_awaited = true;
                Next::Wait(told + PAUSE)
            }
            _ => self.line(now).map_or(Next::Nothing, Next::Tell),
        }
    }

    /// All that was counted since the last line.
    fn line(&mut self, now: Instant) -> Option<String> {
        let counts = std::mem::take(&mut self.counts);
        if counts.is_empty() {
            return None;
        }
        self.told = Some(now);
        let words: Vec<String> = counts.into_iter().map(|(why, count)| format!("{count} x {why}")).collect();
        Some(format!("refused since the last such line, at most one a minute: {}", words.join(", ")))
    }
}

fn refusals() -> std::sync::MutexGuard<'static, Refusals> {
    REFUSALS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Counts a refusal for the log; `why` names its kind, not its operands.
pub(crate) fn refused(why: &'static str) {
    let next = refusals().count(why, Instant::now());
    match next {
        Next::Tell(line) => tracing::warn!("{line}"),
        Next::Wait(until) => match tokio::runtime::Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn(async move {
                tokio::time::sleep_until(until).await;
                let line = {
                    let mut refusals = refusals();
                    refusals.is_awaited = false;
                    refusals.line(Instant::now())
                };
                line.into_iter().for_each(|line| tracing::warn!("{line}"));
            })),
            Err(_) => refusals().is_awaited = false,
        },
        Next::Nothing => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_one_line_a_minute_with_its_counts() {
        let (mut refusals, start) = (Refusals::new(), Instant::now());
        let Next::Tell(line) = refusals.count("a frame too many", start) else { panic!("the first is told at once") };
        assert!(line.contains("1 x a frame too many"), "{line}");
        let second = Duration::from_secs(1);
        assert_eq!(refusals.count("a frame too many", start + second), Next::Wait(start + PAUSE));
        for i in 2..60 {
            assert_eq!(refusals.count("a connection too many", start + second * i), Next::Nothing, "{i}");
        }
        let line = refusals.line(start + PAUSE).unwrap();
        assert!(line.contains("1 x a frame too many, ") || line.contains(", 1 x a frame too many"), "{line}");
        assert!(line.contains("58 x a connection too many"), "{line}");
        refusals.is_awaited = false;
        assert_eq!(refusals.line(start + PAUSE), None);
        assert_eq!(refusals.count("x", start + PAUSE + second), Next::Wait(start + 2 * PAUSE));
        assert!(matches!(refusals.count("x", start + 3 * PAUSE), Next::Tell(_)));
    }
}
