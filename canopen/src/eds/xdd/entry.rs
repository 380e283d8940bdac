//! An object or a sub-object of CiA 311 as the keys of a section. What its own attributes leave
//! out, the parameter says that it refers to (`uniqueIDRef`).

use std::collections::{HashMap, HashSet};

use roxmltree::Node;

use super::check::by_number;
use super::{Line, Scribe, Told, as_is, decimal, fill, is, supply, truth};
use crate::value::DataType;

/// What a parameter says about the objects that refer to it.
pub(super) struct Parameter {
    keys: Vec<Line>,
    pub(super) is_disabled: bool,
}

/// What parameters refer to, by name, each read once.
#[derive(Default)]
struct Shared<'d, 'i> {
    /// Data types: the element and the code of the basic type.
    types: HashMap<&'d str, Option<(Node<'d, 'i>, u16)>>,
    /// What templates say.
    templates: HashMap<&'d str, Vec<Line>>,
}

impl<'d, 'i> Scribe<'d, 'i, '_> {
    /// Reads what objects refer to.
    pub(super) fn read_parameters(&mut self) {
        let is_entry = |it: &Node<'_, '_>| is(it, "CANopenObject") || is(it, "CANopenSubObject");
        let entries = self.root.descendants().filter(is_entry);
        let ids: HashSet<&str> = entries.filter_map(|it| it.attribute("uniqueIDRef")).collect();
        let mut shared = Shared::default();
        for id in ids {
            if let Some(node) = self.referred.get(id).copied() {
                let keys = self.parameter(node, &mut shared);
                self.parameters.insert(id, Parameter { keys, is_disabled: is_disabled(node) });
            }
        }
    }

    /// What an object refers to.
    pub(super) fn parameter_of(&self, node: Node<'d, 'i>) -> Option<&Parameter> {
        self.parameters.get(node.attribute("uniqueIDRef")?)
    }

    pub(super) fn entry(&self, node: Node<'d, 'i>) -> Vec<Line> {
        let (subs, _) = subs(node);
        let mut keys = self.attributes(node, ATTRIBUTES);
        if subs.is_empty() {
            if let Some(parameter) = self.parameter_of(node) {
                add_parameter(&mut keys, parameter);
            }
            self.mapping(node, &mut keys);
        } else {
            supply(&mut keys, [("SubNumber", subs.len())], self.place(node));
            // What is said about an array or a record as a whole is no value.
            let has_first = subs.iter().any(|it| it.attribute("subIndex").and_then(hex) == Some(0));
            match has_first {
                true => keys.retain(|line| !OF_VALUES.contains(&line.name.as_str())),
                false => self.mapping(node, &mut keys),
            }
        }
        // An editor writes each attribute that there is, and leaves those empty that say nothing.
        keys.retain(|line| !(line.value.is_empty() && MAY_BE_EMPTY.contains(&line.name.as_str())));
        keys
    }

    /// A key says whether an object can be mapped; the access type has the direction. The attribute
    /// is of this object, and a parameter is of any number of them.
    fn mapping(&self, node: Node<'d, 'i>, keys: &mut Vec<Line>) {
        let Some(attribute) = node.attribute_node("PDOmapping") else { return };
        let (mapped, access) = match attribute.value().trim() {
            "no" => ("0", None),
            "default" | "optional" => ("1", None),
            "TPDO" => ("1", Some("rwr")),
            "RPDO" => ("1", Some("rww")),
            other => (other, None),
        };
        let of_access = keys.iter_mut().find(|line| line.name == "AccessType");
        if let (Some(line), Some(access)) = (of_access, access)
            && matches!(&*line.value, "rw" | "rwr" | "rww")
        {
            line.value = access.to_owned();
        }
        keys.push(self.line("PDOMapping", attribute, mapped));
    }

    /// How the access to a value is written, and its key in CiA 306.
    pub(super) fn access(&self, node: Node<'d, 'i>) -> Option<(String, &str)> {
        let own = node.attribute("accessType").map(str::trim).filter(|own| !own.is_empty());
        if let Some(own) = own {
            return Some((format!("accessType {own}"), own));
        }
        let keys = &self.parameter_of(node)?.keys;
        let key = &*keys.iter().find(|line| line.name == "AccessType")?.value;
        let (said, _) = ACCESS.iter().find(|(_, known)| *known == key)?;
        Some((format!("access {said} of the parameter"), key))
    }

    fn parameter(&self, node: Node<'d, 'i>, shared: &mut Shared<'d, 'i>) -> Vec<Line> {
        let mut keys = self.said(node, shared);
        let allowed = node.children().find(|it| is(it, "allowedValues"));
        let from = |it: Node<'d, 'i>| it.attribute("templateIDRef");
        for id in [from(node), allowed.and_then(from)].into_iter().flatten() {
            let Some(template) = self.referred.get(id) else { continue };
            if !shared.templates.contains_key(id) {
                let said = self.said(*template, shared);
                shared.templates.insert(id, said);
            }
            fill(&mut keys, shared.templates[id].clone());
        }
        // The attribute is `read` where it is absent, as editors leave it.
        let access = Line::at("AccessType", "ro", self.place(node));
        fill(&mut keys, vec![access]);
        keys
    }

    /// What a parameter, or a template of parameters or of their limits, says itself.
    fn said(&self, node: Node<'d, 'i>, shared: &mut Shared<'d, 'i>) -> Vec<Line> {
        let mut keys = self.attributes(node, PARAMETER);
        // Limits are one range: what is allowed in several ranges has none.
        let several = node.descendants().filter(|it| is(it, "range")).count() > 1;
        let below = |name| node.descendants().find(|it| is(it, name));
        for (element, key) in [
            ("defaultValue", DEFAULT),
            ("actualValue", "ParameterValue"),
            ("minValue", "LowLimit"),
            ("maxValue", "HighLimit"),
        ] {
            let value = below(element).and_then(|it| it.attribute_node("value"));
            let is_told = !(several && key.ends_with("Limit"));
            keys.extend(value.filter(|_| is_told).map(|it| self.line(key, it, it.value())));
        }
        if let Some((at, data_type)) = self.data_type(node, shared) {
            keys.push(Line::at("DataType", &format!("0x{data_type:04X}"), self.place(at)));
        }
        keys
    }

    /// The basic type of a parameter, also behind the names of derived types and of variables.
    fn data_type(
        &self,
        node: Node<'d, 'i>,
        shared: &mut Shared<'d, 'i>,
    ) -> Option<(Node<'d, 'i>, u16)> {
        let (mut at, mut through) = (node, Vec::new());
        let found = loop {
            if let Some(found) = basic(at) {
                break Some(found);
            }
            let Some(name) = type_reference(at) else { break None };
            if let Some(known) = shared.types.get(name) {
                break *known;
            }
            // A type that refers to itself is none.
            shared.types.insert(name, None);
            through.push(name);
            let Some(next) = self.referred.get(name) else { break None };
            at = *next;
        };
        shared.types.extend(through.into_iter().map(|name| (name, found)));
        found
    }
}

