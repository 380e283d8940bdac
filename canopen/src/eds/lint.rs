//! Statements of a data sheet that cannot be right, or that no device should make.
//!
//! A finding needs the data sheet alone. What can only be read in one way although it is badly
//! written is found by [`read`](super::read) on the way.

mod object;
mod pdo;

use std::collections::BTreeSet;

use super::codes::{self, Code};
use super::diagnostic::{Diagnostic, Findings};
use super::ini::{List, Name, Part, Section};
use super::model::{Eds, Entry, Object};
use crate::mux::Mux;
use crate::source::Place;
use crate::value::Value;

/// The faults of a data sheet from any source. [`read`](super::read) reports the same with exact
/// columns; here a line is that of the section, and 0 if the data sheet comes from no file.
pub fn lint(eds: &Eds) -> Vec<Diagnostic> {
    let mut findings = Findings::default();
    check(eds, &Origin::default(), &mut findings);
    findings.finish()
}

/// From what a data sheet was read; from nothing when it comes from no file.
#[derive(Default)]
pub(super) struct Origin<'s, 'a> {
    /// Sorted.
    pub(super) sections: &'s [Section<'a>],
    /// The objects that modules may add.
    pub(super) of_modules: BTreeSet<u16>,
    /// Whether the sections are made of XML, which has other words.
    pub(super) is_xml: bool,
}

/// Checks what was read.
pub(super) fn check(eds: &Eds, origin: &Origin<'_, '_>, findings: &mut Findings) {
    let mut lint = Lint { eds, origin, findings };
    lint.mandatory();
    lint.identity();
    for object in &eds.objects {
        lint.object(object);
    }
    lint.pdos();
}

struct Lint<'e, 's, 'a> {
    eds: &'e Eds,
    origin: &'s Origin<'s, 'a>,
    findings: &'s mut Findings,
}

impl Lint<'_, '_, '_> {
    fn mandatory(&mut self) {
        let at = self.place(Name::Objects(List::Mandatory), None).unwrap_or(Place::new(1, 1));
        for (index, name) in
            [(0x1000, "device type"), (0x1001, "error register"), (0x1018, "identity")]
        {
            if self.eds.object(index).is_none() {
                let message = format!("object {index:04X}h ({name}) is missing");
                self.findings.add(&codes::MANDATORY_OBJECT, at, message);
            }
        }
        let has = |index| self.eds.object(index).is_some();
        if !(has(0x1017) || has(0x100C) && has(0x100D)) {
            let message = "heartbeat (1017h) and node guarding (100Ch, 100Dh) are both missing";
            self.findings.add(&codes::ERROR_CONTROL, at, message);
        }
    }

    fn identity(&mut self) {
        let device = &self.eds.device;
        for (sub, key, stated) in [
            (1, "VendorNumber", device.vendor_number),
            (2, "ProductNumber", device.product_number),
            (3, "RevisionNumber", device.revision_number),
        ] {
            if let Some(default) = self.fixed(Mux::new(0x1018, sub))
                && default != i128::from(stated)
            {
                let at = self.place(Name::DeviceInfo, Some(key)).unwrap_or(Place::new(1, 1));
                let message = format!(
                    "{key} is 0x{stated:X}, but 1018:{sub:02X} has the default 0x{default:X}"
                );
                self.findings.add(&codes::IDENTITY, at, message);
            }
        }
    }

    /// The whole number that an entry has by default, when it does not depend on the node id.
    fn fixed(&self, mux: Mux) -> Option<i128> {
        let term = self.eds.entry(mux)?.default.as_ref()?;
        match term.value {
            Value::Int(number) if !term.plus_node => Some(number),
            _ => None,
        }
    }

    fn add_at(&mut self, code: &Code, entry: &Entry, key: &str, message: String) {
        let at = self.entry_place(entry, key);
        self.findings.add(code, at, message);
    }

    fn add(&mut self, code: &Code, object: &Object, message: String) {
        let at = self.object_place(object);
        self.findings.add(code, at, message);
    }

    fn object_place(&self, object: &Object) -> Place {
        let head = self.place(Name::Object(object.index, Part::Head), None);
        head.unwrap_or_else(|| Place::of_line(object.line))
    }

    /// Where the sheet says `key` of an entry, or where it speaks of the entry at all.
    fn entry_place(&self, entry: &Entry, key: &str) -> Place {
        let Mux { index, sub } = entry.mux;
        let section = Name::Object(index, Part::Sub(sub));
        let short = Name::Object(index, Part::Values);
        let head = Name::Object(index, Part::Head);
        self.place(section, Some(key))
            .or_else(|| self.place(section, None))
            .or_else(|| self.place(short, Some(&sub.to_string())).filter(|_| key == DEFAULT))
            .or_else(|| self.module_place(entry.line, key))
            .or_else(|| self.place(head, Some(key)))
            .or_else(|| self.place(head, None))
            .unwrap_or_else(|| Place::of_line(entry.line))
    }

    /// Where the section of a module in that line says `key`, or where it starts.
    fn module_place(&self, line: usize, key: &str) -> Option<Place> {
        let first =
            self.origin.sections.partition_point(|section| section.name < Name::SupportedModules);
        let section = self.origin.sections[first..]
            .iter()
            .find(|section| matches!(section.name, Name::Module(..)) && section.at.line == line)?;
        Some(section.key(key).map_or(section.at, |key| key.at))
    }

    /// What the sheet says as `key` of an entry.
    fn entry_text(&self, entry: &Entry, key: &str) -> Option<&str> {
        let Mux { index, sub } = entry.mux;
        let section = self.section(Name::Object(index, Part::Sub(sub)));
        let section = section.or_else(|| self.section(Name::Object(index, Part::Head)))?;
        section.filled(key).map(|key| key.value)
    }

    fn section(&self, name: Name) -> Option<&Section<'_>> {
        let place =
            self.origin.sections.binary_search_by_key(&name, |section| section.name).ok()?;
        Some(&self.origin.sections[place])
    }

    /// Where a section starts, or where the value of one of its keys does.
    fn place(&self, name: Name, key: Option<&str>) -> Option<Place> {
        let section = self.section(name)?;
        match key {
            None => Some(section.at),
            Some(key) => section.key(key).map(|key| key.at),
        }
    }
}

const DEFAULT: &str = "DefaultValue";
