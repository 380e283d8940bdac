//! Takes the events of a run to where the user wants them: terminal, journal and reports.

mod journal;

use std::fs::File;
use std::io::{IsTerminal, Write};
use std::path::Path;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reports::terminal::{Printer, Verbosity};
use reports::{Event, Keep, Run, Style, github};

use crate::cli::{ReportArgs, RunArgs, When};
use crate::exit::{Exit, Refused};
use crate::target::Address;

use journal::JournalFile;

/// Tells of a run while it runs, and writes its reports at the end.
pub(crate) struct Reporter {
    run: Run,
    printer: Printer,
    annotate: bool,
    bar: ProgressBar,
    journal: Option<JournalFile>,
    /// The reports to write at the end.
    reports: ReportArgs,
}

impl Reporter {
    /// Opens what the arguments ask for. Files are created now, so that a wrong path is found
    /// before anything runs.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn new(args: &RunArgs, cases: usize) -> Result<Self, Refused> {
        let on_terminal = std::io::stderr().is_terminal();
        let color = match args.color {
            When::Always => true,
            When::Never => false,
            When::Auto => std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none(),
        };
        let bar = ProgressBar::new(cases as u64);
        let verbosity = match (args.quiet, args.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        };
        let show_bar = on_terminal && !args.no_progress && !args.verbose;
        bar.set_draw_target(match show_bar {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        });
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} {wide_msg}") {
            bar.set_style(style);
        }
        let refused = |path: &Path, error| Refused {
            exit: Exit::File,
            message: format!("error: {}: {error}", path.display()),
        };
        let journal = match &args.journal {
            Some(path) => {
                let journal = JournalFile::create(path, is_on_real_bus(args));
                Some(journal.map_err(|error| refused(path, error))?)
            }
            None => None,
        };
        for (_, path) in &args.reports.0 {
            File::create(path).map_err(|error| refused(path, error))?;
        }
        Ok(Self {
            run: Run::new(Keep::Unusual),
            printer: Printer::new(Style { color }, verbosity),
            annotate: std::env::var_os("GITHUB_ACTIONS").is_some(),
            bar,
            journal,
            reports: args.reports.clone(),
        })
    }

    /// Takes an event.
    pub(crate) fn tell(&mut self, event: &Event) {
        if let Some(journal) = &mut self.journal {
            journal.write(event);
        }
        // The order of events is the runner's business; out of order is a bug.
        self.run.apply(event).unwrap_or_else(|error| panic!("{error}"));
        match event {
            Event::CaseStarted(case) => self.bar.set_message(case.name()),
            Event::CaseEnded(_) => self.case_ended(),
            _ => {}
        }
    }

    /// Writes what is written at the end, and says what is to be said.
    pub(crate) fn finish(&mut self) -> Exit {
        self.bar.finish_and_clear();
        say(&self.printer.summary(&self.run));
        let mut failure = self.journal.as_mut().and_then(JournalFile::finish);
        for (format, path) in &self.reports.0 {
            if let Err(error) = std::fs::write(path, (format.write)(&self.run)) {
                failure.get_or_insert_with(|| format!("{}: {error}", path.display()));
            }
        }
        match failure {
            Some(failure) => {
                eprintln!("error: {failure}");
                Exit::File
            }
            None => Exit::Green,
        }
    }

    /// The run so far.
    pub(crate) const fn run(&self) -> &Run {
        &self.run
    }

    fn case_ended(&mut self) {
        self.bar.inc(1);
        let Some((device, case)) = self.run.latest() else { return };
        let mut text = self.printer.case(&self.run, device, case);
        if self.annotate {
            let is_there = |file: &str| Path::new(file).is_file();
            text.extend(github::annotation(device, case, is_there));
        }
        self.bar.suspend(|| say(&text));
    }
}

/// Whether the frames come from hardware. What the target is otherwise wrong with is found when it
/// is resolved.
fn is_on_real_bus(args: &RunArgs) -> bool {
    let address = args.selection.target.as_deref().map(str::parse);
    matches!(address, Some(Ok(Address::Interface(_))))
}

/// Prints to standard output. A reader that went away (`| head`) does not stop the run,
/// whose reports are still to be written.
pub(crate) fn say(text: &str) {
    _ = std::io::stdout().write_all(text.as_bytes());
}
