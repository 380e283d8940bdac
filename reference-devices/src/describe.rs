//! A device from its data: `device.yaml` says what the device chose, the catalogue what its
//! profiles already say, and both together are the electronic data sheet.

mod check;
mod file;
mod markdown;
mod merge;
mod node;

use std::collections::BTreeMap;
use std::fmt;
use std::iter;

use canopen::Mux;
use canopen::catalogue::{Mapping, ObjectFacts, Scalar};
use canopen::eds::Eds;
use serde::de::DeserializeOwned;

use crate::stack::NodeSettings;

use file::{DeviceFile, VariantFile};

/// A device as its data describes it.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name.
    pub device: String,
    /// The device it is a variant of; none when it is a device of its own.
    pub variant_of: Option<String>,
    /// What a person calls it.
    pub title: String,
    /// Key of the document that its clauses are of.
    pub document: String,
    /// Profiles it follows, CiA 301 first.
    pub profiles: Vec<String>,
    /// The module that says what it does.
    pub behaviour: String,
    /// Options of its profiles that it does not have.
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

/// The names of the devices that are part of the program, each followed by its variants.
pub fn names() -> impl Iterator<Item = &'static str> {
    DEVICES.iter().flat_map(Data::names)
}

/// The device of that name and its variants; nothing when it is none or is itself a variant.
pub fn with_variants(name: &str) -> impl Iterator<Item = &'static str> {
    DEVICES.iter().filter(move |device| device.name == name).flat_map(Data::names)
}

/// The device or variant of that name; `None` when there is none.
///
/// # Panics
/// When its data do not load: they are part of the program.
pub fn device(name: &str) -> Option<Description> {
    DEVICES.iter().find_map(|device| {
        let described = match device.variants.iter().find(|(variant, _)| *variant == name) {
            Some((_, yaml)) => Description::read_variant(name, yaml, device.yaml),
            None if device.name == name => Description::read(device.yaml),
            None => return None,
        };
        Some(described.unwrap_or_else(|error| panic!("data of {name}: {error}")))
    })
}

impl Description {
    /// Reads a `device.yaml` and merges it with the catalogue.
    ///
    /// # Errors
    /// With line and column, when the text is not of the form; with the address, when an object
    /// is not fully described, a value is not of its type or outside its limits, or the default
    /// mapping of a PDO is not legal.
    pub fn read(yaml: &str) -> Result<Self, DescribeError> {
        Self::of_file(parse(yaml)?, None)
    }

    /// Reads what a variant called `name` has otherwise than the device of this `device.yaml`.
    ///
    /// # Errors
    /// As [`read`](Self::read), and when the variant leaves out what is not there.
    fn read_variant(name: &str, yaml: &str, device: &str) -> Result<Self, DescribeError> {
        let (variant, device): (VariantFile, DeviceFile) = (parse(yaml)?, parse(device)?);
        let base = device.device.clone();
        Self::of_file(variant.apply(name, device)?, Some(base))
    }

    fn of_file(file: DeviceFile, variant_of: Option<String>) -> Result<Self, DescribeError> {
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
            variant_of,
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
        for (index, mut chosen) in file.objects {
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

    /// The folder of its data and the name of its generated files there, without their ending.
    pub fn place(&self) -> (String, String) {
        match &self.variant_of {
            None => (self.device.clone(), "device".to_owned()),
            Some(base) => {
                let own = self.device.strip_prefix(&format!("{base}-")).unwrap_or(&self.device);
                (format!("{base}/variants"), own.to_owned())
            }
        }
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

fn parse<T: DeserializeOwned>(yaml: &str) -> Result<T, DescribeError> {
    serde_yaml::from_str(yaml).map_err(|error| DescribeError(error.to_string()))
}

fn generated_by(device: &str) -> String {
    format!("generated by `harness eds write {device}`")
}

/// A device and its variants, by name, as they are written.
struct Data {
    name: &'static str,
    yaml: &'static str,
    variants: &'static [(&'static str, &'static str)],
}

impl Data {
    fn names(&self) -> impl Iterator<Item = &'static str> {
        iter::once(self.name).chain(self.variants.iter().map(|(name, _)| *name))
    }
}

const EM66_VARIANTS: &[(&str, &str)] = &[
    ("em66-no-external-sensor", include_str!("../em66/variants/no-external-sensor.yaml")),
    ("em66-no-suction", include_str!("../em66/variants/no-suction.yaml")),
    ("em66-no-evacuation", include_str!("../em66/variants/no-evacuation.yaml")),
    ("em66-no-cool-down", include_str!("../em66/variants/no-cool-down.yaml")),
    ("em66-minimum", include_str!("../em66/variants/minimum.yaml")),
];

const DEVICES: &[Data] = &[
    Data { name: "drr460", yaml: include_str!("../drr460/device.yaml"), variants: &[] },
    Data { name: "em66", yaml: include_str!("../em66/device.yaml"), variants: EM66_VARIANTS },
    Data { name: "generic", yaml: include_str!("../generic/device.yaml"), variants: &[] },
];
const IDENTITY: u16 = 0x1018;

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

    #[test]
    fn a_variant_is_its_device_but_for_what_it_says() {
        let device = with("\"1016\": { count: 1, value: 0 }\n  \"1017\": { value: 7, high: 9 }");
        let read = |rest: &str| {
            let head = "title: Y\nproduct: { name: Q, number: 5, order-code: R }\n";
            Description::read_variant("x-small", &format!("{head}{rest}"), &device)
        };
        let small = read(
            "without: [suction]\nleave-out: [\"1010..1016\"]\n\
            objects: { \"1017\": { value: 8 }, \"1005\": { value: 128 } }",
        )
        .unwrap();
        assert_eq!(small.place(), ("x/variants".to_owned(), "small".to_owned()));
        assert_eq!((small.title.as_str(), small.eds.device.product_number), ("Y", 5));
        assert_eq!((small.without, small.variant_of), (vec!["suction".into()], Some("x".into())));
        let indices: Vec<u16> = small.eds.objects.iter().map(|object| object.index).collect();
        assert_eq!(indices, [0x1005, 0x1017]);
        let period = small.eds.entry(Mux::new(0x1017, 0)).unwrap();
        let [value, high] = [&period.default, &period.high];
        assert_eq!(value.as_ref().map(|term| term.resolve(1)), Some(Value::Int(8)));
        assert_eq!(high.as_ref().map(|term| term.resolve(1)), Some(Value::Int(9)));
        let wrong = read("leave-out: [\"3000\"]").unwrap_err().to_string();
        assert!(wrong.contains("3000 is left out and was never there"), "{wrong}");
    }

    fn read_with(objects: &str) -> Result<Description, DescribeError> {
        Description::read(&with(objects))
    }

    /// A `device.yaml` with these objects.
    fn with(objects: &str) -> String {
        let head = "device: x\ntitle: X\ndocument: x\ndate: 01-01-2026\n\
            vendor: { name: V, number: 1 }\nproduct: { name: P, number: 2, order-code: O }\n\
            revision: 3\nserial: 4\nprofiles: [cia301]\nbehaviour: x\nbit-rates: [125]\n\
            default-node: 1\ngranularity: 8\nlss: false\ndummy: []\nobjects:\n";
        format!("{head}  {objects}\n")
    }
}
