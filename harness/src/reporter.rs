//! Takes the events of a run to where the user wants them: terminal, journal and reports.
//!
//! Files, flushing and progress belong here. The text of a report is made by [`reports`].

mod journal;
mod output;
mod recording;
mod remaining;
mod unfinished;

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use reports::terminal::{Printer, Verbosity};
use reports::{Event, Format, Keep, Run, Style, github, printable};

use crate::cli::{ReportArgs, RunArgs};
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::progress::{self, Progress};

use journal::JournalFile;
pub(crate) use output::Output;
use recording::RecordingFile;
pub(crate) use remaining::{Remaining, roughly};
pub(crate) use unfinished::{is_on_real_bus, started};

/// Tells of a run while it runs, and writes its reports at the end.
pub(crate) struct Reporter {
    run: Run,
    printer: Printer,
    annotate: bool,
    /// Cases and summary are printed.
    prints: bool,
    line: Progress,
    /// How many cases have ended, and how many there are.
    cases: (usize, usize),
    /// The time that the cases to come will take, where that is known.
    remaining: Option<Remaining>,
    journal: Option<JournalFile>,
    /// The recordings, as far as they go.
    recordings: Vec<RecordingFile>,
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
        let color = args.color.colours();
        let verbosity = match (args.quiet, args.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        };
        if args.no_progress || args.verbose {
            progress::is_unwanted();
        }
        let (journal, recordings, reports) = open(args)?;
        let run = Run::new(Keep::Unusual);
        let watches = verbosity == Verbosity::Verbose || !reports.is_empty();
        Ok(Self {
            run: if watches { run.watching() } else { run },
            printer: Printer::new(Style { color }, verbosity),
            annotate: std::env::var_os("GITHUB_ACTIONS").is_some(),
            prints: true,
            line: Progress::of(0),
            cases: (0, 0),
            remaining: None,
            journal,
            recordings,
            reports,
            unwritten: false,
        })
    }

    /// The same for a command that prints what it found in words of its own, and says how far it
    /// came.
    #[must_use]
    pub(crate) fn without_text(self) -> Self {
        Self { prints: false, ..self }
    }

    /// How many parts of so many are done.
    pub(crate) fn progress(&self, done: usize, of: usize, said: impl FnOnce() -> String) {
        self.line.expect(of);
        self.line.says(done, said);
    }

    /// The number of cases to come, and the time that they take.
    pub(crate) fn expect(&mut self, cases: usize, remaining: Option<Remaining>) {
        self.line.expect(cases);
        (self.cases, self.remaining) = ((0, cases), remaining);
    }

    /// Takes an event.
    pub(crate) fn tell(&mut self, event: &Event) {
        self.record(event);
        // The order of events is the runner's business; out of order is a bug.
        self.run.apply(event).unwrap_or_else(|error| panic!("{error}"));
        match event {
            Event::CaseStarted(case) if self.prints => {
                let (done, of) = self.cases;
                let left = self.remaining.as_mut().and_then(|it| it.begins(case));
                // There are thousands of cases a second, and a name takes time to write.
                self.line.says(done, || {
                    let left = left.map(|left| format!(", {} left", roughly(left)));
                    format!("{done} of {of}{}  {}", left.unwrap_or_default(), case.name())
                });
            }
            Event::CaseEnded(end) => {
                self.remaining.iter_mut().for_each(|it| it.ends(end.at));
                self.case_ended();
            }
            _ => {}
        }
    }

    fn record(&mut self, event: &Event) {
        let written = self.journal.as_mut().map_or(Ok(()), |journal| journal.write(event));
        let recordings = self.recordings.iter_mut().map(|recording| recording.write(event));
        let failures: Vec<String> =
            [written].into_iter().chain(recordings).filter_map(Result::err).collect();
        failures.iter().for_each(|failure| self.not_written(failure));
    }

    /// Writes the reports that are due at the end, and prints the closing messages.
    pub(crate) fn finish(&mut self) -> Exit {
        self.line.end();
        if self.prints {
            print(&self.printer.summary(&self.run));
        }
        self.write_reports();
        if self.unwritten { Exit::File } else { Exit::Green }
    }

    /// Nothing could be run. The reports say why.
    pub(crate) fn refused(mut self, args: &RunArgs, refused: &Refused) {
        let mut lines = refused.message.trim_start_matches("error: ").lines();
        let why = lines.next().unwrap_or_default();
        let place = lines.next().and_then(|line| line.trim_start().strip_prefix("--> "));
        let why = place.map_or_else(|| why.to_owned(), |place| format!("{place}: {why}"));
        for event in unfinished::events(args, &why, refused.exit as u8) {
            self.record(&event);
            self.run.apply(&event).unwrap_or_else(|error| panic!("{error}"));
        }
        self.write_reports();
    }

    /// One that cannot be written is no reason to leave out the others.
    fn write_reports(&mut self) {
        let recordings = self.recordings.iter_mut().map(RecordingFile::end);
        let failures: Vec<String> = recordings.filter_map(Result::err).collect();
        failures.iter().for_each(|failure| self.not_written(failure));
        for (format, output) in &self.reports {
            if let Err(error) = output.write(|out| (format.write)(&self.run, out)) {
                complain!("error: {}: {}", output.path().display(), words(&error));
                self.unwritten = true;
            }
        }
    }

    fn not_written(&mut self, failure: &str) {
        complain!("error: {failure}");
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
        self.cases.0 += 1;
        let Some((device, case)) = self.run.latest() else { return };
        let mut text = match self.prints {
            true => self.printer.case(&self.run, device, case),
            false => String::new(),
        };
        if self.annotate {
            let is_there = |file: &str| Path::new(file).is_file();
            text.extend(github::annotation(&self.run, device, case, is_there));
        }
        if !text.is_empty() {
            print(&text);
        }
    }
}

