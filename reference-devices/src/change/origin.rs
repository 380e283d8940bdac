//! The place of a change in its file, for complaints.

use std::sync::Arc;

use canopen::source::{Complaint, Outline, Source, Tree};

use super::data::Misfit;

/// A place in a file: the keys that lead there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origin {
    source: Arc<Source>,
    /// The content of the file, each entry in full.
    outline: Arc<Outline>,
    path: Vec<String>,
}

impl Origin {
    /// The whole file, each entry in full.
    pub(crate) fn file_of(source: &Arc<Source>, tree: Tree) -> Self {
        let outline = Arc::new(Outline::from(tree));
        Self { source: Arc::clone(source), outline, path: Vec::new() }
    }

    /// The name of the file.
    pub(crate) fn file(&self) -> &str {
        &self.source.name
    }

    /// The part below these keys.
    pub(crate) fn below(&self, keys: &[&str]) -> Self {
        let path = self.path.iter().cloned().chain(keys.iter().map(|&key| key.to_owned()));
        Self { path: path.collect(), ..self.clone() }
    }

    /// The file, and the line.
    pub(crate) fn file_and_line(&self) -> String {
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        format!("{}:{}", self.source.name, self.outline.nearest(&path).line)
    }

    /// The text at this place, in one line.
    pub(crate) fn text(&self) -> String {
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        self.outline.in_one_line(&path)
    }

    /// A complaint about the text at this place, at an offset in bytes from its start.
    pub(crate) fn complaint(&self, offset: usize, message: impl Into<String>) -> Complaint {
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        let place = self.outline.nearest(&path);
        // Filled-in text has no place of its own: the row is shown.
        let is_there = self.outline.text(&path).is_some_and(|text| self.source.has(place, text));
        let place = self.source.inside(place, if is_there { offset } else { 0 });
        Complaint::at(&self.source, place, message)
    }

    /// The complaint about a change that stands here and does not fit its device.
    pub(super) fn refuse(&self, misfit: &Misfit) -> Complaint {
        let keys: Vec<&str> = misfit.path.iter().map(String::as_str).collect();
        self.below(&keys).complaint(misfit.offset, misfit.message.clone())
    }
}
