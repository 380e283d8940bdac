//! A suite as it was loaded.

use std::sync::Arc;

use canopen::catalogue::{Catalogue, Profile};

use super::model::SuiteFile;
use super::profile::About;
use super::words::Words;
use crate::source::Source;

/// A loaded suite.
#[derive(Debug)]
pub struct Suite {
    /// Its file.
    pub source: Arc<Source>,
    /// The name of the file.
    pub path: Arc<str>,
    /// What is written there.
    pub file: SuiteFile,
    /// The profiles it uses.
    pub catalogue: Arc<Catalogue>,
    /// Its document's words for objects and values.
    pub words: Words,
    /// Whether this is a file of this crate: its cases are proved on the reference devices, so
    /// where one does not fit a data sheet, the data sheet is wrong.
    pub is_built_in: bool,
}

impl Suite {
    /// `folder/topic`.
    pub fn name(&self) -> &str {
        &self.file.suite.value
    }

    /// The profile it is about, when it names one.
    pub fn profile(&self) -> Option<&Profile> {
        self.file.profile.as_ref()?.value.named(&self.catalogue).ok()?
    }

    /// The subject of the suite, as sentences name it; `None` when it is about any device.
    pub fn about(&self) -> Option<String> {
        Some(match &self.file.profile.as_ref()?.value {
            About::Number(number) => format!("CiA {number}"),
            About::Named(name) => self.profile().map_or(name.as_str(), Profile::title).to_owned(),
        })
    }
}
