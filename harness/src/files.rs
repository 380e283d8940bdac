//! Files on disk: their maximum size, and the words for their errors.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{MAIN_SEPARATOR, Path};
use std::sync::Arc;

use crate::exit::{Exit, Refused};
use crate::source::{Complaint, Source};
use crate::system;

/// The message of the operating system for an error, without the number. It is English everywhere.
pub(crate) fn words(error: &io::Error) -> String {
    // This program's own errors have words of their own.
    if error.get_ref().is_none()
        && let Some(known) = system::words_of(error.kind())
    {
        return known.to_owned();
    }
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
    let has = fs::metadata(path).map(|found| found.len()).ok();
    Err(too_large(has.filter(|has| *has > most + 1), most))
}

/// That a file has more bytes than it may have; `has` is how many where that is known.
fn too_large(has: Option<u64>, most: u64) -> io::Error {
    let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
    let has = has.map_or_else(|| format!("more than {}", mib(most)), mib);
    io::Error::other(format!("it has {has}, and may have {}", mib(most)))
}

/// A file that has `most` bytes at most, some whole lines of it at a time.
pub(crate) struct Blocks {
    file: BufReader<File>,
    /// The number of the next line.
    line: usize,
    /// How many bytes may still come, and in all.
    left: u64,
    most: u64,
}

/// Whole lines of a file, and the number of the first.
pub(crate) struct Block {
    line: usize,
    bytes: Vec<u8>,
}

/// How many bytes a block has, but for the rest of its last line.
const BLOCK: u64 = 256 << 10;

impl Blocks {
    /// Opens the file.
    ///
    /// # Errors
    /// Whatever keeps it from being opened.
    pub(crate) fn open(path: &Path, most: u64) -> io::Result<Self> {
        Ok(Self { file: BufReader::new(File::open(path)?), line: 1, left: most, most })
    }
}

impl Iterator for Blocks {
    type Item = io::Result<Block>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut bytes = Vec::with_capacity(BLOCK as usize + 1024);
        let mut file = self.file.by_ref().take(self.left + 1);
        let read = file.by_ref().take(BLOCK).read_to_end(&mut bytes);
        if let Err(error) = read.and_then(|_| file.read_until(b'\n', &mut bytes)) {
            return Some(Err(error));
        }
        let Some(left) = self.left.checked_sub(bytes.len() as u64) else {
            return Some(Err(too_large(None, self.most)));
        };
        let block = Block { line: self.line, bytes };
        self.left = left;
        self.line += lines_in(&block.bytes);
        (!block.bytes.is_empty()).then_some(Ok(block))
    }
}

impl AsRef<[u8]> for Block {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Block {
    /// The number of its first line, and its text.
    ///
    /// # Errors
    /// That it is not UTF-8, and in which line.
    pub(crate) fn text(self) -> io::Result<(usize, String)> {
        Ok((self.line, text_from(self.line, self.bytes)?))
    }
}

fn lines_in(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte == b'\n').count()
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
    let name = shown(path);
    match read_text(path) {
        Ok(text) => Ok(Arc::new(Source::new(name, text))),
        Err(error) => {
            let source = Arc::new(Source::new(name, ""));
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
        let source = Source::new(shown(path), "");
        Complaint { source: Arc::new(source), place: None, message: words(&error) }
    };
    for entry in fs::read_dir(folder).map_err(|error| complain(folder, error))? {
        let path = entry.map_err(|error| complain(folder, error))?.path();
        if path.is_dir() {
            read_folder(&path, sources)?;
        } else if path.extension().is_some_and(|extension| extension == "yaml") {
            let text = read_text(&path).map_err(|error| complain(&path, error))?;
            sources.push(Source::new(shown(&path), text));
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
    let texts = sources.into_iter().map(|Source { name, text, .. }| {
        let name = name.strip_prefix(&root).unwrap_or(&name).trim_start_matches('/').to_owned();
        (name, text.into_owned())
    });
    Ok(texts.collect())
}

/// A path as it is written everywhere: suites and waivers of one system are read on another one.
pub(crate) fn shown(path: &Path) -> String {
    path.to_string_lossy().replace(MAIN_SEPARATOR, "/")
}

/// Bytes as a text.
///
/// # Errors
/// That they are not UTF-8, and where.
pub(crate) fn text(bytes: Vec<u8>) -> io::Result<String> {
    text_from(1, bytes)
}

fn text_from(first: usize, bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let line = first + lines_in(&error.as_bytes()[..valid]);
        io::Error::new(io::ErrorKind::InvalidData, format!("line {line} is not UTF-8"))
    })
}

/// Writes a file that is not there yet: what somebody has written is not lost. `instead` says what
/// else to do where it is there.
///
/// # Errors
/// That it is there, and whatever keeps it from being written.
pub(crate) fn write_new(path: &Path, text: &str, instead: &str) -> Result<(), Refused> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => is_there(path, instead),
        _ => Refused {
            exit: Exit::File,
            message: format!("error: {}: {}", path.display(), words(&error)),
        },
    })
}

/// The refusal to write over a file.
pub(crate) fn is_there(path: &Path, instead: &str) -> Refused {
    Refused::usage(format!("{} exists and is not overwritten: {instead}", path.display()))
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

    #[test]
    fn blocks_are_whole_lines_with_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long");
        let lines: Vec<String> =
            (1..=30_000).map(|number| format!("this is line {number}\n")).collect();
        let whole = lines.concat();
        fs::write(&path, &whole).unwrap();
        let blocks = || Blocks::open(&path, whole.len() as u64).unwrap();
        let texts: Vec<_> = blocks().map(|block| block.unwrap().text().unwrap()).collect();
        assert!(texts.len() > 1);
        for (line, text) in &texts {
            assert!(text.starts_with(&lines[line - 1]) && text.ends_with('\n'));
        }
        assert_eq!(texts.into_iter().map(|(_, text)| text).collect::<String>(), whole);
        let one_less = Blocks::open(&path, whole.len() as u64 - 1).unwrap();
        let why = one_less.filter_map(Result::err).next().unwrap();
        assert_eq!(words(&why), "it has more than 0.5 MiB, and may have 0.5 MiB");
        fs::write(&path, [whole.as_bytes(), b"\xFF"].concat()).unwrap();
        let why = Blocks::open(&path, LARGEST).unwrap().find_map(|it| it.unwrap().text().err());
        assert_eq!(words(&why.unwrap()), "line 30001 is not UTF-8");
    }
}
