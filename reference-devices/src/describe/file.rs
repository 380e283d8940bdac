//! The form of `device.yaml`.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use canopen::catalogue::{ObjectFacts, keyed, no_index};
use canopen::eds::{DeviceInfo, FileInfo};
use canopen::source::{At, Complaint, Source};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::node::{EmcyFacts, NodeFacts};

/// A `device.yaml`: what a device chose; the catalogue supplies what its profiles say already.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct DeviceFile {
    /// Name, by which `sim:` and file names refer to the device: small letters, digits, `-`.
    pub(super) device: At<String>,
    /// What a person calls it.
    pub(super) title: At<String>,
    /// Key of the document that its clauses are of.
    pub(super) document: String,
    /// Date of the data sheet, month-day-year: `01-31-2026`.
    pub(super) date: At<String>,
    /// The manufacturer.
    pub(super) vendor: Vendor,
    /// The product, as the head of the data sheet and 1018h identify it.
    pub(super) product: Product,
    /// Revision number of 1018h, sub-index 3.
    pub(super) revision: u32,
    /// Serial number of 1018h, sub-index 4.
    pub(super) serial: u32,
    /// Profiles of the catalogue that it follows; the first one that has an index describes it.
    pub(super) profiles: Vec<At<String>>,
    /// The module that says what it does: `inert`, `cia401`, or that of a device in the program.
    pub(super) behaviour: At<String>,
    /// Options of its profiles that it does not have.
    #[serde(default)]
    pub(super) without: Vec<At<String>>,
    /// What its bench shows and its documents leave open, each with the interpretation that says
    /// so: `harness fuzz` does not judge it.
    #[serde(default)]
    pub(super) not_judged: BTreeMap<String, At<String>>,
    /// Bit rates it can be set to, in kbit/s.
    pub(super) bit_rates: Vec<At<u32>>,
    /// Node id unless another one is given.
    pub(super) default_node: At<u8>,
    /// Bits in which PDO mapping counts, 8 for whole bytes.
    pub(super) granularity: u8,
    /// Whether it has layer setting services. Unless given, it has none.
    #[serde(default)]
    pub(super) lss: bool,
    /// Data types that it takes as dummy entries of an RPDO mapping, by number. Unless given, it
    /// takes none.
    #[serde(default)]
    pub(super) dummy: Vec<u16>,
    /// What the stack has to know and a data sheet cannot say.
    #[serde(default)]
    pub(super) node: NodeFacts,
    /// The emergency messages it sends for errors of communication; those of CiA 301 when absent.
    #[serde(default)]
    pub(super) emcy: Option<EmcyFacts>,
    /// The variants of which each is a device, where this file only says what they share; the first
    /// is meant where the family is named.
    #[serde(default)]
    pub(super) models: Vec<At<String>>,
    /// Its objects.
    pub(super) objects: Objects,
}

/// The manufacturer of a device.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Vendor {
    /// Name, for the data sheet.
    name: At<String>,
    /// Vendor-ID of 1018h, sub-index 1.
    pub(super) number: u32,
}

/// What the product is called.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Product {
    /// Name, for the data sheet.
    pub(super) name: At<String>,
    /// Product code of 1018h, sub-index 2.
    pub(super) number: u32,
    /// Order code, for the data sheet.
    pub(super) order_code: At<String>,
}

/// Objects by their keys, each of which means one index or several.
#[derive(Default)]
pub(super) struct Objects(Vec<(At<String>, ObjectFacts)>);

/// Objects, each with the place of the key that means it.
pub(super) type ByIndex = BTreeMap<u16, At<ObjectFacts>>;

impl DeviceFile {
    /// The texts that stand on a line of the data sheet each.
    pub(super) fn texts(&self) -> [&At<String>; 4] {
        [&self.title, &self.vendor.name, &self.product.name, &self.product.order_code]
    }

    pub(super) fn file_info(&self) -> FileInfo {
        FileInfo {
            name: format!("{}.eds", self.device.value),
            version: 1,
            revision: 0,
            eds_version: "4.0".into(),
            description: self.title.value.clone(),
            creation_time: MIDNIGHT.into(),
            creation_date: self.date.value.clone(),
            created_by: "harness".into(),
            modification_time: MIDNIGHT.into(),
            modification_date: self.date.value.clone(),
            modified_by: "harness".into(),
        }
    }

    pub(super) fn device_info(&self) -> DeviceInfo {
        DeviceInfo {
            vendor_name: self.vendor.name.value.clone(),
            vendor_number: self.vendor.number,
            product_name: self.product.name.value.clone(),
            product_number: self.product.number,
            revision_number: self.revision,
            order_code: self.product.order_code.value.clone(),
            bit_rates: self.bit_rates.iter().map(|rate| rate.value).collect(),
            boot_up_master: false,
            boot_up_slave: true,
            granularity: self.granularity,
            group_messaging: false,
            rpdo_count: 0,
            tpdo_count: 0,
            lss: self.lss,
        }
    }
}

impl Objects {
    /// The objects by index.
    ///
    /// # Errors
    /// When a key is not an index, or two mean the same.
    pub(super) fn by_index(self, source: &Arc<Source>) -> Result<ByIndex, Vec<Complaint>> {
        let (mut objects, mut complaints) = (BTreeMap::new(), Vec::new());
        for (key, object) in self.0 {
            let Some(keyed) = keyed(&key.value, object) else {
                complaints.push(Complaint::at(source, key.place, no_index(&key.value)));
                continue;
            };
            for (index, object) in keyed
                .into_iter()
                .flat_map(|(indices, object)| indices.map(move |index| (index, object.clone())))
            {
                if objects.insert(index, At::new(object, key.place)).is_some() {
                    let message = format!("{index:04X} is described twice");
                    complaints.push(Complaint::at(source, key.place, message));
                    break;
                }
            }
        }
        if complaints.is_empty() { Ok(objects) } else { Err(complaints) }
    }
}

impl<'de> Deserialize<'de> for Objects {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ObjectsVisitor)
    }
}

impl JsonSchema for Objects {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Objects".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        BTreeMap::<String, ObjectFacts>::json_schema(generator)
    }
}

struct ObjectsVisitor;

impl<'de> Visitor<'de> for ObjectsVisitor {
    type Value = Objects;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("objects by index")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Objects, A::Error> {
        let mut objects = Vec::new();
        while let Some(entry) = map.next_entry()? {
            objects.push(entry);
        }
        Ok(Objects(objects))
    }
}

const MIDNIGHT: &str = "12:00AM";
