//! The recordings of the bus on disk.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use reports::{Event, Recorder, Recording};

use crate::files::words;

/// A recording that is written while the run goes on.
pub(super) struct RecordingFile {
    path: PathBuf,
    file: BufWriter<File>,
    recorder: Box<dyn Recorder>,
    /// Whether it could not be written to its end.
    ended: bool,
}

impl RecordingFile {
    /// A new and empty file.
    ///
    /// # Errors
    /// When it cannot be created.
    pub(super) fn create(path: &Path, recording: &Recording) -> io::Result<Self> {
        let file = BufWriter::new(File::create(path)?);
        Ok(Self { path: path.to_owned(), file, recorder: (recording.begin)(), ended: false })
    }

    /// Adds an event. A case is on disk when it has ended.
    ///
    /// # Errors
    /// What went wrong, once: what was cut off is the end.
    pub(super) fn write(&mut self, event: &Event) -> Result<(), String> {
        if self.ended {
            return Ok(());
        }
        let written = self.recorder.take(event, &mut self.file);
        self.checked(written)
    }

    /// Writes the rest.
    ///
    /// # Errors
    /// What went wrong, unless it was said.
    pub(super) fn end(&mut self) -> Result<(), String> {
        if self.ended {
            return Ok(());
        }
        let written = self.recorder.end(&mut self.file).and_then(|()| self.file.flush());
        self.checked(written)
    }

    fn checked(&mut self, written: io::Result<()>) -> Result<(), String> {
        written.map_err(|error| {
            self.ended = true;
            format!("{}: {}; the recording ends here", self.path.display(), words(&error))
        })
    }
}
