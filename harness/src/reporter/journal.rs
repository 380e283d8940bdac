//! The journal on disk.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use reports::{Event, journal};

/// A journal that is written while the run goes on, so that a run that is killed leaves what it
/// has seen.
pub(super) struct JournalFile {
    path: PathBuf,
    file: BufWriter<File>,
    /// A real bus gives its frames a pace that the disk keeps easily, and they do not come again.
    /// In virtual time a flush for each of a million frames would take longer than the run: there
    /// every case starts on disk, and its frames follow by the buffer.
    every_event: bool,
    failure: Option<String>,
}

impl JournalFile {
    /// A new and empty file.
    ///
    /// # Errors
    /// When it cannot be created.
    pub(super) fn create(path: &Path, every_event: bool) -> io::Result<Self> {
        let file = BufWriter::new(File::create(path)?);
        Ok(Self { path: path.to_owned(), file, every_event, failure: None })
    }

    /// Adds an event.
    pub(super) fn write(&mut self, event: &Event) {
        let written = self.file.write_all(journal::line(event).as_bytes());
        self.note(written);
        if self.every_event || matches!(event, Event::CaseStarted(_)) {
            self.flush();
        }
    }

    /// Writes what is left, and returns the first thing that went wrong.
    pub(super) fn finish(&mut self) -> Option<String> {
        self.flush();
        self.failure.take()
    }

    fn flush(&mut self) {
        let flushed = self.file.flush();
        self.note(flushed);
    }

    fn note(&mut self, result: io::Result<()>) {
        if let Err(error) = result {
            self.failure.get_or_insert_with(|| format!("{}: {error}", self.path.display()));
        }
    }
}
