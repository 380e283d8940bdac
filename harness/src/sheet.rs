//! Data sheets as files: what they say, where, and what is wrong with them.

use std::sync::OnceLock;

use canopen::Mux;
use canopen::eds::{self, Diagnostic, Eds, Places};

use crate::source::Source;

/// A data sheet.
#[derive(Debug, Default)]
pub struct Sheet {
    /// The decoded text, by the name by which the user knows it.
    pub source: Source,
    /// What was found while reading it.
    pub diagnostics: Vec<Diagnostic>,
    /// Whether it comes with the device and the suites: what does not fit it is wrong with a suite.
    pub trusted: bool,
    /// Found when somebody asks, which is when something is wrong.
    places: OnceLock<Places>,
}

impl Sheet {
    /// Reads a data sheet in whatever encoding.
    pub fn read(name: impl Into<String>, bytes: &[u8]) -> (Self, Eds) {
        let reading = eds::read(bytes);
        let source = Source { name: name.into(), text: eds::decode(bytes).into_owned() };
        let diagnostics = reading.diagnostics;
        (Self { source, diagnostics, trusted: false, places: OnceLock::new() }, reading.eds)
    }

    /// The line and column where it says `key` of an entry, or speaks of the entry at all.
    pub fn place_of(&self, mux: Mux, key: Option<&str>) -> Option<(usize, usize)> {
        self.places.get_or_init(|| Places::of(&self.source.text)).of_entry(mux, key)
    }
}
