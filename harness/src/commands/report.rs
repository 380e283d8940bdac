//! `harness report`: writes reports from the journals of runs.

use std::path::Path;

use reports::terminal::{Printer, Verbosity};
use reports::{Event, Origin, Outcome, Run, Style, compared, merged};
use runner::plan::is_named;
use runner::suite::{Register, fingerprint_of};
use runner::waivers::Waivers;

use super::recorded::{for_each_event, narrow, recorded};
use super::used::of_bytes;
use crate::bus::unix_time;
use crate::cli::RenderArgs;
use crate::exit::{Exit, Refused};
use crate::files::{Blocks, LARGEST_JOURNAL, read_source, shown};
use crate::reporter::{harmless, render, say_report};
use crate::source::Complaint;

/// Writes what is asked for, or prints what a run prints.
///
/// # Errors
/// When a journal cannot be read, or a report cannot be written.
pub(super) fn run(args: &RenderArgs) -> Result<Exit, Refused> {
    let runs = args.journals.iter().map(|path| named(path));
    let runs: Vec<Run> = runs.collect::<Result<_, _>>()?;
    for (run, path) in runs.iter().zip(&args.journals).filter(|(run, _)| run.ended.is_none()) {
        let cases = run.counts().total();
        complain!("note: the run of {} was cut off after {cases} cases", path.display());
    }
    let mut run = merged(runs);
    let outdated = match &args.waivers {
        Some(path) => waived(&mut run, path, args.today.clone())?,
        None => false,
    };
    let earlier = args.against.iter().map(|path| named(path));
    let earlier: Vec<Run> = earlier.collect::<Result<_, _>>()?;
    run.comparison = (!earlier.is_empty()).then(|| compared(&run, &merged(earlier)));
    let regression = run.comparison.as_ref().is_some_and(|it| it.is_regression);
    let exit = match (regression, outdated) {
        (true, _) => Exit::Regression,
        (false, true) => Exit::Waivers,
        (false, false) => Exit::Green,
    };
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

/// The run of a journal, with the journal's fingerprint: whoever has the file may have changed it.
fn named(path: &Path) -> Result<Run, Refused> {
    let mut run = recorded(path)?;
    if let Ok(blocks) = Blocks::open(path, LARGEST_JOURNAL) {
        let sha256 = fingerprint_of(blocks.map_while(Result::ok));
        run.journals = vec![Origin { from: shown(path), sha256 }];
    }
    Ok(run)
}

/// Waives what the run found, as if it had been made with these waivers and no others; whether some
/// of them are out of date, which is said.
fn waived(run: &mut Run, path: &Path, today: Option<String>) -> Result<bool, Refused> {
    let today = today.unwrap_or_else(|| reports::date(unix_time()));
    let source = read_source(path)?;
    let origin = of_bytes(&source.name, source.text.as_bytes());
    // A requirement need not be known here.
    let waivers = Waivers::read(source, &today, &Register::default())?;
    for device in &mut run.devices {
        let name = &device.info.device;
        for case in device.suites.iter_mut().flat_map(|suite| &mut suite.cases) {
            let found = match std::mem::replace(&mut case.outcome, Outcome::Pass) {
                Outcome::Waived { outcome, .. } => *outcome,
                found => found,
            };
            case.outcome = waivers.apply(name, &case.info, found);
        }
    }
    let names: Vec<String> = run.cases().map(|(_, case)| case.info.name()).collect();
    let selected = run.started.as_ref().is_some_and(|started| started.selected);
    let complaints = waivers.out_of_date(run, &names, selected);
    let is_green = run.is_green();
    run.started.iter_mut().for_each(|started| started.files.push(origin.clone()));
    if let Some(ended) = &mut run.ended {
        ended.outdated = complaints.iter().map(Complaint::in_one_line).collect();
        let of_verdicts = [Exit::Green, Exit::Failed, Exit::Waivers].map(|exit| exit as u8);
        if of_verdicts.contains(&ended.exit) {
            let code = match (complaints.is_empty(), is_green) {
                (false, _) => Exit::Waivers,
                (true, true) => Exit::Green,
                (true, false) => Exit::Failed,
            };
            ended.exit = code as u8;
        }
    }
    for complaint in &complaints {
        complain!("{}\n", harmless(&complaint.to_string()));
    }
    Ok(!complaints.is_empty())
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
