//! The journal on disk.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use reports::{Event, journal};

use crate::files::words;

/// A journal that is written while the run goes on, so that a run that is killed leaves what it
/// has seen.
pub(super) struct JournalFile {
    path: PathBuf,
    file: BufWriter<File>,
    /// A real bus gives its frames a pace that the disk keeps easily, and they do not come again.
    /// In virtual time a flush for each of a million frames would take longer than the run: there
    /// every case starts on disk, and its frames follow by the buffer.
    every_event: bool,
    /// Whether it could not be written to its end.
    ended: bool,
}

impl JournalFile {
    /// A new and empty file.
    ///
    /// # Errors
    /// When it cannot be created.
    pub(super) fn create(path: &Path, every_event: bool) -> io::Result<Self> {
        let file = BufWriter::new(File::create(path)?);
        Ok(Self { path: path.to_owned(), file, every_event, ended: false })
    }

    /// Adds an event.
    ///
    /// # Errors
    /// What went wrong, once: a line that was cut off is the last one, so nothing follows.
    pub(super) fn write(&mut self, event: &Event) -> Result<(), String> {
        if self.ended {
            return Ok(());
        }
        let written = self.file.write_all(journal::line(event).as_bytes());
        let at_once =
            self.every_event || matches!(event, Event::CaseStarted(_) | Event::RunEnded(_));
        let written = if at_once { written.and_then(|()| self.file.flush()) } else { written };
        written.map_err(|error| {
            self.ended = true;
            let place = self.path.display();
            format!("{place}: {}; the journal ends here, and the run goes on", words(&error))
        })
    }
}
