//! Signals that end the program: what it has begun to write is removed first.

use std::io::Write as _;

use brickcast_volume::leftovers::{self, Cleared};
use brickcast_volume::shown::shown;

/// From now on INT, TERM and HUP end the process with 128 and their number, after everything unfinished is off the
/// disk. What was ignored from the start (`nohup`) stays ignored.
///
/// # Errors
/// The system refuses a thread or a handler.
#[cfg(unix)]
pub fn watch() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};

    let ignored = ignored();
    let wanted =
        [(SignalKind::interrupt(), "SIGINT"), (SignalKind::terminate(), "SIGTERM"), (SignalKind::hangup(), "SIGHUP")];
    let wanted = wanted.into_iter().filter(|(kind, _)| ignored >> (kind.as_raw_value() - 1) & 1 == 0);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let listening = {
        let _here = runtime.enter();
        let listen = |(kind, name)| Ok((signal(kind)?, kind.as_raw_value(), name));
        wanted.map(listen).collect::<std::io::Result<Vec<_>>>()?
    };
    let wait = move || {
        let first = runtime.block_on(async {
            let each = listening.into_iter().map(|(mut signal, number, name)| {
                Box::pin(async move {
                    match signal.recv().await {
                        Some(()) => (number, name),
                        None => std::future::pending().await,
                    }
                })
            });
            let each: Vec<_> = each.collect();
            match each.is_empty() {
                true => std::future::pending().await,
                false => futures_util::future::select_all(each).await.0,
            }
        });
        end(first);
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(wait).map(drop)
}

/// # Errors
/// None here.
#[cfg(not(unix))]
pub fn watch() -> std::io::Result<()> {
    Ok(())
}

#[cfg(unix)]
fn end((number, name): (i32, &str)) -> ! {
    let text = last_words(name, &leftovers::clear());
    // A closed stderr is no reason to stay.
    writeln!(std::io::stderr(), "{text}").ok();
    // SAFETY: always safe to call. Not `exit`: that runs what drivers have registered, while their threads still work.
    unsafe { libc::_exit(128 + number) }
}

/// What became of what was not finished.
#[cfg(unix)]
fn last_words(name: &str, cleared: &Cleared) -> String {
    let left = cleared.left.iter().map(|(path, error)| format!("{} could not be removed: {error}", path.display()));
    let left: Vec<_> = match cleared.left.is_empty() {
        true => vec!["nothing half-written is left".to_owned()],
        false => left.collect(),
    };
    let all: Vec<_> =
        std::iter::once(format!("ended by {name}")).chain(cleared.kept.iter().cloned()).chain(left).collect();
    format!("brickcast: {}", shown(&all.join("; ")))
}

/// The signals that this process ignores, a bit each from 1 on; none where the system does not tell.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = brickcast_volume::small_file::system_text("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_stays_after_a_signal_is_told() {
        let none = Cleared::default();
        assert_eq!(last_words("SIGINT", &none), "brickcast: ended by SIGINT; nothing half-written is left");
        let kept = vec!["a.apng keeps the 3 of 9 frames that were done".to_owned()];
        let words = last_words("SIGTERM", &Cleared { kept, left: Vec::new() });
        assert!(
            words.contains("SIGTERM; a.apng keeps the 3 of 9 frames that were done; nothing half-written"),
            "{words}"
        );
        let left = vec![("x/.s.brickcast-tmp-1-0".into(), std::io::ErrorKind::PermissionDenied.into())];
        let words = last_words("SIGINT", &Cleared { kept: Vec::new(), left });
        assert!(words.contains(".s.brickcast-tmp-1-0 could not be removed: ") && !words.contains("nothing"), "{words}");
    }
}
