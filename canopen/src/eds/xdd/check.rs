//! What CiA 311 asks of elements, and keys of a section cannot show.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use roxmltree::Node;

use super::Scribe;
use super::entry::hex;
use crate::eds::codes;

impl<'d, 'i> Scribe<'d, 'i, '_> {
    /// Of objects with one index the first one counts.
    pub(super) fn leave_out_second_objects(&mut self) {
        let (firsts, seconds) = by_number(self.objects.iter().copied(), "index");
        self.objects = firsts;
        for [first, second] in seconds {
            let index = second.attribute("index").and_then(hex).unwrap_or_default();
            self.second(first, second, &format!("object {index:04X}h"));
        }
    }

    pub(super) fn second(&mut self, first: Node<'d, 'i>, second: Node<'d, 'i>, name: &str) {
        let (first, at) = (self.place(first), self.place(second));
        let (line, column) = (first.line, first.column);
        let message = format!("{name} already exists at {line}:{column}; the first one counts");
        self.findings.add(&codes::DUPLICATE_SECTION, at, message);
    }
}

/// The first element of each number, and the others, each behind the first one of its number. One
/// that has no number is for the reader to report.
pub(super) fn by_number<'d, 'i>(
    nodes: impl Iterator<Item = Node<'d, 'i>>,
    attribute: &str,
) -> (Vec<Node<'d, 'i>>, Vec<[Node<'d, 'i>; 2]>) {
    let (mut firsts, mut seconds) = (Vec::new(), Vec::new());
    let mut seen = HashMap::new();
    for node in nodes {
        match node.attribute(attribute).and_then(hex).map(|number| seen.entry(number)) {
            Some(Entry::Occupied(first)) => seconds.push([*first.get(), node]),
            Some(Entry::Vacant(free)) => firsts.push(*free.insert(node)),
            None => firsts.push(node),
        }
    }
    (firsts, seconds)
}
