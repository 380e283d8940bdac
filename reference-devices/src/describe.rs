//! A device from its data: `device.yaml` says what the device chose, the catalogue what its
//! profiles already say, and both together are the electronic data sheet.

mod check;
mod markdown;
mod merge;
mod node;

use std::collections::BTreeMap;
use std::fmt;

use canopen::Mux;
use canopen::catalogue::{self, Mapping, ObjectFacts, Scalar};
use canopen::eds::{DeviceInfo, Eds, FileInfo};
use serde::Deserialize;

use crate::settings::NodeSettings;

use node::{EmcyFacts, NodeFacts};

/// A device as its data describes it.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name, which is the name of its folder.
    pub device: String,
    /// What a person calls it.
    pub title: String,
    /// Key of the document that its clauses are of.
    pub document: String,
    /// Profiles it follows, CiA 301 first.
    pub profiles: Vec<String>,
    /// The module that says what it does.
    pub behaviour: String,
    /// Options of its profile that it lacks, by their names in the catalogue.
    pub without: Vec<String>,
    /// Node id when nothing else is said.
    pub default_node: u8,
    /// The data sheet.
    pub eds: Eds,
    /// What the stack has to know beyond it.
    pub settings: NodeSettings,
    /// What the data sheet has no place for, by value.
    pub notes: BTreeMap<Mux, Note>,
    /// The same for arrays and records as a whole.
    pub heads: BTreeMap<u16, Note>,
}

/// What a data sheet has no place for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Note {
    /// PDOs the value may be mapped into.
    pub pdo: Option<Mapping>,
    /// Unit of the physical value.
    pub unit: Option<String>,
    /// Physical value of a raw 1, in `unit`.
    pub scale: Option<f64>,
    /// What it means.
    pub doc: Option<String>,
    /// Clause of the document.
    pub clause: Option<String>,
}

/// The data of a device do not load, or do not make a device.
#[derive(Debug)]
pub struct DescribeError(String);

/// The names of the devices that are part of the program.
pub fn names() -> impl Iterator<Item = &'static str> {
    DEVICES.iter().map(|(name, _)| *name)
}

/// The device of that name; `None` when there is none.
///
/// # Panics
/// When its data do not load: they are part of the program.
pub fn device(name: &str) -> Option<Description> {
    let (_, yaml) = DEVICES.iter().find(|(device, _)| *device == name)?;
    Some(Description::read(yaml).unwrap_or_else(|error| panic!("{name}/device.yaml: {error}")))
}

impl Description {
    /// Reads a `device.yaml` and merges it with the catalogue.
    ///
    /// # Errors
    /// With line and column, when the text is not of the form; with the address, when an object
    /// is not fully described, a value is not of its type or outside its limits, or the default
    /// mapping of a PDO is not legal.
    pub fn read(yaml: &str) -> Result<Self, DescribeError> {
        let file: DeviceFile =
            serde_yaml::from_str(yaml).map_err(|error| DescribeError(error.to_string()))?;
        let mut described = Self {
            eds: Eds {
                file: file.file_info(),
                device: file.device_info(),
                dummies: file.dummy.clone(),
                comments: vec![generated_by(&file.device), file.title.clone()],
                ..Eds::default()
            },
            settings: node::settings(&file.node, file.emcy.as_ref())?,
            device: file.device,
            title: file.title,
            document: file.document,
            profiles: file.profiles,
            behaviour: file.behaviour,
            without: file.without,
            default_node: file.default_node,
            notes: BTreeMap::new(),
            heads: BTreeMap::new(),
        };
        let identity = [file.vendor.number, file.product.number, file.revision, file.serial];
        let mut objects = Vec::new();
        for (key, chosen) in file.objects {
            let keyed = catalogue::keyed(&key, chosen)
                .ok_or_else(|| DescribeError(format!("{key:?} is no index such as 1017")))?;
            let each = |(indices, chosen): (_, ObjectFacts)| {
                Iterator::zip(indices, std::iter::repeat(chosen))
            };
            objects.extend(keyed.into_iter().flat_map(each));
        }
        objects.sort_by_key(|(index, _)| *index);
        for (index, mut chosen) in objects {
            if index == IDENTITY {
                identify(&mut chosen, identity);
            }
            merge::object(&mut described, index, &chosen)?;
        }
        described.count_pdos();
        check::values(&described.eds)?;
        check::mappings(&described.eds)?;
        Ok(described)
    }