type Reports = Vec<(Format, Output)>;

/// The journal, the recordings and the reports that the arguments ask for.
fn open(args: &RunArgs) -> Result<(Option<JournalFile>, Vec<RecordingFile>, Reports), Refused> {
    let selection = &args.selection;
    let files = [("--dut", &selection.dut), ("--eds", &selection.eds)];
    let files = files.into_iter().chain([("--waivers", &args.waivers)]);
    let files = files.filter_map(|(flag, path)| Some((flag, path.as_deref()?)));
    let outputs = outputs(args.journal.as_deref(), &args.reports, &files.collect::<Vec<_>>())?;
    let journal = args.journal.as_ref().map(|path| {
        JournalFile::create(path, is_on_real_bus(args)).map_err(|error| not_written(path, &error))
    });
    let journal = journal.transpose()?;
    let recordings = recordings(&args.reports)?;
    for (format, output) in outputs.iter().filter(|(_, output)| output.is_file()) {
        let unfinished = unfinished::run(args, Exit::Internal as u8);
        let written = output.write(|out| (format.write)(&unfinished, out));
        written.map_err(|error| not_written(output.path(), &error))?;
    }
    Ok((journal, recordings, outputs))
}

/// The files of the reports, each of its own: none is one of the files that are read, and none
/// holds anything else.
///
/// # Errors
/// The first that is not so.
fn outputs(
    journal: Option<&Path>,
    reports: &ReportArgs,
    read: &[(&str, &Path)],
) -> Result<Reports, Refused> {
    let formats = reports.formats.iter().map(|(it, path)| (it.flag, it.begins, path.as_path()));
    let recordings =
        reports.recordings.iter().map(|(it, path)| (it.flag, it.begins, path.as_path()));
    let journal = journal.map(|path| ("journal", reports::journal::BEGINS, path));
    let mut outputs: Vec<(&str, Output)> = Vec::new();
    for (flag, begins, path) in journal.into_iter().chain(formats).chain(recordings) {
        let output = Output::new(path).map_err(|error| not_written(path, &error))?;
        let others = outputs.iter().map(|(flag, other)| (format!("--{flag}"), other.path()));
        let mut others = read.iter().map(|(name, path)| ((*name).to_owned(), *path)).chain(others);
        if let Some((other, _)) = others.find(|(_, path)| output.is_same(path)) {
            return Err(Refused::usage(format!(
                "--{flag} and {other} are one file, {}: each needs one of its own",
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
    let formats = reports.formats.iter().map(|(format, _)| *format);
    let of_formats = outputs.into_iter().skip(usize::from(journal.is_some()));
    Ok(formats.zip(of_formats.map(|(_, output)| output)).collect())
}

fn recordings(reports: &ReportArgs) -> Result<Vec<RecordingFile>, Refused> {
    let create = |(recording, path): &(reports::Recording, PathBuf)| {
        RecordingFile::create(path, recording).map_err(|error| not_written(path, &error))
    };
    reports.recordings.iter().map(create).collect()
}

pub(crate) fn not_written(path: &Path, error: &std::io::Error) -> Refused {
    let message = format!("error: {}: {}", path.display(), words(error));
    Refused { exit: Exit::File, message }
}

/// Writes the reports of runs that are recorded in `journals`: `run` is the whole, and `tell` tells
/// the events to record.
///
/// # Errors
/// A file that cannot be written, or that is not one of its own; what `tell` refuses.
pub(crate) fn render(
    journals: &[PathBuf],
    reports: &ReportArgs,
    run: &Run,
    tell: impl FnOnce(&mut dyn FnMut(&Event) -> Result<(), String>) -> Result<(), Refused>,
) -> Result<(), Refused> {
    let journals: Vec<(&str, &Path)> = journals.iter().map(|it| ("the journal", &**it)).collect();
    let outputs = outputs(None, reports, &journals)?;
    let mut recordings = recordings(reports)?;
    if !recordings.is_empty() {
        tell(&mut |event| recordings.iter_mut().try_for_each(|it| it.write(event)))?;
        recordings
            .iter_mut()
            .try_for_each(RecordingFile::end)
            .map_err(|why| Refused { exit: Exit::File, message: format!("error: {why}") })?;
    }
    for (format, output) in &outputs {
        let written = output.write(|out| (format.write)(run, out));
        written.map_err(|error| not_written(output.path(), &error))?;
    }
    Ok(())
}

/// Prints the text of a report, which is harmless and may be coloured.
pub(crate) fn say_report(text: &str) {
    print(text);
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
    let written = progress::beside(|| {
        let mut stdout = std::io::stdout().lock();
        stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush())
    });
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
