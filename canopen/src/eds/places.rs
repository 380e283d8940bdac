//! The places of the statements of a data sheet.

use std::collections::BTreeMap;

use super::diagnostic::Findings;
use super::ini::{self, Name, Part};
use super::xdd::{self, Transcript};
use crate::mux::Mux;
use crate::source::Place;

/// Where the sections of objects and their keys are, line and column counted from 1.
#[derive(Debug, Default)]
pub struct Places {
    sections: BTreeMap<Name, Lines>,
    /// The sections of modules, by their lines.
    of_modules: BTreeMap<usize, Lines>,
}

#[derive(Debug)]
struct Lines {
    at: Place,
    keys: Vec<(String, Place)>,
}

impl Places {
    /// The places in a decoded text.
    pub fn of(text: &str) -> Self {
        let findings = &mut Findings::default();
        let transcript;
        let sections = if xdd::is_xml(text) {
            transcript = Transcript::of(text, findings);
            transcript.sections(findings)
        } else {
            ini::parse(text, findings)
        };
        let lines = |section: &ini::Section<'_>| Lines {
            at: section.at,
            keys: section.keys.iter().map(|key| (key.name.to_owned(), key.name_at)).collect(),
        };
        let objects = sections.iter().filter(|section| matches!(section.name, Name::Object(..)));
        let modules = sections.iter().filter(|section| matches!(section.name, Name::Module(..)));
        Self {
            sections: objects.map(|section| (section.name, lines(section))).collect(),
            of_modules: modules.map(|section| (section.at.line, lines(section))).collect(),
        }
    }

    /// Where the section of a module in that line says `key`; when it does not, or without a key,
    /// where it starts.
    pub fn of_module(&self, line: usize, key: Option<&str>) -> Option<Place> {
        let section = self.of_modules.get(&line)?;
        Some(key.and_then(|key| section.key(key)).unwrap_or(section.at))
    }

    /// Where the sheet says `key` of an entry; when it does not, or without a key, where it speaks
    /// of the entry at all.
    pub fn of_entry(&self, mux: Mux, key: Option<&str>) -> Option<Place> {
        let sub = self.sections.get(&Name::Object(mux.index, Part::Sub(mux.sub)));
        let values = self.sections.get(&Name::Object(mux.index, Part::Values));
        let head = self.sections.get(&Name::Object(mux.index, Part::Head));
        let number = mux.sub.to_string();
        let short = values.filter(|_| key.is_none_or(|key| key == "DefaultValue"));
        key.and_then(|key| sub.and_then(|sub| sub.key(key)))
            .or_else(|| sub.map(|sub| sub.at))
            .or_else(|| short.and_then(|short| short.key(&number)))
            .or_else(|| key.and_then(|key| head.and_then(|head| head.key(key))))
            .or_else(|| head.map(|head| head.at))
    }
}

impl Lines {
    fn key(&self, name: &str) -> Option<Place> {
        self.keys.iter().find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, at)| *at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_of_the_section_of_a_module() {
        let places = Places::of("[1000]\n[M1SubExt6000]\nDataType=5\n Count=1\n");
        for (line, key, place) in [
            (2, Some("Count"), Some(Place::new(4, 2))),
            (2, Some("LowLimit"), Some(Place::new(2, 1))),
            (2, None, Some(Place::new(2, 1))),
            (1, None, None),
        ] {
            assert_eq!(places.of_module(line, key), place, "{line} {key:?}");
        }
    }

    #[test]
    fn a_key_its_section_or_nothing() {
        let text = "[1000]\nDataType=7\n[2000]\nSubNumber=2\n[2000sub0]\nDataType=5\n\
                    [2000sub1]\n DefaultValue=3\n[2001]\nDataType=5\nCompactSubObj=9\n\
                    [2001Value]\nNrOfEntries=1\n2=7\n";
        let places = Places::of(text);
        for (index, sub, key, place) in [
            (0x1000, 0, Some("DataType"), Some((2, 1))),
            (0x1000, 0, Some("LowLimit"), Some((1, 1))),
            (0x1000, 0, None, Some((1, 1))),
            (0x2000, 1, Some("defaultvalue"), Some((8, 2))),
            (0x2000, 1, Some("LowLimit"), Some((7, 1))),
            (0x2000, 7, None, Some((3, 1))),
            (0x2001, 2, Some("DefaultValue"), Some((14, 1))),
            (0x2001, 2, Some("DataType"), Some((10, 1))),
            (0x3000, 0, None, None),
        ] {
            assert_eq!(
                places.of_entry(Mux::new(index, sub), key),
                place.map(|(line, column)| Place::new(line, column)),
                "{index:X}:{sub} {key:?}"
            );
        }
    }
}