/// The sub-objects of an object, as [`by_number`] tells them apart.
pub(super) fn subs<'d, 'i>(object: Node<'d, 'i>) -> (Vec<Node<'d, 'i>>, Vec<[Node<'d, 'i>; 2]>) {
    by_number(object.children().filter(|it| is(it, "CANopenSubObject")), "subIndex")
}

/// What has the type of an element: a data type, or the variable of a function, or a member of that
/// variable.
fn type_reference<'d>(node: Node<'d, '_>) -> Option<&'d str> {
    let variable = node.children().find(|it| is(it, "variableRef"));
    let mut named = node.children().filter(|it| is(it, "dataTypeIDRef"));
    let of_variable = variable.into_iter().flat_map(|it| it.children());
    let members = of_variable.filter(|it| is(it, "variableIDRef") || is(it, "memberRef"));
    let innermost = members.filter_map(|it| it.attribute("uniqueIDRef")).next_back();
    named.find_map(|it| it.attribute("uniqueIDRef")).or(innermost)
}

/// What an object does not say itself.
fn add_parameter(keys: &mut Vec<Line>, parameter: &Parameter) {
    let has_default = |keys: &[Line]| keys.iter().any(|line| line.name == DEFAULT);
    let mut new = parameter.keys.clone();
    if !has_default(keys) && !has_default(&new) {
        bits_are_domain(&mut new);
    }
    fill(keys, new);
}

