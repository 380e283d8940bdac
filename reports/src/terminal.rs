//! A run as text for a terminal: a line or a block per case, and a summary.
//!
//! Colours, columns and the choice of what to show belong here. What several reports say in the
//! same words belongs to the modules beside this one.

mod details;
mod summary;

use std::fmt::Write as _;
use std::time::Duration;

use crate::fact::Explained;
use crate::run::{CaseRun, DeviceRun, Run};
use crate::style::{Style, printable};
use crate::verdict::{Outcome, Problem, Verdict};

pub use details::details;
pub use summary::summary;

/// How much is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// The summary only, without the reasons of skipped cases.
    Quiet,
    /// Shows every case that did not pass; skipped cases are counted by reason in the summary.
    #[default]
    Normal,
    /// A line or a block for each case, and the figures that it measured.
    Verbose,
}

/// Prints cases in the order in which they end.
#[derive(Debug)]
pub struct Printer {
    style: Style,
    verbosity: Verbosity,
    /// The facts that were explained.
    explained: Explained,
    /// The hint on how to see more of LENIENT and FLAKY cases was printed.
    hinted: bool,
    last: Last,
}

/// The kind of the last output: it decides where a blank line belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Last {
    Nothing,
    Line,
    Block,
}

impl Printer {
    /// Has printed nothing yet.
    pub const fn new(style: Style, verbosity: Verbosity) -> Self {
        Self { style, verbosity, explained: Explained::new(), hinted: false, last: Last::Nothing }
    }

    /// The text of a case that has ended; empty when nothing must be printed.
    pub fn case(&mut self, run: &Run, device: &DeviceRun, case: &CaseRun) -> String {
        let verdict = case.verdict();
        // The summary counts the cases that were not run.
        if case.outcome.is_not_run()
            || self.verbosity == Verbosity::Quiet
            || verdict.is_usual() && self.verbosity < Verbosity::Verbose
        {
            return String::new();
        }
        // It has as much to show, and may be green.
        let is_mild = matches!(verdict, Verdict::Lenient | Verdict::Flaky);
        let in_full = run.is_red(verdict) || is_mild && self.verbosity == Verbosity::Verbose;
        let block = in_full && !self.is_explained(device, case);
        let mut text = String::new();
        if self.last == Last::Block || block && self.last == Last::Line {
            text.push('\n');
        }
        self.last = if block { Last::Block } else { Last::Line };
        match block {
            true => text.push_str(&details(device, case, self.style)),
            false => text.push_str(&case_line(device, case, self.style)),
        }
        if is_mild && !block && !std::mem::replace(&mut self.hinted, true) {
            text.push_str("         -v shows its steps and frames\n");
        }
        if !block && self.verbosity == Verbosity::Verbose {
            for figures in case.record().measured.iter().map(details::figures) {
                let _ = writeln!(text, "         {}", one_line(&figures.replace('\n', "; ")));
            }
        }
        text
    }

    /// The summary, separated from the text before it.
    pub fn summary(&mut self, run: &Run) -> String {
        let summary = summary(run, self.style, self.verbosity);
        match std::mem::replace(&mut self.last, Last::Nothing) {
            Last::Nothing => summary,
            Last::Line | Last::Block => format!("\n{summary}"),
        }
    }

    /// Whether a case that shows the same fact was printed in full. A device that does not send its
    /// boot-up message, say, fails many cases, and the first one explains them all.
    fn is_explained(&mut self, device: &DeviceRun, case: &CaseRun) -> bool {
        self.explained.takes(device, case) && self.verbosity < Verbosity::Verbose
    }
}

/// The whole run at [`Verbosity::Verbose`].
pub fn report(run: &Run, style: Style) -> String {
    let mut printer = Printer::new(style, Verbosity::Verbose);
    let mut text: String =
        run.cases().map(|(device, case)| printer.case(run, device, case)).collect();
    text.push_str(&printer.summary(run));
    text
}

/// Verdict, device, name, and the time on the bus or what came instead of a PASS.
pub fn case_line(device: &DeviceRun, case: &CaseRun, style: Style) -> String {
    let verdict = case.verdict();
    let mut line = String::new();
    let padded = format_args!("{verdict:<7}");
    let info = &device.info;
    let (device, name) = (one_line(&info.device), one_line(&case.info.name()));
    let _ = write!(line, "{}  {device}  {name}  ", style.verdict(verdict, padded));
    let rest = match &case.outcome {
        Outcome::Pass => time(case.duration()),
        Outcome::Lenient(problem) | Outcome::Fail(problem) => came_instead(problem),
        Outcome::Flaky { problem, .. } => {
            format!("{} {}", case.outcome.times().unwrap_or_default(), came_instead(problem))
        }
        Outcome::Error { problem: Some(problem), .. } => came_instead(problem),
        Outcome::Skip(reason)
        | Outcome::Blocked(reason)
        | Outcome::Undecided(reason)
        | Outcome::Error { reason, .. } => reason.clone(),
        Outcome::Waived { waiver, .. } => waiver.to_string(),
    };
    let _ = writeln!(line, "{}", style.dim(one_line(&info.objects.in_text(&rest))));
    line
}

/// `expected 5, came 6`, of several lines the first.
pub(crate) fn came_instead(problem: &Problem) -> String {
    let first = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    format!("expected {}, came {}", first(&problem.expected), first(&problem.actual))
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
