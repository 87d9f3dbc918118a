//! Test programs that find out while they run what they can test: a driver, Docker, other programs, the sample volumes.
//!
//! The standard harness knows only tests that pass and tests that fail, and what is ignored before anything runs. A
//! program whose `main` is [`main`] has one outcome more: what a test could not try is in its line, `ignored (no GPU
//! driver)`, and in the summary's `N ignored`. Filters and flags are the usual ones (`libtest-mimic`), and so is what
//! one sees: what tests say goes to standard error, which is shown for failures only, or always with `--nocapture`.
//!
//! Where `BRICKCAST_REQUIRE_ALL` is set, in CI, whatever is missing fails the test. `BRICKCAST_TEST_TIMES` names a file
//! to which each test's seconds are added.

mod said;

use std::cell::RefCell;
use std::fmt::Display;
use std::fs::File;
use std::io::Write as _;
use std::panic::{catch_unwind, resume_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use libtest_mimic::{Arguments, Completion, Failed, Trial};

pub use brickcast_harness_attribute::test;
pub use inventory;

use said::Said;

/// A function that `#[test]` has listed.
#[derive(Debug)]
pub struct Test {
    /// With the program's name in front.
    pub path: &'static str,
    pub is_ignored: bool,
    pub run: fn(),
}

inventory::collect!(Test);

/// How a test ends that cannot try anything.
struct Ignored(String);

thread_local! {
    /// What the test of this thread could not try; `None` in threads that are no test's own.
    static LEFT_OUT: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// The program's `main`: runs the tests that the command line asks for.
#[must_use]
pub fn main() -> ExitCode {
    main_of_threads(1)
}

/// As [`main`], with at least so many tests at a time where nobody says otherwise: tests that wait for time to pass
/// more than they compute.
#[must_use]
pub fn main_of_threads(least: usize) -> ExitCode {
    let mut arguments = Arguments::from_args();
    let from_environment = || std::env::var("RUST_TEST_THREADS").ok()?.parse().ok();
    let processors = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    arguments.test_threads = arguments.test_threads.or_else(from_environment).or_else(|| Some(processors().max(least)));
    let is_shown = arguments.nocapture || arguments.list || std::env::var_os("RUST_TEST_NOCAPTURE").is_some();
    let said = if is_shown { None } else { Said::capture().map(Arc::new) };
    let mut tests: Vec<&Test> = inventory::iter::<Test>().collect();
    tests.sort_by_key(|test| test.path);
    libtest_mimic::run(&arguments, tests.into_iter().map(|test| trial(test, said.clone())).collect()).exit_code()
}

/// Ends the test of this thread as ignored: it cannot try anything here.
///
/// # Panics
/// Where `BRICKCAST_REQUIRE_ALL` is set.
pub fn ignore(reason: impl Display) -> ! {
    refuse(&reason);
    ignore_anyway(reason)
}

/// As [`ignore`], for what is no lack of the machine, such as a GPU where the test is of machines without: it fails
/// nowhere.
pub fn ignore_anyway(reason: impl Display) -> ! {
    // No panic: nothing is printed, and no hook is called.
    resume_unwind(Box::new(Ignored(reason.to_string())))
}

/// Notes that the test of this thread leaves something out, and goes on; if all else holds, it is ignored in part.
///
/// # Panics
/// Where `BRICKCAST_REQUIRE_ALL` is set, and in a thread that is no test's own, whose note would be lost.
pub fn leave_out(reason: impl Display) {
    refuse(&reason);
    not_tried(reason);
}

/// As [`leave_out`], for what is no lack of the machine but how tests were started: it fails nowhere.
///
/// # Panics
/// In a thread that is no test's own.
pub fn not_tried(reason: impl Display) {
    LEFT_OUT.with_borrow_mut(|left_out| match left_out {
        Some(reasons) if reasons.contains(&reason.to_string()) => {}
        Some(reasons) => reasons.push(reason.to_string()),
        None => panic!("only a test's own thread can leave out: {reason}"),
    });
}

fn refuse(reason: &impl Display) {
    assert!(std::env::var_os("BRICKCAST_REQUIRE_ALL").is_none(), "BRICKCAST_REQUIRE_ALL is set: {reason}");
}

fn trial(test: &'static Test, said: Option<Arc<Said>>) -> Trial {
    let name = test.path.split_once("::").map_or(test.path, |(_program, name)| name);
    let run = move || {
        let from = said.as_ref().map_or(0, |said| said.len());
        let started = Instant::now();
        let outcome = outcome(name, test.run);
        tell_time(test.path, started.elapsed());
        outcome.map_err(|Failure| match said {
            Some(said) => Failed::from(format!("said meanwhile, by tests beside it, too:\n{}", said.since(from))),
            None => Failed::without_message(),
        })
    };
    Trial::ignorable_test(name, run).with_ignored_flag(test.is_ignored)
}

/// Where `BRICKCAST_TEST_TIMES` names a file, a line in it: seconds and name.
fn tell_time(name: &str, took: Duration) {
    let Some(path) = std::env::var_os("BRICKCAST_TEST_TIMES") else { return };
    let line = format!("{:8.2} {name}\n", took.as_secs_f64());
    let file = File::options().append(true).create(true).open(&path);
    // At once, so that lines of several programs do not mix.
    if let Err(error) = file.and_then(|mut file| file.write_all(line.as_bytes())) {
        eprintln!("{}: {error}", Path::new(&path).display());
    }
}

struct Failure;

/// In a thread of its own, as the standard harness does: panics name the test, and it has its own thread locals.
fn outcome(name: &str, run: fn()) -> Result<Completion, Failure> {
    let own = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
        LEFT_OUT.set(Some(Vec::new()));
        (catch_unwind(run), LEFT_OUT.take().unwrap_or_default())
    });
    match own.map_err(drop).and_then(|thread| thread.join().map_err(drop)) {
        Ok((Ok(()), left_out)) if left_out.is_empty() => Ok(Completion::Completed),
        Ok((Ok(()), left_out)) => Ok(Completion::ignored_with(format!("in part: {}", left_out.join("; ")))),
        Ok((Err(payload), _)) if payload.is::<Ignored>() => {
            let reason = payload.downcast::<Ignored>().map(|ignored| ignored.0);
            Ok(Completion::Ignored { reason: reason.ok() })
        }
        Ok((Err(_), _)) | Err(()) => Err(Failure),
    }
}

