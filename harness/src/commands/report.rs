//! `harness report`: writes reports from the journals of runs.

use reports::terminal::{Printer, Verbosity};
use reports::{Event, Run, Style, compared, merged};
use runner::plan::is_named;

use super::recorded::{for_each_event, narrow, recorded};
use crate::cli::RenderArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::{render, say_report};

/// Writes what is asked for, or prints what a run prints.
///
/// # Errors
/// When a journal cannot be read, or a report cannot be written.
pub(super) fn run(args: &RenderArgs) -> Result<Exit, Refused> {
    let runs = args.journals.iter().map(|path| recorded(path));
    let runs: Vec<Run> = runs.collect::<Result<_, _>>()?;
    for (run, path) in runs.iter().zip(&args.journals).filter(|(run, _)| run.ended.is_none()) {
        let cases = run.counts().total();
        complain!("note: the run of {} was cut off after {cases} cases", path.display());
    }
    let mut run = merged(runs);
    let earlier = args.against.iter().map(|path| recorded(path));
    let earlier: Vec<Run> = earlier.collect::<Result<_, _>>()?;
    run.comparison = (!earlier.is_empty()).then(|| compared(&run, &merged(earlier)));
    let regression = run.comparison.as_ref().is_some_and(|it| it.is_regression);
    let exit = if regression { Exit::Regression } else { Exit::Green };
    let reports = &args.reports;
    if reports.formats.is_empty() && reports.recordings.is_empty() {
        if let Some(pattern) = &args.case {
            narrow([&mut run].into_iter(), pattern)?;
        }
        let verbosity = if args.verbose { Verbosity::Verbose } else { Verbosity::Normal };
        let mut printer = Printer::new(Style { color: args.color.colours() }, verbosity);
        let cases: String =
            run.cases().map(|(device, case)| printer.case(&run, device, case)).collect();
        match &run.comparison {
            // What is not different is known.
            Some(comparison) => say_report(&comparison.text()),
            None => say_report(&(cases + &printer.summary(&run))),
        }
        return Ok(exit);
    }
    let mut chosen = Chosen { pattern: args.case.as_deref(), is_in: args.case.is_none() };
    render(&args.journals, reports, &run, |record| {
        args.journals.iter().try_for_each(|path| {
            for_each_event(path, |_, event| match chosen.has(&event) {
                true => record(&event),
                false => Ok(()),
            })
        })
    })?;
    // Whatever the reports say: an exit code needs a word.
    if let Some(comparison) = &run.comparison {
        say_report(&comparison.last_line());
    }
    Ok(exit)
}

/// The cases that are recorded.
struct Chosen<'a> {
    pattern: Option<&'a str>,
    /// Whether the present frame is recorded.
    is_in: bool,
}

impl Chosen<'_> {
    fn has(&mut self, event: &Event) -> bool {
        let Some(pattern) = self.pattern else { return true };
        match event {
            Event::CaseStarted(case) => {
                self.is_in = is_named(pattern, &case.name());
                self.is_in
            }
            Event::CaseEnded(_) => std::mem::replace(&mut self.is_in, false),
            Event::Frame(_) => self.is_in,
            _ => true,
        }
    }
}
