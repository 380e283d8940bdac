//! An object or a sub-object of CiA 311 as the keys of a section. What its own attributes leave
//! out, the parameter says that it refers to (`uniqueIDRef`).

use std::collections::{HashMap, HashSet};

use roxmltree::Node;

use super::{Line, Scribe, Told, as_is, decimal, is, truth};
use crate::value::DataType;

/// What a parameter says about the objects that refer to it.
pub(super) struct Parameter {
    keys: Vec<Line>,
    pub(super) is_disabled: bool,
}

/// The data types that parameters refer to, by name: the element and the code of the basic type.
type Types<'d, 'i> = HashMap<&'d str, Option<(Node<'d, 'i>, u16)>>;

impl<'d, 'i> Scribe<'d, 'i, '_> {
    /// Reads what objects refer to.
    pub(super) fn read_parameters(&mut self) {
        let is_entry = |it: &Node<'_, '_>| is(it, "CANopenObject") || is(it, "CANopenSubObject");
        let entries = self.root.descendants().filter(is_entry);
        let ids: HashSet<&str> = entries.filter_map(|it| it.attribute("uniqueIDRef")).collect();
        let mut types = Types::new();
        for id in ids {
            if let Some(node) = self.referred.get(id).copied() {
                let keys = self.parameter(node, &mut types);
                self.parameters.insert(id, Parameter { keys, is_disabled: is_disabled(node) });
            }
        }
    }

    /// What an object refers to.
    pub(super) fn parameter_of(&self, node: Node<'d, 'i>) -> Option<&Parameter> {
        self.parameters.get(node.attribute("uniqueIDRef")?)
    }

    pub(super) fn entry(&self, node: Node<'d, 'i>) -> Vec<Line> {
        let mut keys = self.attributes(node, ATTRIBUTES);
        // The parameter of an array or a record describes the whole of it, which is no value.
        let is_value = !node.children().any(|it| is(&it, "CANopenSubObject"));
        if let Some(parameter) = self.parameter_of(node).filter(|_| is_value) {
            let is_new = |line: &&Line| !keys.iter().any(|it| it.name == line.name);
            let mut new: Vec<Line> = parameter.keys.iter().filter(is_new).cloned().collect();
            let has_default = keys.iter().chain(&new).any(|it| it.name == "DefaultValue");
            if !has_default {
                bits_are_domain(&mut new);
            }
            keys.extend(new);
        }
        self.mapping(node, &mut keys);
        keys
    }

    /// A key says whether an object can be mapped; the access type has the direction.
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
            && line.value == "rw"
        {
            line.value = access.to_owned();
        }
        keys.push(self.line("PDOMapping", attribute, mapped));
    }

    fn parameter(&self, node: Node<'d, 'i>, types: &mut Types<'d, 'i>) -> Vec<Line> {
        let mut keys = self.attributes(node, PARAMETER);
        // The attribute is `read` where it is absent, as editors leave it.
        if node.attribute("access").is_none() {
            keys.push(Line::at("AccessType", "ro", self.place(node)));
        }
        // Limits are one range: what is allowed in several ranges has none.
        let several = node.descendants().filter(|it| is(it, "range")).count() > 1;
        let below = |name| node.descendants().find(|it| is(it, name));
        for (element, key) in [
            ("defaultValue", "DefaultValue"),
            ("actualValue", "ParameterValue"),
            ("minValue", "LowLimit"),
            ("maxValue", "HighLimit"),
        ] {
            let value = below(element).and_then(|it| it.attribute_node("value"));
            let is_told = !(several && key.ends_with("Limit"));
            keys.extend(value.filter(|_| is_told).map(|it| self.line(key, it, it.value())));
        }
        if let Some((at, data_type)) = self.data_type(node, types) {
            keys.push(Line::at("DataType", &format!("0x{data_type:04X}"), self.place(at)));
        }
        keys
    }

    /// The basic type of a parameter, also behind the name of a derived one.
    fn data_type(
        &self,
        node: Node<'d, 'i>,
        types: &mut Types<'d, 'i>,
    ) -> Option<(Node<'d, 'i>, u16)> {
        let named = || {
            let reference = node.children().find(|it| is(it, "dataTypeIDRef"))?;
            let name = reference.attribute("uniqueIDRef")?;
            let derived = || self.referred.get(name).copied().and_then(basic);
            *types.entry(name).or_insert_with(derived)
        };
        basic(node).or_else(named)
    }
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
const ATTRIBUTES: &[Told] = &[
    ("name", "ParameterName", as_is),
    ("objectType", "ObjectType", decimal),
    ("dataType", "DataType", of_digits),
    ("lowLimit", "LowLimit", as_is),
    ("highLimit", "HighLimit", as_is),
    ("accessType", "AccessType", as_is),
    ("defaultValue", "DefaultValue", as_is),
    ("actualValue", "ParameterValue", as_is),
    ("denotation", "Denotation", as_is),
    ("subNumber", "SubNumber", decimal),
    ("objFlags", "ObjFlags", of_digits),
];

const PARAMETER: &[Told] = &[("access", "AccessType", access)];

fn access(text: &str) -> String {
    match text {
        "read" => "ro",
        "write" => "wo",
        "readWrite" => "rw",
        "readWriteInput" => "rwr",
        "readWriteOutput" => "rww",
        other => other,
    }
    .to_owned()
}

/// The elements of IEC 61131-3 and the codes of CiA 301.
const TYPES: [(&str, u16); 18] = [
    ("BOOL", 0x01),
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
