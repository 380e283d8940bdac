//! What CiA 311 asks of elements, and keys of a section cannot show.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use roxmltree::{Attribute, Node};

use super::entry::{ATTRIBUTES, PARAMETER, hex};
use super::{COMMISSIONING, FILE, GENERAL, MASTER, Scribe, Told, is};
use crate::eds::codes::{self, Code};
use crate::eds::model::{Access, Direction};
use crate::source::Place;

impl<'d, 'i> Scribe<'d, 'i, '_> {
    /// Checks names and identifiers of what is read.
    pub(super) fn check_elements(&mut self) {
        for node in self.root.descendants().filter(Node::is_element) {
            self.unique(node);
            self.reference(node);
            self.names(node);
        }
    }

    fn unique(&mut self, node: Node<'d, 'i>) {
        let id = node.attribute_node("uniqueID");
        let Some(id) = id.filter(|id| !id.value().is_empty()) else { return };
        let first = self.referred[id.value()];
        if first != node {
            let at = self.lines.at(id.range().start);
            self.second(&codes::DUPLICATE_KEY, &format!("uniqueID {:?}", id.value()), first, at);
        }
    }

    fn reference(&mut self, node: Node<'d, 'i>) {
        let known = REFERENCES.iter().find(|(element, _)| is(&node, element));
        let Some(id) = known.and_then(|(_, name)| node.attribute_node(*name)) else { return };
        // Editors leave empty what says nothing.
        if !id.value().is_empty() && !self.referred.contains_key(id.value()) {
            let message = format!("{}: no element has the uniqueID {:?}", id.name(), id.value());
            self.findings.add(&codes::REFERENCE, self.lines.at(id.range_value().start), message);
        }
    }

    /// Notes attributes that CiA 311 does not have. Those with a namespace belong to somebody else.
    fn names(&mut self, node: Node<'d, 'i>) {
        let name = node.tag_name();
        let is_ours = name.namespace().is_none_or(|it| it.is_empty() || it.starts_with(OURS));
        let known = KNOWN.iter().find(|(elements, ..)| elements.contains(&name.name()));
        let Some((_, told, others)) = known.filter(|_| is_ours) else { return };
        let all = || told.iter().map(|(name, ..)| *name).chain(others.iter().copied());
        let is_unknown = |it: &Attribute<'_, '_>| {
            it.namespace().is_none() && all().all(|known| known != it.name())
        };
        for attribute in node.attributes().filter(is_unknown) {
            let wrong = attribute.name();
            let usual = all().find(|known| known.eq_ignore_ascii_case(wrong));
            let rest = match usual {
                Some(usual) => format!("{usual:?} is"),
                None => "it is left out".to_owned(),
            };
            let element = name.name();
            let message = format!("attribute {wrong:?} is not defined for {element}; {rest}");
            let at = self.lines.at(attribute.range().start);
            self.findings.habit(&codes::UNKNOWN_KEY, at, message);
        }
    }

    /// Checks how a value says for which PDOs it is.
    pub(super) fn direction(&mut self, node: Node<'d, 'i>) {
        if let Some(access) = node.attribute_node("accessType")
            && let wrong @ ("rwr" | "rww") = access.value().trim()
        {
            let mapping = if wrong == "rwr" { "TPDO" } else { "RPDO" };
            let message = format!(
                "accessType {wrong} is for an EDS; here it is rw with PDOmapping {mapping}"
            );
            let at = self.lines.at(access.range_value().start);
            self.findings.habit(&codes::MAPPING_DIRECTION, at, message);
        }
        let Some(mapping) = node.attribute_node("PDOmapping") else { return };
        let direction = match mapping.value().trim() {
            "RPDO" => Direction::Receive,
            "TPDO" => Direction::Transmit,
            _ => return,
        };
        let Some((said, key)) = self.access(node) else { return };
        if Access::named(key).is_some_and(|access| !access.fits(direction)) {
            let message = format!("PDOmapping {} contradicts {said}", mapping.value());
            let at = self.lines.at(mapping.range_value().start);
            self.findings.add(&codes::PDO_DIRECTION, at, message);
        }
    }

    /// Of objects with one index the first one counts.
    pub(super) fn leave_out_second_objects(&mut self) {
        let (firsts, seconds) = by_number(self.objects.iter().copied(), "index");
        self.objects = firsts;
        for [first, second] in seconds {
            let index = second.attribute("index").and_then(hex).unwrap_or_default();
            let at = self.place(second);
            self.second(&codes::DUPLICATE_SECTION, &format!("object {index:04X}h"), first, at);
        }
    }

    pub(super) fn second(&mut self, code: &Code, name: &str, first: Node<'d, 'i>, at: Place) {
        let Place { line, column } = self.place(first);
        let message = format!("{name} already exists at {line}:{column}; the first one counts");
        self.findings.add(code, at, message);
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

/// The attributes that refer to elements, of elements that are read.
const REFERENCES: [(&str, &str); 7] = [
    ("CANopenObject", "uniqueIDRef"),
    ("CANopenSubObject", "uniqueIDRef"),
    ("dataTypeIDRef", "uniqueIDRef"),
    ("variableIDRef", "uniqueIDRef"),
    ("memberRef", "uniqueIDRef"),
    ("parameter", "templateIDRef"),
    ("allowedValues", "templateIDRef"),
];

/// How the namespace starts, in each edition.
const OURS: &str = "http://www.canopen.org/xml/";

/// Elements, the attributes of them that have a key, and those that are read otherwise or not.
type Known = (&'static [&'static str], &'static [Told], &'static [&'static str]);

const KNOWN: &[Known] = &[
    (
        &["ProfileBody"],
        FILE,
        &["fileVersion", "formatName", "formatVersion", "supportedLanguages", "deviceClass"],
    ),
    (&["CANopenObject"], ATTRIBUTES, &["index", "PDOmapping", "uniqueIDRef", "rangeSelector"]),
    (
        &["CANopenSubObject"],
        ATTRIBUTES,
        &["subIndex", "PDOmapping", "uniqueIDRef", "rangeSelector"],
    ),
    (
        &["parameter", "parameterTemplate"],
        PARAMETER,
        &[
            "uniqueID",
            "templateIDRef",
            "accessList",
            "support",
            "persistent",
            "offset",
            "multiplier",
        ],
    ),
    (
        &["defaultValue", "actualValue", "minValue", "maxValue"],
        &[],
        &["value", "offset", "multiplier"],
    ),
    (&["dataTypeIDRef", "variableIDRef"], &[], &["uniqueIDRef"]),
    (&["allowedValues"], &[], &["templateIDRef"]),
    (&["CANopenObjectList"], &[], &["mandatoryObjects", "optionalObjects", "manufacturerObjects"]),
    (&["dummy"], &[], &["entry"]),
    (&["supportedBaudRate"], &[], &["value"]),
    (&["CANopenGeneralFeatures"], GENERAL, &["selfStartingDevice", "SDORequestingDevice"]),
    (
        &["CANopenMasterFeatures"],
        MASTER,
        &["flyingMaster", "SDOManager", "configurationManager", "layerSettingServiceMaster"],
    ),
    (&["deviceCommissioning"], COMMISSIONING, &[]),
];