/// The basic type that an element holds.
fn basic<'d, 'i>(node: Node<'d, 'i>) -> Option<(Node<'d, 'i>, u16)> {
    node.children().find_map(|it| {
        let (_, code) = TYPES.iter().find(|(name, _)| is(&it, name))?;
        Some((it, *code))
    })
}

/// Whether an editor built the device without the parameter.
fn is_disabled(parameter: Node<'_, '_>) -> bool {
    let property =
        |it: &Node<'_, '_>| is(it, "property") && it.attribute("name") == Some("CO_disabled");
    let mut values = parameter.children().filter(property).filter_map(|it| it.attribute("value"));
    values.any(|value| truth(value.trim()) == "1")
}

/// IEC 61131-3 has no DOMAIN. Editors write `BITSTRING` for it, and for an octet string the same
/// with its bytes as the default value.
fn bits_are_domain(keys: &mut [Line]) {
    let of_type = |data_type: DataType| format!("0x{:04X}", data_type.0);
    let bits = of_type(DataType::OCTET_STRING);
    if let Some(line) = keys.iter_mut().find(|it| it.name == "DataType" && it.value == bits) {
        line.value = of_type(DataType::DOMAIN);
    }
}

/// Hexadecimal digits, with or without `0x` before them.
pub(super) fn hex(text: &str) -> Option<u32> {
    let text = text.trim();
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).unwrap_or(text);
    let all = digits.bytes().all(|it| it.is_ascii_hexdigit());
    all.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

/// CiA 311 writes types and flags in hexadecimal digits alone.
fn of_digits(text: &str) -> String {
    hex(text).map_or_else(|| text.to_owned(), |number| format!("0x{number:04X}"))
}

/// `PDOmapping` is told by [`Scribe::mapping`].
pub(super) const ATTRIBUTES: &[Told] = &[
    ("name", "ParameterName", as_is),
    ("objectType", "ObjectType", decimal),
    ("dataType", "DataType", of_digits),
    ("lowLimit", "LowLimit", as_is),
    ("highLimit", "HighLimit", as_is),
    ("accessType", "AccessType", as_is),
    ("defaultValue", DEFAULT, as_is),
    ("actualValue", "ParameterValue", as_is),
    ("denotation", "Denotation", as_is),
    ("subNumber", "SubNumber", decimal),
    ("objFlags", "ObjFlags", of_digits),
];

const DEFAULT: &str = "DefaultValue";

/// Keys that describe a value.
const OF_VALUES: [&str; 6] =
    ["DataType", "LowLimit", "HighLimit", "AccessType", DEFAULT, "ParameterValue"];

const MAY_BE_EMPTY: [&str; 4] = ["LowLimit", "HighLimit", "ParameterValue", "Denotation"];

pub(super) const PARAMETER: &[Told] = &[("access", "AccessType", access)];

fn access(text: &str) -> String {
    let known = ACCESS.iter().find(|(said, _)| *said == text);
    known.map_or(text, |(_, key)| key).to_owned()
}

/// What a parameter says of the access to it, and the key in CiA 306.
const ACCESS: [(&str, &str); 6] = [
    ("const", "const"),
    ("read", "ro"),
    ("write", "wo"),
    ("readWrite", "rw"),
    ("readWriteInput", "rwr"),
    ("readWriteOutput", "rww"),
];

/// The elements of IEC 61131-3 and the codes of CiA 301. A `CHAR` is a character of one byte, which
/// CiA 301 counts as UNSIGNED8 in a string (7.1.6); the editor of CANopenNode takes INTEGER8.
const TYPES: [(&str, u16); 19] = [
    ("BOOL", 0x01),
    ("CHAR", 0x05),
    ("SINT", 0x02),
    ("INT", 0x03),
    ("DINT", 0x04),
    ("LINT", 0x15),
    ("USINT", 0x05),
    ("UINT", 0x06),
    ("UDINT", 0x07),
    ("ULINT", 0x1B),
    ("BYTE", 0x05),
    ("WORD", 0x06),
    ("DWORD", 0x07),
    ("LWORD", 0x1B),
    ("REAL", 0x08),
    ("LREAL", 0x11),
    ("STRING", 0x09),
    ("BITSTRING", 0x0A),
    ("WSTRING", 0x0B),
];