#[cfg(test)]
mod tests {
    use super::{Completion, Failure, catch_unwind, ignore, ignore_anyway, leave_out, not_tried, outcome};

    /// The outcome in words.
    fn ended(run: fn()) -> String {
        match outcome("a_test", run) {
            Ok(Completion::Completed) => "ok".to_owned(),
            Ok(Completion::Ignored { reason }) => format!("ignored: {}", reason.unwrap_or_default()),
            Err(Failure) => "failed".to_owned(),
        }
    }

    #[test]
    fn what_a_test_could_not_try_is_its_outcome() {
        assert_eq!(ended(|| {}), "ok");
        assert_eq!(ended(|| panic!("as tests do")), "failed");
        // In CI nothing may be missing.
        let required = std::env::var_os("BRICKCAST_REQUIRE_ALL").is_some();
        let unless_required = |outcome| if required { "failed".to_owned() } else { outcome };
        assert_eq!(ended(|| ignore("no Docker")), unless_required("ignored: no Docker".to_owned()));
        assert_eq!(ended(|| ignore_anyway("there is a GPU")), "ignored: there is a GPU");
        let in_part = || {
            leave_out("no driver");
            leave_out("no driver");
            leave_out("no volume");
        };
        assert_eq!(ended(in_part), unless_required("ignored: in part: no driver; no volume".to_owned()));
        assert_eq!(ended(|| not_tried("SIGHUP is ignored here")), "ignored: in part: SIGHUP is ignored here");
        // What fails otherwise fails.
        let in_vain = || {
            leave_out("no driver");
            panic!("as tests do");
        };
        assert_eq!(ended(in_vain), "failed");
    }

    #[test]
    fn a_note_that_nobody_would_read_is_a_failure() {
        assert!(catch_unwind(|| leave_out("no driver")).is_err());
        assert_eq!(ended(|| std::thread::scope(|s| drop(s.spawn(|| leave_out("no driver"))))), "failed");
    }
}
