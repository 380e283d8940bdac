//! The lists of objects, and whether they are correct.

use super::{Kept, Reader, is_one_of};
use crate::eds::codes;
use crate::eds::ini::{Key, List, Name, Section};
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
        let (keys, kept) = self.list_keys(section, "SupportedObjects");
        for key in keys {
            if let Some(index) = value::unsigned(&key, u16::MAX.into(), &mut self.findings) {
                listed.push(Listed { index: index as u16, list, at: key.at });
            }
        }
        self.keep_keys(section.name, kept);
    }

    /// The numbered keys of a list in their order, and those that have no place; checks that
    /// `count` is the number of them.
    pub(super) fn list_keys<'a>(
        &mut self,
        section: &Section<'a>,
        count: &str,
    ) -> (Vec<Key<'a>>, Kept) {
        let kept =
            self.others(section, |name| place_in_list(name).is_some() || is_one_of(name, &[count]));
        let placed = |key: &Key<'a>| Some((place_in_list(key.name)?, *key));
        let mut keys: Vec<_> = section.keys.iter().filter_map(placed).collect();
        self.check_count(section, count, keys.len() as u64);
        keys.sort_by_key(|(place, key)| (*place, key.name_at));
        let gap = (1..).zip(&keys).find(|(expected, (place, _))| expected != place);
        if let Some((expected, (_, key))) = gap {
            let message =
                format!("section [{}] has no key {expected} before this one", section.title);
            self.findings.add(&codes::LIST_KEY, key.name_at, message);
        }
        (keys.into_iter().map(|(_, key)| key).collect(), kept)
    }

    fn check_count(&mut self, section: &Section<'_>, count: &str, there_are: u64) {
        let Some(key) = section.filled(count) else {
            let message = format!("section [{}] lacks {count}", section.title);
            self.findings.add(&codes::LIST_COUNT, section.at, message);
            return;
        };
        let stated = value::unsigned(key, u64::MAX, &mut self.findings);
        if let Some(stated) = stated
            && stated != there_are
        {
            let message = format!("{count} is {stated} instead of {there_are}");
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
