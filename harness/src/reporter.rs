//! Takes the events of a run to where the user wants them: terminal, journal and reports.
//!
//! Files, flushing and progress belong here. The text of a report is made by [`reports`].

mod journal;
mod output;
mod unfinished;

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reports::terminal::{Printer, Verbosity};
use reports::{Event, Format, Keep, Run, Style, github, printable};

use crate::cli::{RunArgs, When};
use crate::exit::{Exit, Refused};
use crate::files::words;

use journal::JournalFile;
use output::Output;
use unfinished::is_on_real_bus;

pub(crate) use unfinished::started;

/// Tells of a run while it runs, and writes its reports at the end.
pub(crate) struct Reporter {
    run: Run,
    printer: Printer,
    annotate: bool,
    /// Cases and summary are printed.
    prints: bool,
    bar: ProgressBar,
    journal: Option<JournalFile>,
    /// The reports to write at the end.
    reports: Reports,
    /// Whether a file could not be written so far.
    unwritten: bool,
}

impl Reporter {
    /// Opens what the arguments ask for. Until the run is over, its reports say that it is not, so
    /// that a wrong path is found before anything runs, and none of another run is left.
    ///
    /// # Errors
    /// When a file cannot be written, or two are one.
    pub(crate) fn new(args: &RunArgs) -> Result<Self, Refused> {
        let on_terminal = std::io::stderr().is_terminal();
        let color = match args.color {
            When::Always => true,
            When::Never => false,
            When::Auto => std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none(),
        };
        let bar = ProgressBar::new(0);
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
        let (journal, reports) = open(args)?;
        Ok(Self {
            run: Run::new(Keep::Unusual),
            printer: Printer::new(Style { color }, verbosity),
            annotate: std::env::var_os("GITHUB_ACTIONS").is_some(),
            prints: true,
            bar,
            journal,
            reports,
            unwritten: false,
        })
    }

    /// The same for a command that prints what it found in words of its own. How far it came is a
    /// sentence.
    #[must_use]
    pub(crate) fn without_text(mut self) -> Self {
        if let Ok(style) = ProgressStyle::with_template("{wide_msg}") {
            self.bar.set_style(style);
        }
        self.prints = false;
        self
    }

    /// How far it came.
    pub(crate) fn progress(&self, said: String) {
        self.bar.set_message(said);
        self.bar.tick();
    }

    /// The number of cases to come.
    pub(crate) fn expect(&self, cases: usize) {
        self.bar.set_length(cases as u64);
    }

    /// Takes an event.
    pub(crate) fn tell(&mut self, event: &Event) {
        let written = self.journal.as_mut().map_or(Ok(()), |journal| journal.write(event));
        written.unwrap_or_else(|failure| self.not_written(&failure));
        // The order of events is the runner's business; out of order is a bug.
        self.run.apply(event).unwrap_or_else(|error| panic!("{error}"));
        match event {
            // There are thousands of cases a second, and a name takes time to write.
            Event::CaseStarted(case) if self.prints && !self.bar.is_hidden() => {
                self.bar.set_message(case.name());
            }
            Event::CaseEnded(_) => self.case_ended(),
            _ => {}
        }
    }

    /// Writes the reports that are due at the end, and prints the closing messages.
    pub(crate) fn finish(&mut self) -> Exit {
        self.bar.finish_and_clear();
        if self.prints {
            print(&self.printer.summary(&self.run));
        }
        self.write_reports();
        if self.unwritten { Exit::File } else { Exit::Green }
    }

    /// Nothing could be run. The reports say why.
    pub(crate) fn refused(mut self, args: &RunArgs, refused: &Refused) {
        let why = refused.message.trim_start_matches("error: ");
        let why = why.lines().next().unwrap_or_default();
        for event in unfinished::events(args, why, refused.exit as u8) {
            let written = self.journal.as_mut().map_or(Ok(()), |journal| journal.write(&event));
            written.unwrap_or_else(|failure| self.not_written(&failure));
            self.run.apply(&event).unwrap_or_else(|error| panic!("{error}"));
        }
        self.write_reports();
    }

    /// One that cannot be written is no reason to leave out the others.
    fn write_reports(&mut self) {
        for (format, output) in &self.reports {
            if let Err(error) = output.write(|out| (format.write)(&self.run, out)) {
                complain!("error: {}: {}", output.path().display(), words(&error));
                self.unwritten = true;
            }
        }
    }

