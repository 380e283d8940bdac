//! Data sheets as files: what they say, where, and what is wrong with them.

use std::sync::OnceLock;

use canopen::Mux;
use canopen::eds::{self, Diagnostic, Eds, Places};

use crate::source::{Place, Source};

/// The first line of a sheet that was composed of what a device answered.
pub(crate) const COMPOSED: &str = "composed by `harness eds probe` of what the device answered";

/// A data sheet.
#[derive(Debug, Default)]
pub struct Sheet {
    /// The decoded text, by the name by which the user knows it.
    pub source: Source,
    /// What was found while reading it.
    pub diagnostics: Vec<Diagnostic>,
    /// Whether it comes with the device and the suites: what does not fit it is wrong with a suite.
    pub trusted: bool,
    /// Whether it was composed of what the device answered, and thus says nothing by itself.
    pub composed: bool,
    /// Found when somebody asks, which is when something is wrong.
    places: OnceLock<Places>,
}

impl Sheet {
    /// Reads a data sheet in whatever encoding.
    pub fn read(name: impl Into<String>, bytes: &[u8]) -> (Self, Eds) {
        let reading = eds::read(bytes);
        let source = Source { name: name.into(), text: eds::decode(bytes).into_owned() };
        let diagnostics = reading.diagnostics;
        let composed = source.line(1).trim_start_matches([';', ' ']) == COMPOSED;
        let sheet = Self { source, diagnostics, trusted: false, composed, places: OnceLock::new() };
        (sheet, reading.eds)
    }

    /// Where it says `key` of an entry, or speaks of the entry at all.
    pub fn place_of(&self, mux: Mux, key: Option<&str>) -> Option<Place> {
        self.places.get_or_init(|| Places::of(&self.source.text)).of_entry(mux, key)
    }
}
