//! A run as text for a terminal: a line per case, instead of it a block per case that needs an
//! explanation, and a summary.

mod details;
mod summary;

use std::fmt::Write as _;
use std::time::Duration;

use crate::run::{CaseRun, DeviceRun, Run};
use crate::style::{Style, printable};
use crate::verdict::{Grade, Outcome, Verdict};

pub use details::details;
pub use summary::summary;

/// The whole run: every line, every block that the grade of the run asks for, the summary.
pub fn report(run: &Run, style: Style) -> String {
    let mut text = String::new();
    for (device, case) in run.cases() {
        if case.outcome.is_not_run() {
            continue;
        }
        if wants_details(run, case.verdict()) {
            if !text.is_empty() && !text.ends_with("\n\n") {
                text.push('\n');
            }
            let _ = writeln!(text, "{}", details(device, case, style));
        } else {
            text.push_str(&case_line(device, case, style));
        }
    }
    if !text.is_empty() && !text.ends_with("\n\n") {
        text.push('\n');
    }
    text.push_str(&summary(run, style));
    text
}

/// Whether a case with this verdict is to be explained at the grade of `run`.
pub fn wants_details(run: &Run, verdict: Verdict) -> bool {
    match verdict {
        Verdict::Pass | Verdict::Skip => false,
        Verdict::Lenient => run.started.as_ref().is_some_and(|run| run.grade == Grade::Strict),
        Verdict::Fail | Verdict::Error => true,
    }
}

/// Verdict, device, name, time on the bus; of a skipped case the reason instead of the time.
pub fn case_line(device: &DeviceRun, case: &CaseRun, style: Style) -> String {
    let verdict = case.verdict();
    let mut line = String::new();
    let padded = format_args!("{verdict:<7}");
    let (device, name) = (one_line(&device.info.device), one_line(&case.info.name()));
    let _ = write!(line, "{}  {device}  {name}  ", style.verdict(verdict, padded));
    let _ = match &case.outcome {
        Outcome::Skip(reason) => writeln!(line, "{}", style.dim(one_line(reason))),
        _ => writeln!(line, "{}", style.dim(time(case.duration()))),
    };
    line
}

/// Seconds from one second on, milliseconds below: an expedited transfer takes 0.3 ms.
fn time(span: Duration) -> String {
    match (span.as_secs(), span.subsec_micros()) {
        (0, micros) => format!("{}.{} ms", micros / 1_000, micros / 100 % 10),
        (seconds, micros) => format!("{seconds}.{:03} s", micros / 1_000),
    }
}

/// `text` with its line ends as spaces.
fn one_line(text: &str) -> String {
    printable(text).replace('\n', " ")
}

/// `noun` for that many.
fn plural(count: u64, noun: &str) -> String {
    if count == 1 { noun.into() } else { format!("{noun}s") }
}
