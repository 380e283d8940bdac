//! Files that reports go to: written at once, or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// A file that a report goes to.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// As the user named it.
    path: PathBuf,
    /// The place of the file; for a link, its target.
    place: PathBuf,
}

impl Output {
    /// The file of that name, which need not be there.
    ///
    /// # Errors
    /// When there is no such folder.
    pub(crate) fn new(path: &Path) -> io::Result<Self> {
        Ok(Self { path: path.to_owned(), place: place(path)? })
    }

    /// As the user named it.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether both are the same file. A device such as `/dev/null` takes anything and never counts
    /// as the same.
    pub(crate) fn is_same(&self, other: &Path) -> bool {
        self.is_file() && place(other).is_ok_and(|other| other == self.place)
    }

    /// Whether it is a file, or will be one.
    pub(crate) fn is_file(&self) -> bool {
        fs::metadata(&self.place).map_or(true, |found| found.is_file())
    }

    /// Whether there is a file of something else: it neither is empty nor begins so.
    pub(crate) fn holds_other_than(&self, begins: &[u8]) -> bool {
        if !self.is_file() {
            return false;
        }
        let mut first = Vec::new();
        let file = File::open(&self.place);
        let read = file.and_then(|file| file.take(begins.len() as u64).read_to_end(&mut first));
        read.is_ok() && !first.is_empty() && first != begins
    }

    /// Writes the whole file. A reader sees either the old content or all of the new one. Where the
    /// file cannot be replaced, `content` is called a second time to write in place.
    ///
    /// # Errors
    /// The cause that prevents the write. The old content is left then.
    pub(crate) fn write(
        &self,
        content: impl Fn(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let in_place = || written(File::create(&self.place)?, &content).map(drop);
        if !self.is_file() {
            return in_place();
        }
        let name = self.place.file_name().unwrap_or_default().to_string_lossy();
        let beside = self.place.with_file_name(format!(".{name}.{}", std::process::id()));
        let synced = || written(File::create(&beside)?, &content)?.sync_all();
        synced().and_then(|()| fs::rename(&beside, &self.place)).or_else(|error| {
            // The temporary file may not exist.
            _ = fs::remove_file(&beside);
            if stands_alone(&error) { in_place() } else { Err(error) }
        })
    }
}

fn written(file: File, content: impl Fn(&mut dyn Write) -> io::Result<()>) -> io::Result<File> {
    let mut out = BufWriter::new(file);
    content(&mut out)?;
    Ok(out.into_inner()?)
}

/// Whether a file can be written in place but not replaced: its folder belongs to another user, or
/// the file is mounted alone.
fn stands_alone(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::PermissionDenied
            | io::ErrorKind::ReadOnlyFilesystem
            | io::ErrorKind::ResourceBusy
            | io::ErrorKind::CrossesDevices
    )
}

fn place(path: &Path) -> io::Result<PathBuf> {
    if let Ok(place) = path.canonicalize() {
        return Ok(place);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or_else(|| Path::new(".")).canonicalize()?;
    Ok(folder.join(path.file_name().ok_or(io::ErrorKind::IsADirectory)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn anything(out: &mut dyn Write) -> io::Result<()> {
        out.write_all(b"anything")
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_is_replaced_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.xml");
        let output = Output::new(&path).unwrap();
        for text in ["first", "second, which is longer", ""] {
            output.write(|out| out.write_all(text.as_bytes())).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(folder.path()), ["report.xml"]);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_stays_one() {
        let folder = tempfile::tempdir().unwrap();
        let (link, path) = (folder.path().join("link"), folder.path().join("file"));
        fs::write(&path, "before").unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        Output::new(&link).unwrap().write(|out| out.write_all(b"after")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "after");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(Output::new(&link).unwrap().is_same(&path));
    }

    #[test]
    #[cfg(unix)]
    fn a_device_takes_what_is_written_and_stays() {
        let null = Output::new(Path::new("/dev/null")).unwrap();
        null.write(anything).unwrap();
        assert!(!null.is_same(Path::new("/dev/null")));
        let full = Output::new(Path::new("/dev/full")).unwrap();
        let full = crate::files::words(&full.write(anything).unwrap_err());
        assert_eq!(full, "No space left on device");
    }

    #[test]
    fn what_cannot_be_written_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Output::new(&folder.path().join("none/report.xml")).is_err());
        let output = Output::new(folder.path()).unwrap();
        assert!(output.write(anything).is_err(), "a folder is not a file");
        assert_eq!(names(folder.path()), Vec::<String>::new());
    }
}
