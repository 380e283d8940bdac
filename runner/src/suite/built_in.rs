//! The copy of `suites/` in this crate.

use std::path::Path;
use std::sync::Arc;

use include_dir::{Dir, include_dir};
use sha2::{Digest, Sha256};

use crate::source::{self, Source};

static EMBEDDED: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/../suites");

/// The suites, the register and their words, by the names that they have in the project.
pub fn built_in() -> Vec<Source> {
    let mut sources = Vec::new();
    read(&EMBEDDED, &mut sources);
    sources
}

/// The beginning of the SHA-256 of names and texts, in hexadecimal: it tells two states of files
/// apart.
pub fn fingerprint<'s>(sources: impl Iterator<Item = &'s Source>) -> String {
    let mut hash = Sha256::new();
    for source in sources {
        for part in [&*source.name, &*source.text] {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part.as_bytes());
        }
    }
    shortened(hash)
}

/// The beginning of the SHA-256 of a file, in hexadecimal: of its bytes, or block by block.
pub fn fingerprint_of<B: AsRef<[u8]>>(blocks: impl IntoIterator<Item = B>) -> String {
    let mut hash = Sha256::new();
    blocks.into_iter().for_each(|block| hash.update(block));
    shortened(hash)
}

fn shortened(hash: Sha256) -> String {
    hash.finalize().iter().take(FINGERPRINT).map(|byte| format!("{byte:02x}")).collect()
}

/// How many bytes a fingerprint has.
const FINGERPRINT: usize = 6;

/// One of the files, by its path below `suites/`, or what replaces it.
pub(super) fn standard(path: &str) -> Option<Arc<Source>> {
    let text = EMBEDDED.get_file(path)?.contents_utf8()?;
    Some(source::built_in(&format!("suites/{path}"), text))
}

/// Whether it is one of the files, with the same text.
pub(super) fn is_built_in(source: &Source) -> bool {
    let path = source.name.strip_prefix("suites/");
    path.and_then(standard).is_some_and(|known| known.text == source.text)
}

fn read(folder: &Dir<'static>, sources: &mut Vec<Source>) {
    for file in folder.files() {
        if let (Some("yaml"), Some(text)) =
            (file.path().extension().and_then(|extension| extension.to_str()), file.contents_utf8())
        {
            let name = format!("suites/{}", shown(file.path()));
            sources.push(Source::new(name, text));
        }
    }
    folder.dirs().for_each(|below| read(below, sources));
}

fn shown(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}
