//! Where a change stands, for complaints.

use std::sync::Arc;

use canopen::source::{Complaint, Outline, Source};

use super::data::Misfit;

/// A place in a file: the keys that lead there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origin {
    source: Arc<Source>,
    path: Vec<String>,
}

impl Origin {
    /// The item of that number, counted from 0, in a list of the file.
    pub(crate) fn item(source: &Arc<Source>, list: &str, number: usize) -> Self {
        Self { source: Arc::clone(source), path: vec![list.to_owned(), number.to_string()] }
    }

    /// The name of the file.
    pub(crate) fn file(&self) -> &str {
        &self.source.name
    }

    /// What stands below these keys.
    pub(crate) fn below(&self, keys: &[&str]) -> Self {
        let path = self.path.iter().cloned().chain(keys.iter().map(|&key| key.to_owned()));
        Self { source: Arc::clone(&self.source), path: path.collect() }
    }

    /// A complaint about what stands here, so many bytes after its start.
    pub(crate) fn complaint(&self, offset: usize, message: impl Into<String>) -> Complaint {
        let path: Vec<&str> = self.path.iter().map(String::as_str).collect();
        let outline = Outline::of(&self.source);
        let place = outline.map(|outline| self.source.inside(outline.nearest(&path), offset));
        Complaint { source: Arc::clone(&self.source), place, message: message.into() }
    }

    /// The complaint about a change that stands here and does not fit its device.
    pub(super) fn refuse(&self, misfit: &Misfit) -> Complaint {
        let keys: Vec<&str> = misfit.path.iter().map(String::as_str).collect();
        self.below(&keys).complaint(misfit.offset, misfit.message.clone())
    }
}
