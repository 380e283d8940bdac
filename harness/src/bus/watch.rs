//! What is known of a program beside its frames: which of its code was reached, when it counts that
//! (`examples/firmware-c/coverage.c`), and what it wrote on its standard error.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::process::Command;

use tempfile::NamedTempFile;

/// The environment variable with the file of the counters.
const COVERAGE: &str = "HARNESS_COVERAGE";
/// How many counters there are, a byte each.
const COUNTERS: usize = 1 << 16;
/// How many lines of what a program said are of interest.
const LINES: usize = 16;

/// The files through which a program tells more.
#[derive(Debug)]
pub(crate) struct Watch {
    counters: NamedTempFile,
    said: NamedTempFile,
}

/// For each counter of a program, the ranges in which it ever was, a bit each.
#[derive(Debug)]
pub(crate) struct Reached(Vec<u8>);

impl Default for Reached {
    fn default() -> Self {
        Self(vec![0; COUNTERS])
    }
}

impl Watch {
    /// New files, which vanish with it.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(crate) fn new() -> io::Result<Self> {
        let (counters, said) = (NamedTempFile::new()?, NamedTempFile::new()?);
        let watch = Self { counters, said };
        watch.begin()?;
        Ok(watch)
    }

    /// Nothing was reached or said.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(crate) fn begin(&self) -> io::Result<()> {
        // The file is never shorter: a program that still runs has it mapped.
        let mut file = OpenOptions::new().write(true).open(self.counters.path())?;
        file.write_all(&vec![0; COUNTERS])?;
        self.said.as_file().set_len(0)
    }

    /// Lets a program that is about to be started write to the files.
    pub(super) fn set_up(&self, command: &mut Command) {
        command.env(COVERAGE, self.counters.path());
        if let Ok(said) = OpenOptions::new().append(true).open(self.said.path()) {
            command.stderr(said);
        }
    }

    /// Notes what was reached, and returns whether that is more than ever before: code that was
    /// never reached, or about twice as often.
    pub(crate) fn adds_to(&self, reached: &mut Reached) -> bool {
        let counters = fs::read(self.counters.path()).unwrap_or_default();
        let mut more = false;
        for (count, reached) in counters.iter().zip(&mut reached.0) {
            let range = count.checked_ilog2().map_or(0, |power| 1 << power);
            more |= range & !*reached != 0;
            *reached |= range;
        }
        more
    }

    /// The report of a sanitizer, or the last lines that the program wrote.
    pub(crate) fn last_words(&self) -> Option<String> {
        let said = fs::read(self.said.path()).unwrap_or_default();
        let said = String::from_utf8_lossy(&said);
        let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
        let reports = |line: &&str| line.contains("ERROR: ") || line.contains("runtime error: ");
        let report = lines.iter().position(reports);
        let from = report.unwrap_or_else(|| lines.len().saturating_sub(LINES));
        let words: Vec<&str> = lines[from..].iter().take(LINES).copied().collect();
        (!words.is_empty()).then(|| words.join("\n"))
    }
}
