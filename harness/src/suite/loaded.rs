//! A suite as it was loaded.

use std::sync::Arc;

use super::model::SuiteFile;
use crate::source::Source;

/// A loaded suite.
#[derive(Debug)]
pub struct Suite {
    /// Its file.
    pub source: Arc<Source>,
    /// What is written there.
    pub file: SuiteFile,
}

impl Suite {
    /// `folder/topic`.
    pub fn name(&self) -> &str {
        &self.file.suite.value
    }
}
