//! Files on disk: their maximum size, and the words for their errors.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

use crate::source::{Complaint, Source};

/// The operating system's message for an error, without the number.
pub(crate) fn words(error: &io::Error) -> String {
    let words = error.to_string();
    words.split(" (os error").next().unwrap_or_default().to_owned()
}

/// The largest file that describes something: a data sheet, a suite, a device.
pub(crate) const LARGEST: u64 = 4 << 20;
/// The largest journal.
pub(crate) const LARGEST_JOURNAL: u64 = 1 << 30;

/// The bytes of a file that has `most` at most.
///
/// # Errors
/// Whatever keeps it from being read, and that it is larger.
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    // A pipe has no size, and a file may grow while it is read.
    let size = file.metadata().map_or(0, |known| known.len().min(most));
    let mut bytes = Vec::with_capacity(size as usize + 1);
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 <= most {
        return Ok(bytes);
    }
    let has = fs::metadata(path).map_or(most + 1, |found| found.len().max(most + 1));
    let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
    let has = if has == most + 1 { format!("more than {}", mib(most)) } else { mib(has) };
    Err(io::Error::other(format!("it has {has}, and may have {}", mib(most))))
}

/// The lines of a file that has `most` bytes at most, each with its end.
pub(crate) struct Lines {
    file: BufReader<File>,
    number: usize,
    /// How many bytes may still come.
    left: u64,
}

impl Lines {
    /// Opens the file.
    ///
    /// # Errors
    /// Whatever keeps it from being opened.
    pub(crate) fn open(path: &Path, most: u64) -> io::Result<Self> {
        Ok(Self { file: BufReader::new(File::open(path)?), number: 0, left: most })
    }
}

impl Iterator for Lines {
    type Item = io::Result<String>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut line = Vec::new();
        self.number += 1;
        match self.file.by_ref().take(self.left + 1).read_until(b'\n', &mut line) {
            Err(error) => Some(Err(error)),
            Ok(0) => None,
            Ok(length) if length as u64 > self.left => {
                Some(Err(io::Error::other(format!("line {} is too far in it", self.number))))
            }
            Ok(length) => {
                self.left -= length as u64;
                let wrong = |_| {
                    let message = format!("line {} is not UTF-8", self.number);
                    io::Error::new(io::ErrorKind::InvalidData, message)
                };
                Some(String::from_utf8(line).map_err(wrong))
            }
        }
    }
}

/// The text of a file that describes something.
///
/// # Errors
/// As [`read`], and that it is not UTF-8.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    text(read(path, LARGEST)?)
}

/// A file that describes something, with its name for complaints.
///
/// # Errors
/// As [`read_text`], as a complaint about the file.
pub(crate) fn read_source(path: &Path) -> Result<Arc<Source>, Complaint> {
    let name = path.display().to_string();
    match read_text(path) {
        Ok(text) => Ok(Arc::new(Source { name, text: text.into() })),
        Err(error) => {
            let source = Arc::new(Source { name, text: "".into() });
            Err(Complaint { source, place: None, message: words(&error) })
        }
    }
}

/// Adds the YAML files of a folder and those below it.
///
/// # Errors
/// What cannot be read.
pub(crate) fn read_folder(folder: &Path, sources: &mut Vec<Source>) -> Result<(), Complaint> {
    let complain = |path: &Path, error: io::Error| {
        let source = Source { name: shown(path), text: "".into() };
        Complaint { source: Arc::new(source), place: None, message: words(&error) }
    };
    for entry in fs::read_dir(folder).map_err(|error| complain(folder, error))? {
        let path = entry.map_err(|error| complain(folder, error))?.path();
        if path.is_dir() {
            read_folder(&path, sources)?;
        } else if path.extension().is_some_and(|extension| extension == "yaml") {
            let text = read_text(&path).map_err(|error| complain(&path, error))?;
            sources.push(Source { name: shown(&path), text: text.into() });
        }
    }
    Ok(())
}

/// The texts of the YAML files in a folder, by their names below `root`.
///
/// # Errors
/// What cannot be read.
pub(crate) fn texts_in(folder: &Path, root: &Path) -> Result<BTreeMap<String, String>, Complaint> {
    let mut sources = Vec::new();
    read_folder(folder, &mut sources)?;
    let root = shown(root);
    let texts = sources.into_iter().map(|Source { name, text }| {
        let name = name.strip_prefix(&root).unwrap_or(&name).trim_start_matches('/').to_owned();
        (name, text.into_owned())
    });
    Ok(texts.collect())
}

/// A path as it is written everywhere.
pub(crate) fn shown(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// Bytes as a text.
///
/// # Errors
/// That they are not UTF-8, and where.
pub(crate) fn text(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let line = 1 + error.as_bytes()[..valid].iter().filter(|byte| **byte == b'\n').count();
        io::Error::new(io::ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}

/// Writes a file, and returns once it is on disk.
///
/// # Errors
/// Whatever keeps it from being written.
pub(crate) fn write_synced(path: &Path, text: &str) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_too_large_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        fs::write(&path, "12345678").unwrap();
        assert_eq!(read(&path, 8).unwrap(), b"12345678");
        File::create(&path).unwrap().set_len(20 << 20).unwrap();
        let why = words(&read_text(&path).unwrap_err());
        assert_eq!(why, "it has 20.0 MiB, and may have 4.0 MiB");
        let why = words(&read(Path::new("/dev/zero"), 1 << 20).unwrap_err());
        assert_eq!(why, "it has more than 1.0 MiB, and may have 1.0 MiB");
        fs::write(&path, b"one\n\xFF").unwrap();
        assert_eq!(words(&read_text(&path).unwrap_err()), "line 2 is not UTF-8");
    }
}
