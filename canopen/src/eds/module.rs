//! The modules of a modular device (CiA 306-1, 8).

use std::collections::BTreeMap;

use crate::mux::Mux;

/// What a data sheet says of modules, and which of them the description counts as connected.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Modules {
    /// The modules that are described, by ascending number.
    pub supported: Vec<Module>,
    /// The numbers of the modules at places 1, 2, 3 and so on: those that were asked for, or those
    /// of `[ConnectedModules]`; `None` where nobody says it.
    pub connected: Option<Vec<u16>>,
    /// The entries that modules bring, with the lines of their sections.
    pub entries: BTreeMap<Mux, usize>,
}

/// A module that can be connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Module {
    /// Its number, from 1.
    pub number: u16,
    /// `ProductName` of its `[MxModuleInfo]`.
    pub name: String,
}

impl Modules {
    /// Whether there is a module of that number.
    pub fn supports(&self, number: u16) -> bool {
        self.supported.binary_search_by_key(&number, |module| module.number).is_ok()
    }
}
