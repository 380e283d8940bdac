//! Takes the events of a run to where the user wants them: terminal, journal and reports.

use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reports::terminal::{Printer, Verbosity};
use reports::{Event, Keep, Run, Style, github, journal};

use crate::cli::{ReportArgs, RunArgs, When};
use crate::exit::{Exit, Refused};

/// Tells of a run while it runs, and writes its reports at the end.
pub struct Reporter {
    run: Run,
    printer: Printer,
    annotate: bool,
    bar: ProgressBar,
    journal: Option<(PathBuf, BufWriter<File>)>,
    /// The reports to write at the end.
    reports: ReportArgs,
    /// The first thing that went wrong while writing the journal.
    trouble: Option<String>,
}

impl Reporter {
    /// Opens what the arguments ask for. Files are created now, so that a wrong path is found
    /// before anything runs.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn new(args: &RunArgs, cases: usize) -> Result<Self, Refused> {
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
        let create = |path: &PathBuf| {
            File::create(path).map_err(|error| Refused {
                exit: Exit::File,
                message: format!("error: {}: {error}", path.display()),
            })
        };
        let journal = match &args.journal {
            Some(path) => Some((path.clone(), BufWriter::new(create(path)?))),
            None => None,
        };
        for (_, path) in &args.reports.0 {
            create(path)?;
        }
        Ok(Self {
            run: Run::new(Keep::Unusual),
            printer: Printer::new(Style { color }, verbosity),
            annotate: std::env::var_os("GITHUB_ACTIONS").is_some(),
            bar,
            journal,
            reports: args.reports.clone(),
            trouble: None,
        })
    }

    /// Takes an event.
    pub fn tell(&mut self, event: &Event) {
        if let Some((path, file)) = &mut self.journal
            && let Err(error) = file.write_all(journal::line(event).as_bytes())
        {
            let text = format!("{}: {error}", path.display());
            self.trouble.get_or_insert(text);
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
    pub fn finish(&mut self) -> Exit {
        self.bar.finish_and_clear();
        say(&self.printer.summary(&self.run));
        if let Some((path, file)) = &mut self.journal
            && let Err(error) = file.flush()
        {
            let text = format!("{}: {error}", path.display());
            self.trouble.get_or_insert(text);
        }
        for (format, path) in &self.reports.0 {
            if let Err(error) = std::fs::write(path, (format.write)(&self.run)) {
                let text = format!("{}: {error}", path.display());
                self.trouble.get_or_insert(text);
            }
        }
        match &self.trouble {
            Some(trouble) => {
                eprintln!("error: {trouble}");
                Exit::File
            }
            None => Exit::Green,
        }
    }

    /// The run so far.
    pub const fn run(&self) -> &Run {
        &self.run
    }

    fn case_ended(&mut self) {
        self.bar.inc(1);
        let Some((device, case)) = self.run.latest() else { return };
        let mut text = self.printer.case(&self.run, device, case);
        if self.annotate {
            text.extend(github::annotation(device, case));
        }
        self.bar.suspend(|| say(&text));
    }
}

/// Prints to standard output. A reader that went away (`| head`) is no reason to stop the run,
/// whose reports are still to be written.
pub fn say(text: &str) {
    _ = std::io::stdout().write_all(text.as_bytes());
}
