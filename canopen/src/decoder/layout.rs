//! The process data objects of a device and the types of its objects by its data sheet.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::eds::{Eds, Entry};
use crate::mux::Mux;
use crate::value::{DataType, Value};

/// The parameters of the process data objects of a device, and the types of its objects.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PdoLayout {
    /// The default of each entry of a communication or mapping parameter.
    pub parameters: BTreeMap<Mux, Parameter>,
    /// The types of the objects; those without a name are left out.
    pub types: BTreeMap<Mux, DataType>,
}

/// The default of an entry of a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// The value, or what is added to the node id.
    pub value: u32,
    /// Whether the node id is added.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub plus_node: bool,
}

impl PdoLayout {
    /// The layout in a data sheet.
    pub fn of(eds: &Eds) -> Self {
        let parameters = eds.entries().filter(|entry| is_parameter(entry.mux));
        let typed = eds.entries().filter(|entry| entry.data_type.name().is_some());
        Self {
            parameters: parameters
                .filter_map(|entry| Some((entry.mux, parameter(entry)?)))
                .collect(),
            types: typed.map(|entry| (entry.mux, entry.data_type)).collect(),
        }
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.parameters.is_empty() && self.types.is_empty()
    }
}

impl Parameter {
    /// The value for a node id.
    pub fn resolve(self, node: u8) -> u32 {
        self.value.wrapping_add(if self.plus_node { node.into() } else { 0 })
    }
}

/// A value that a parameter can have; none where the sheet has a text or too large a number.
fn parameter(entry: &Entry) -> Option<Parameter> {
    entry.data_type.size().filter(|size| *size <= 4)?;
    let Some(default) = &entry.default else { return Some(Parameter::default()) };
    let Value::Int(value) = default.value else { return None };
    Some(Parameter { value: value.try_into().ok()?, plus_node: default.plus_node })
}

/// Communication and mapping parameters.
pub(super) const fn is_parameter(mux: Mux) -> bool {
    matches!(mux.index, 0x1400..=0x1BFF)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eds;

    #[test]
    fn a_layout_in_a_journal_is_that_of_the_data_sheet() {
        let sheet = "\
            [1800sub1]\nParameterName=COB-ID\nDataType=0x7\nAccessType=rw\n\
            DefaultValue=$NODEID+0x180\n\
            [2000]\nParameterName=Value\nDataType=0x3\nAccessType=ro\nPDOMapping=1\n\
            [2001]\nParameterName=Other\nDataType=0x3\nAccessType=ro\n";
        let sheet = format!(
            "[MandatoryObjects]\nSupportedObjects=0\n[OptionalObjects]\nSupportedObjects=1\n\
             1=0x1800\n[ManufacturerObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n\
             [1800]\nParameterName=TPDO\nObjectType=0x9\nSubNumber=1\n{sheet}"
        );
        let layout = PdoLayout::of(&eds::read(sheet.as_bytes()).eds);
        let cob_id = layout.parameters[&Mux::new(0x1800, 1)];
        assert_eq!((cob_id.value, cob_id.resolve(5)), (0x180, 0x185));
        assert_eq!(layout.types.get(&Mux::new(0x2001, 0)), Some(&DataType::INTEGER16));
        let text = serde_json::to_string(&layout).unwrap();
        assert_eq!(serde_json::from_str::<PdoLayout>(&text).unwrap(), layout, "{text}");
    }
}
