//! The lists of objects, and whether they are correct.

use super::{Reader, is_one_of};
use crate::eds::codes;
use crate::eds::ini::{List, Name, Section};
use crate::eds::value;
use crate::source::Place;

/// An object as a list names it.
pub(super) struct Listed {
    index: u16,
    list: List,
    at: Place,
}

impl Reader {
    /// The objects that the lists name.
    pub(super) fn lists(&mut self, sections: &[Section<'_>]) -> Vec<Listed> {
        let mut listed = Vec::new();
        for section in sections {
            if let Name::Objects(list) = section.name {
                self.list(section, list, &mut listed);
            }
        }
        listed
    }

    fn list(&mut self, section: &Section<'_>, list: List, listed: &mut Vec<Listed>) {
        let kept = self.others(section, |name| {
            place_in_list(name).is_some() || is_one_of(name, &["SupportedObjects"])
        });
        let mut places = Vec::with_capacity(section.keys.len());
        for key in &section.keys {
            let Some(place) = place_in_list(key.name) else { continue };
            places.push((place, key.name_at));
            if let Some(index) = value::unsigned(key, u16::MAX.into(), &mut self.findings) {
                listed.push(Listed { index: index as u16, list, at: key.at });
            }
        }
        self.check_count(section, places.len() as u64);
        places.sort_unstable();
        if let Some((expected, &(_, at))) =
            (1..).zip(&places).find(|(expected, (place, _))| expected != place)
        {
            let message =
                format!("section [{}] has no key {expected} before this one", list.title());
            self.findings.add(&codes::LIST_KEY, at, message);
        }
        self.keep_keys(section.name, kept);
    }

    fn check_count(&mut self, section: &Section<'_>, there_are: u64) {
        let Some(key) = section.filled("SupportedObjects") else {
            let message = format!("section [{}] lacks SupportedObjects", section.title);
            self.findings.add(&codes::LIST_COUNT, section.at, message);
            return;
        };
        let count = value::unsigned(key, u64::MAX, &mut self.findings);
        if let Some(count) = count
            && count != there_are
        {
            let message = format!("SupportedObjects is {count} instead of {there_are}");
            self.findings.add(&codes::LIST_COUNT, key.at, message);
        }
    }

    /// Compares the lists with the objects.
    pub(super) fn check_lists(&mut self, mut listed: Vec<Listed>) {
        listed.sort_by_key(|entry| (entry.index, entry.at));
        for (place, entry) in listed.iter().enumerate() {
            let Listed { index, list, at } = entry;
            if let Some(first) = place.checked_sub(1).map(|place| &listed[place])
                && first.index == *index
            {
                let message =
                    format!("object {index:04X}h is already listed in line {}", first.at.line);
                self.findings.add(&codes::LISTED_TWICE, *at, message);
            } else if self.eds.object(*index).is_none() {
                let message = format!("object {index:04X}h is listed, but has no section");
                self.findings.add(&codes::NO_SECTION, *at, message);
            }
            let mandatory = MANDATORY.contains(index) && *list != List::Mandatory;
            if mandatory || (0x2000..0x6000).contains(index) != (*list == List::Manufacturer) {
                let message = format!("object {index:04X}h does not belong into {}", list.title());
                self.findings.add(&codes::LIST_RANGE, *at, message);
            }
        }
        for object in &self.eds.objects {
            // Data type definitions need not be listed.
            let needed = object.index >= 0x1000;
            if needed && listed.binary_search_by_key(&object.index, |entry| entry.index).is_err() {
                let message = format!("object {:04X}h is in none of the lists", object.index);
                self.findings.add(&codes::NOT_LISTED, Place::of_line(object.line), message);
            }
        }
    }
}

fn place_in_list(name: &str) -> Option<u32> {
    let digits = name.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| name.parse().ok()).flatten()
}

/// The objects that every device has.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];