    /// The object dictionary as tables for people, in Markdown.
    pub fn markdown(&self) -> String {
        markdown::write(self)
    }

    /// What generated files say of their origin.
    pub fn generated_by(&self) -> String {
        generated_by(&self.device)
    }

    fn count_pdos(&mut self) {
        let count = |first: u16, last: u16| {
            let within = |object: &&canopen::eds::Object| (first..=last).contains(&object.index);
            self.eds.objects.iter().filter(within).count() as u16
        };
        let (rpdos, tpdos) = (count(0x1400, 0x15FF), count(0x1800, 0x19FF));
        self.eds.device.rpdo_count = rpdos;
        self.eds.device.tpdo_count = tpdos;
    }
}

impl fmt::Display for DescribeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DescribeError {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct DeviceFile {
    device: String,
    title: String,
    document: String,
    /// Of the data sheet, month-day-year.
    date: String,
    vendor: Vendor,
    product: Product,
    revision: u32,
    serial: u32,
    profiles: Vec<String>,
    behaviour: String,
    #[serde(default)]
    without: Vec<String>,
    /// In kbit/s.
    bit_rates: Vec<u32>,
    default_node: u8,
    granularity: u8,
    lss: bool,
    dummy: Vec<u16>,
    #[serde(default)]
    node: NodeFacts,
    #[serde(default)]
    emcy: Option<EmcyFacts>,
    objects: BTreeMap<String, ObjectFacts>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vendor {
    name: String,
    number: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Product {
    name: String,
    number: u32,
    order_code: String,
}

impl DeviceFile {
    fn file_info(&self) -> FileInfo {
        FileInfo {
            name: format!("{}.eds", self.device),
            version: 1,
            revision: 0,
            eds_version: "4.0".into(),
            description: self.title.clone(),
            creation_time: MIDNIGHT.into(),
            creation_date: self.date.clone(),
            created_by: "harness".into(),
            modification_time: MIDNIGHT.into(),
            modification_date: self.date.clone(),
            modified_by: "harness".into(),
        }
    }

    fn device_info(&self) -> DeviceInfo {
        DeviceInfo {
            vendor_name: self.vendor.name.clone(),
            vendor_number: self.vendor.number,
            product_name: self.product.name.clone(),
            product_number: self.product.number,
            revision_number: self.revision,
            order_code: self.product.order_code.clone(),
            bit_rates: self.bit_rates.clone(),
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

/// Gives 1018h the numbers from the head of the file where the object has no others.
fn identify(object: &mut ObjectFacts, numbers: [u32; 4]) {
    for (sub, number) in (1..).zip(numbers) {
        if object.count.is_some_and(|count| sub <= count) {
            object.subs.entry(sub).or_default();
        }
        if let Some(facts) = object.subs.get_mut(&sub) {
            facts.value.get_or_insert_with(|| Scalar::Int(number.into()));
        }
    }
}

fn generated_by(device: &str) -> String {
    format!("generated by `harness eds write {device}`")
}

const DEVICES: &[(&str, &str)] = &[
    ("drr460", include_str!("../drr460/device.yaml")),
    ("em66", include_str!("../em66/device.yaml")),
    ("generic", include_str!("../generic/device.yaml")),
];
const IDENTITY: u16 = 0x1018;
const MIDNIGHT: &str = "12:00AM";

#[cfg(test)]
mod tests {
    use canopen::eds::{Access, ObjectKind};
    use canopen::{DataType, Dictionary, Value};

    use super::*;

    #[test]
    fn every_device_loads_and_makes_a_dictionary() {
        for name in names() {
            let described = device(name).unwrap();
            assert_eq!(described.device, name);
            Dictionary::new(&described.eds, described.default_node).unwrap();
        }
    }

    #[test]
    fn drr460_is_what_its_manual_says() {
        let eds = device("drr460").unwrap().eds;
        let parameters = eds.object(0x3000).unwrap();
        assert_eq!(parameters.kind, ObjectKind::ARRAY);
        assert_eq!(parameters.entries.len(), 1 + 143);
        assert_eq!((eds.device.rpdo_count, eds.device.tpdo_count), (2, 4));
        let table = [
            (0x1000, 0, Access::Const, DataType::UNSIGNED32, Value::Int(0x000E_0191)),
            (0x1003, 0, Access::Rw, DataType::UNSIGNED8, Value::Int(0)),
            (0x1018, 0, Access::Ro, DataType::UNSIGNED8, Value::Int(4)),
            (0x1018, 2, Access::Ro, DataType::UNSIGNED32, Value::Int(260)),
            (0x1801, 1, Access::Rw, DataType::UNSIGNED32, Value::Int(0x285)),
            (0x1801, 0, Access::Ro, DataType::UNSIGNED8, Value::Int(5)),
            (0x1A00, 0, Access::Rw, DataType::UNSIGNED8, Value::Int(2)),
            (0x3000, 0, Access::Ro, DataType::UNSIGNED8, Value::Int(143)),
            (0x3000, 111, Access::Rw, DataType::INTEGER16, Value::Int(247)),
            (0x6200, 1, Access::Rww, DataType::UNSIGNED8, Value::Int(0)),
            (0x6424, 5, Access::Rw, DataType::INTEGER16, Value::Int(0)),
        ];
        for (index, sub, access, data_type, value) in table {
            let entry = eds.entry(Mux::new(index, sub)).unwrap();
            assert_eq!((entry.access, entry.data_type), (access, data_type), "{}", entry.mux);
            assert_eq!(entry.default.as_ref().map(|term| term.resolve(5)), Some(value));
        }
        assert_eq!(eds.entry(Mux::new(0x1801, 4)), None);
    }

    #[test]
    fn mistakes_are_told_with_their_address() {
        let table = [
            ("\"400\": {}", "\"400\" is no index"),
            ("\"5000\": {}", "5000: neither the device nor a profile gives its object code"),
            ("\"5000\": { object: var, type: integer8 }", "5000:00 has no name"),
            ("\"1003\": {}", "1003: neither count nor subs"),
            ("\"1003\": { count: 1, subs: { 2: {} } }", "1003:02 is beyond count 1"),
            ("\"1017\": { value: 70000 }", "1017:00: 70000 is no value of type unsigned16"),
            ("\"1017\": { value: 9, low: 10 }", "1017:00: default 9 lies below 10"),
            ("\"1017\": { access: ro, pdo: rpdo }", "1017:00 is ro and cannot be mapped: rpdo"),
            ("\"1600\": { count: 1, subs: { 1: { value: 0x10170010 } } }", "1600:01 maps 1017:00"),
        ];
        for (objects, message) in table {
            let error = read_with(objects).unwrap_err().to_string();
            assert!(error.contains(message), "{error:?} does not contain {message:?}");
        }
    }

    fn read_with(objects: &str) -> Result<Description, DescribeError> {
        let head = "device: x\ntitle: X\ndocument: x\ndate: 01-01-2026\n\
            vendor: { name: V, number: 1 }\nproduct: { name: P, number: 2, order-code: O }\n\
            revision: 3\nserial: 4\nprofiles: [cia301]\nbehaviour: x\nbit-rates: [125]\n\
            default-node: 1\ngranularity: 8\nlss: false\ndummy: []\nobjects:\n";
        Description::read(&format!("{head}  {objects}\n"))
    }
}