    fn not_written(&mut self, failure: &str) {
        self.bar.suspend(|| complain!("error: {failure}"));
        self.unwritten = true;
    }

    /// The run, when it is reported.
    pub(crate) fn into_run(self) -> Run {
        self.run
    }

    /// The run so far.
    pub(crate) const fn run(&self) -> &Run {
        &self.run
    }

    fn case_ended(&mut self) {
        self.bar.inc(1);
        let Some((device, case)) = self.run.latest() else { return };
        let mut text = match self.prints {
            true => self.printer.case(&self.run, device, case),
            false => String::new(),
        };
        if self.annotate {
            let is_there = |file: &str| Path::new(file).is_file();
            text.extend(github::annotation(device, case, is_there));
        }
        if !text.is_empty() {
            self.bar.suspend(|| print(&text));
        }
    }
}

type Reports = Vec<(Format, Output)>;

/// The journal and the reports that the arguments ask for.
fn open(args: &RunArgs) -> Result<(Option<JournalFile>, Reports), Refused> {
    let refused = |path: &Path, error: &std::io::Error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {}", path.display(), words(error)),
    };
    let paths = args.reports.0.iter().map(|(format, path)| (format.flag, format.begins, path));
    let paths =
        args.journal.iter().map(|path| ("journal", reports::journal::BEGINS, path)).chain(paths);
    let mut outputs: Vec<(&str, Output)> = Vec::new();
    for (flag, begins, path) in paths {
        let output = Output::new(path).map_err(|error| refused(path, &error))?;
        let selection = &args.selection;
        let files = [("dut", &selection.dut), ("eds", &selection.eds), ("waivers", &args.waivers)];
        let files = files.into_iter().filter_map(|(flag, path)| Some((flag, path.as_deref()?)));
        let others = outputs.iter().map(|(flag, other)| (*flag, other.path()));
        if let Some((other, _)) = files.chain(others).find(|(_, path)| output.is_same(path)) {
            return Err(Refused::usage(format!(
                "--{flag} and --{other} are one file, {}: each needs one of its own",
                path.display()
            )));
        }
        if output.holds_other_than(begins) {
            return Err(Refused::usage(format!(
                "--{flag} {}: this file holds something else, and is not overwritten",
                path.display()
            )));
        }
        outputs.push((flag, output));
    }
    let journal = args.journal.as_ref().map(|path| {
        JournalFile::create(path, is_on_real_bus(args)).map_err(|error| refused(path, &error))
    });
    let journal = journal.transpose()?;
    let outputs = outputs.split_off(usize::from(journal.is_some()));
    let mut reports = Vec::new();
    for ((format, _), (_, output)) in args.reports.0.iter().zip(outputs) {
        if output.is_file() {
            let unfinished = unfinished::run(args, Exit::Internal as u8);
            let written = output.write(|out| (format.write)(&unfinished, out));
            written.map_err(|error| refused(output.path(), &error))?;
        }
        reports.push((*format, output));
    }
    Ok((journal, reports))
}

/// Prints to standard output what devices and files may have chosen parts of.
pub(crate) fn say(text: &str) {
    print(&harmless(text));
}

/// A text with control characters spelled out, except for those that only arrange it.
pub(crate) fn harmless(text: &str) -> String {
    let lines = text.split("\r\n").map(|line| {
        let parts: Vec<_> = line.split('\t').map(printable).collect();
        parts.join("\t")
    });
    lines.collect::<Vec<_>>().join("\r\n")
}

/// Prints to standard output. A reader that went away (`| head`) does not stop the run, whose
/// reports are still to be written, and is no failure.
fn print(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
    let failed = written.err().filter(|error| error.kind() != ErrorKind::BrokenPipe);
    if let Some(error) = failed.filter(|_| !UNSAID.swap(true, Ordering::SeqCst)) {
        complain!("error: standard output: {}", words(&error));
    }
}

/// Whether a write to standard output failed. The code that prints does not check.
static UNSAID: AtomicBool = AtomicBool::new(false);

/// Whether something could not be printed to standard output.
pub(crate) fn unsaid() -> bool {
    UNSAID.load(Ordering::SeqCst)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_device_and_no_file_chooses_what_a_terminal_does() {
        assert_eq!(harmless("a\tb\r\nc\n"), "a\tb\r\nc\n");
        assert_eq!(harmless("a\u{1b}[2J\0\rb\u{9b}"), "a\\u{1b}[2J\\u{0}\\rb\\u{9b}");
    }
}
