//! The lines of a trace: those of candump, or those of a journal.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use reports::{Event, journal};

use crate::candump::{self, LONGEST};
use crate::exit::{Exit, Refused};
use crate::files::words;

/// The lines of a file, as they come.
pub(in crate::commands) struct Lines {
    from: Box<dyn BufRead>,
    file: PathBuf,
    number: usize,
    is_journal: bool,
    line: Vec<u8>,
}

/// What a line says.
#[derive(Debug)]
pub(in crate::commands) enum Said {
    /// A frame, by candump.
    Line(candump::Line),
    /// Something that happened in a run.
    Event(Box<Event>),
    /// Nothing.
    Nothing,
    /// It cannot be read: its number, and why.
    Unreadable(usize, String),
}

impl Lines {
    /// The lines of a file; `-` is standard input.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub(in crate::commands) fn of(file: &Path) -> Result<Self, Refused> {
        let from: Box<dyn BufRead> = match file == Path::new("-") {
            true => Box::new(BufReader::new(std::io::stdin())),
            false => {
                let opened = File::open(file).map_err(|error| refused(file, &error))?;
                Box::new(BufReader::new(opened))
            }
        };
        let (file, line) = (file.to_owned(), Vec::new());
        Ok(Self { from, file, number: 0, is_journal: false, line })
    }

    /// The next line; `None` at the end.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub(in crate::commands) fn next(&mut self) -> Result<Option<Said>, Refused> {
        self.number += 1;
        self.line.clear();
        // A journal has lines that name every object of a device.
        let most = if self.is_journal { LONGEST << 12 } else { LONGEST } as u64;
        self.read(most)?;
        if self.line.is_empty() {
            return Ok(None);
        }
        self.is_journal |= self.number == 1 && self.line.starts_with(b"{");
        if self.line.len() as u64 == most && !self.line.ends_with(b"\n") && !self.is_journal {
            self.skip().map_err(|error| refused(&self.file, &error))?;
            let why = format!("it has more than {most} bytes");
            return Ok(Some(Said::Unreadable(self.number, why)));
        }
        if self.is_journal && !self.line.ends_with(b"\n") {
            // The first line was examined as a line of candump.
            self.read((LONGEST << 12) as u64)?;
        }
        let text = String::from_utf8_lossy(&self.line);
        Ok(Some(match self.is_journal {
            true => match journal::read(&text).next() {
                None => Said::Nothing,
                Some((_, Err(error))) => Said::Unreadable(self.number, error.why),
                Some((_, Ok(event))) => Said::Event(Box::new(event)),
            },
            false => match candump::parse(&text) {
                Ok(None) => Said::Nothing,
                Ok(Some(line)) => Said::Line(line),
                Err(why) => Said::Unreadable(self.number, why),
            },
        }))
    }

    fn read(&mut self, most: u64) -> Result<(), Refused> {
        let read = self.from.by_ref().take(most).read_until(b'\n', &mut self.line);
        read.map(drop).map_err(|error| refused(&self.file, &error))
    }

    /// Leaves out what is left of a line.
    fn skip(&mut self) -> std::io::Result<()> {
        loop {
            let buffer = self.from.fill_buf()?;
            let end = buffer.iter().position(|byte| *byte == b'\n');
            let count = end.map_or(buffer.len(), |end| end + 1);
            let over = end.is_some() || buffer.is_empty();
            self.from.consume(count);
            if over {
                return Ok(());
            }
        }
    }
}

fn refused(file: &Path, error: &std::io::Error) -> Refused {
    let message = format!("error: {}: {}", file.display(), words(error));
    Refused { exit: Exit::File, message }
}
