//! Files on disk, and what is said of them.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// What an operating system says of an error, without the number.
pub(crate) fn words(error: &io::Error) -> String {
    let words = error.to_string();
    words.split(" (os error").next().unwrap_or_default().to_owned()
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
