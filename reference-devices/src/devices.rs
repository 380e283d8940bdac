//! The reference devices, each put together from its data, its behaviour and the stack.
//!
//! A device has a folder of data and a module for its application. What devices of a profile share
//! belongs to [`profiles`](crate::profiles), and what all share to [`stack`](crate::stack).

mod applications;
pub mod ax021211;
pub mod drr460;
pub mod em66;
mod generic;
pub mod mcm260x;
mod pixsys;
mod terminal;

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, OnceLock};

use canopen::catalogue::Catalogue;
use canopen::eds::Eds;
use canopen::nearest::did_you_mean;
use canopen::source::{At, Complaint, Source, built_in, read_yaml};
use canopen::{Dictionary, Mux, ValueError};
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::describe::{Description, Family, Known, VariantFiles};
use crate::rules::Rules;
use crate::stack::{Behaviour, Node, NodeSettings};

use crate::decisions::{Otherwise, Set};
use applications::Application;
pub(crate) use applications::INERT;

/// A device that can be built.
#[derive(Clone, Debug)]
pub struct ReferenceDevice {
    /// Its data.
    pub description: Description,
    /// The file that describes it: that of the variant, or `device.yaml`.
    pub source: Arc<Source>,
    /// All files of it and its relatives.
    pub files: Arc<DeviceFiles>,
    /// The relative on which deviations are proved that name none: the device, or the first model
    /// of a family that is none itself.
    pub first: String,
    prototype: Prototype,
}

/// The dictionary of a new device, made on first use. Each copy makes its own, so that a copied and
/// changed device gets a dictionary with the change.
#[derive(Debug, Default)]
struct Prototype(OnceLock<Dictionary>);

impl Clone for Prototype {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// The files of a device and its variants.
#[derive(Clone, Debug)]
pub struct DeviceFiles {
    /// `device.yaml`.
    pub device: Arc<Source>,
    /// The files of `variants/`, each with its name without ending.
    pub variants: Vec<(String, Arc<Source>)>,
    /// The files of `parts/`, likewise.
    pub parts: Vec<(String, Arc<Source>)>,
    /// `mutants.yaml`, where there is one.
    pub mutants: Option<Arc<Source>>,
    /// `freedoms.yaml`, where there is one.
    pub freedoms: Option<Arc<Source>>,
}

/// The reference devices, each followed by its variants.
pub fn all() -> impl Iterator<Item = &'static ReferenceDevice> {
    BUILT_IN.iter().flatten()
}

/// The names of the reference devices, each followed by those of its variants.
pub fn names() -> impl Iterator<Item = &'static str> {
    all().map(|device| device.description.device.as_str())
}

/// The device of that name and its variants; nothing when it is none or is itself a variant.
pub fn with_variants(name: &str) -> impl Iterator<Item = &'static str> {
    let family = family(name).into_iter().flatten();
    family.map(|device| device.description.device.as_str())
}

/// The device of that name, or the first model of the family of that name; `None` when there is
/// none.
///
/// # Panics
/// When the data of the devices do not load: they are part of the program.
pub fn device(name: &str) -> Option<ReferenceDevice> {
    let device = all().find(|device| device.description.device == name);
    device.or_else(|| family(name)?.first()).cloned()
}

/// The families of the reference devices of that vendor and product. Where several makes of device
/// bear one product code, those that also have the device type, 1000h.
pub fn families_of(
    vendor: u32,
    product: u32,
    device_type: Option<u32>,
) -> Vec<&'static [ReferenceDevice]> {
    let same = |device: &ReferenceDevice| {
        let info = &device.description.eds.device;
        (info.vendor_number, info.product_number) == (vendor, product)
    };
    let typed = |device: &ReferenceDevice| device.device_type() == device_type;
    let mut found: Vec<_> = BUILT_IN.iter().map(Vec::as_slice).collect();
    found.retain(|family| family.iter().any(same));
    if found.len() > 1 && found.iter().any(|family| family.iter().any(typed)) {
        found.retain(|family| family.iter().any(typed));
    }
    found
}

fn family(name: &str) -> Option<&'static Vec<ReferenceDevice>> {
    BUILT_IN.iter().find(|family| family[0].family() == name)
}

impl DeviceFiles {
    /// The device and its variants, in this order; of a family that is no device, its models.
    ///
    /// # Errors
    /// Everything that is wrong with the description of the device or of a variant.
    pub fn family(self, catalogue: &Catalogue) -> Result<Vec<ReferenceDevice>, Vec<Complaint>> {
        let files = Arc::new(self);
        let known = Known { catalogue, behaviours: &applications::names() };
        let Family { name: family, models } = Family::read(&files.device)?;
        let (mut devices, mut complaints) = (Vec::new(), files.strangers(&models));
        let mut keep = |read: Result<Description, Vec<Complaint>>, source: &Arc<Source>| match read
        {
            Ok(description) => devices.push((description, Arc::clone(source))),
            Err(mut wrong) => {
                // A mistake of the device is a mistake of each variant.
                wrong.retain(|wrong| complaints.iter().all(|told| !wrong.is_about_place_of(told)));
                complaints.append(&mut wrong);
            }
        };
        if models.is_empty() {
            keep(Description::read(&files.device, known), &files.device);
        }
        for (variant, source) in files.in_order(&models) {
            let of = VariantFiles { variant: source, parts: &files.parts, device: &files.device };
            keep(Description::read_variant(&format!("{family}-{variant}"), of, known), source);
        }
        let Some((first, _)) = devices.first().filter(|_| complaints.is_empty()) else {
            return Err(complaints);
        };
        let first = first.device.clone();
        let device = |(description, source)| {
            let (files, first) = (Arc::clone(&files), first.clone());
            ReferenceDevice { description, source, files, first, prototype: Prototype::default() }
        };
        Ok(devices.into_iter().map(device).collect())
    }

    /// The variants, models in their order.
    fn in_order(&self, models: &[At<String>]) -> Vec<&(String, Arc<Source>)> {
        let mut variants: Vec<_> = self.variants.iter().collect();
        variants.sort_by_key(|(name, _)| models.iter().position(|model| model.value == *name));
        variants
    }

    /// The models that are no variant, and the variants that are no model although there are some.
    fn strangers(&self, models: &[At<String>]) -> Vec<Complaint> {
        let names = || self.variants.iter().map(|(name, _)| name.as_str());
        let missing = models.iter().filter(|model| names().all(|name| name != model.value));
        let mut complaints: Vec<_> = missing
            .map(|model| {
                let meant = did_you_mean(&model.value, names());
                let message = format!("there is no variant `{}`{meant}", model.value);
                Complaint::at(&self.device, model.place, message)
            })
            .collect();
        let is_model = |name: &str| models.iter().any(|model| model.value == name);
        if let Some(last) = models.last() {
            let others = names().filter(|name| !is_model(name));
            complaints.extend(others.map(|name| {
                let message = format!("the variant `{name}` is missing among the models");
                Complaint::at(&self.device, last.place, message)
            }));
        }
        complaints.extend(self.unused_parts());
        complaints
    }

    /// The parts that no variant names. Where a variant or a part cannot be read, that is told
    /// already.
    fn unused_parts(&self) -> Vec<Complaint> {
        /// What names parts.
        #[derive(Deserialize)]
        struct Parts {
            #[serde(default)]
            parts: Vec<String>,
        }
        let named = self.variants.iter().map(|(_, source)| read_yaml::<Parts>(source));
        let Ok(named) = named.collect::<Result<Vec<_>, _>>() else { return Vec::new() };
        let unused = self.parts.iter().filter(|(name, _)| {
            let mut all = named.iter().flat_map(|variant| &variant.parts);
            all.all(|used| used != name)
        });
        let complaints = unused.filter_map(|(name, source)| {
            let whole = read_yaml::<At<IgnoredAny>>(source).ok()?;
            let message = format!("no variant names the part `{name}`");
            Some(Complaint::at(source, whole.place, message))
        });
        complaints.collect()
    }
}

impl ReferenceDevice {
    /// A device with this data sheet and the stack of the reference devices, whose application does
    /// nothing.
    pub fn of_sheet(eds: impl Into<Arc<Eds>>, node: u8, settings: NodeSettings) -> Self {
        let source = built_in("a device of this data sheet", "");
        let files = DeviceFiles {
            device: Arc::clone(&source),
            variants: Vec::new(),
            parts: Vec::new(),
            mutants: None,
            freedoms: None,
        };
        let device = "model".to_owned();
        let description = Description {
            device: device.clone(),
            variant_of: None,
            title: String::new(),
            document: String::new(),
            profiles: Vec::new(),
            behaviour: INERT.to_owned(),
            without: Vec::new(),
            not_judged: BTreeMap::new(),
            names: BTreeMap::new(),
            blocks: BTreeMap::new(),
            default_node: node,
            eds: eds.into(),
            settings,
            notes: Arc::default(),
            heads: Arc::default(),
        };
        let files = Arc::new(files);
        Self { description, source, files, first: device, prototype: Prototype::default() }
    }

    /// The data sheet as a file.
    pub fn eds_text(&self) -> String {
        canopen::eds::write(&self.description.eds, &self.description.generated_by())
    }

    /// The object dictionary for people.
    pub fn markdown(&self) -> String {
        self.description.markdown()
    }

    /// The generated files, beside the file that describes the device: path and text.
    pub fn generated_files(&self) -> [(String, String); 2] {
        [("eds", self.eds_text()), ("md", self.markdown())]
            .map(|(end, text)| (self.beside(end), text))
    }

    /// The path of the file that describes the device, with another ending.
    pub fn beside(&self, end: &str) -> String {
        let path = &self.source.name;
        format!("{}.{end}", path.strip_suffix(".yaml").unwrap_or(path))
    }

    /// The value of 1000h.
    pub fn device_type(&self) -> Option<u32> {
        let entry = self.description.eds.entry(Mux::new(0x1000, 0))?;
        entry.default.as_ref()?.resolve(1).as_int()?.try_into().ok()
    }

    /// The settings of the stack beyond the data sheet.
    pub(crate) fn settings(&self) -> NodeSettings {
        self.description.settings.clone()
    }

    /// The application of the device.
    pub(crate) fn behaviour(&self) -> Box<dyn Behaviour> {
        self.deviating_behaviour(&[])
    }

    /// The same with these decisions taken otherwise.
    pub(crate) fn deviating_behaviour(&self, otherwise: &[Otherwise<'_>]) -> Box<dyn Behaviour> {
        (self.application().build)(&self.description, otherwise)
    }

    /// The decisions that [`deviating_behaviour`](Self::deviating_behaviour) knows.
    pub(crate) fn decisions(&self) -> &'static [Set] {
        self.application().decisions
    }

    fn application(&self) -> &'static Application {
        let name = &self.description.behaviour;
        applications::named(name).expect("a description with another name does not load")
    }

    /// The name of the device that it is, or is a variant of.
    pub fn family(&self) -> &str {
        self.description.variant_of.as_ref().unwrap_or(&self.description.device)
    }

    /// The names of the device and its variants, whichever of them this is.
    pub fn relatives(&self) -> impl Iterator<Item = String> {
        let family = self.family();
        let device = (self.first == family).then(|| family.to_owned());
        let variants = self.files.variants.iter().map(|(name, _)| format!("{family}-{name}"));
        device.into_iter().chain(variants).collect::<Vec<_>>().into_iter()
    }

    /// The device, switched on at time 0, with this node id and these decisions of the stack.
    ///
    /// # Panics
    /// When a default value is not of its type, which loading the description excludes.
    pub fn node(&self, node_id: u8, rules: Rules) -> Node {
        let (eds, settings) = (&self.description.eds, self.settings());
        let od = self.dictionary(node_id).unwrap_or_else(|(mux, error)| panic!("{mux}: {error}"));
        Node::new(eds, od, node_id, settings, rules, self.behaviour())
    }

    /// Its objects with this node id, every value at its default.
    ///
    /// # Errors
    /// The address of a default value that is not one of its entry's type, and why.
    pub(crate) fn dictionary(&self, node_id: u8) -> Result<Dictionary, (Mux, ValueError)> {
        let eds = &self.description.eds;
        if let Some(prototype) = self.prototype.0.get() {
            debug_assert!(prototype.entries().iter().eq(eds.entries()), "a stale prototype");
            return prototype.of_node(node_id);
        }
        let od = Dictionary::new(eds, node_id)?;
        self.prototype.0.get_or_init(|| od.clone());
        Ok(od)
    }
}

/// The device with every service. Statements about devices in general are proved on it.
pub const WITH_EVERYTHING: &str = "generic";

/// A device in this program: the folder of its data, and its files.
struct Files {
    folder: &'static str,
    device: &'static str,
    variants: &'static [(&'static str, &'static str)],
    parts: &'static [(&'static str, &'static str)],
    mutants: &'static str,
    freedoms: &'static str,
}

impl Files {
    fn sources(&self) -> DeviceFiles {
        let source = |file: &str, text: &'static str| {
            built_in(&format!("reference-devices/{}/{file}", self.folder), text)
        };
        let named = |folder: &str, (name, text): &(&str, &'static str)| {
            ((*name).to_owned(), source(&format!("{folder}/{name}.yaml"), text))
        };
        DeviceFiles {
            device: source("device.yaml", self.device),
            variants: self.variants.iter().map(|file| named("variants", file)).collect(),
            parts: self.parts.iter().map(|file| named("parts", file)).collect(),
            mutants: Some(source("mutants.yaml", self.mutants)),
            freedoms: Some(source("freedoms.yaml", self.freedoms)),
        }
    }
}

/// Each device with its variants.
type Families = Vec<Vec<ReferenceDevice>>;

static BUILT_IN: LazyLock<Families> = LazyLock::new(|| {
    of_the_program().unwrap_or_else(|complaints| {
        let texts: Vec<String> = complaints.iter().map(ToString::to_string).collect();
        panic!("{}", texts.join("\n\n"))
    })
});

/// Reads the devices in this program again, for a caller that replaced some of their files.
///
/// # Errors
/// Everything that is wrong with them.
pub fn of_the_program() -> Result<Families, Vec<Complaint>> {
    FILES.iter().map(|files| files.sources().family(Catalogue::built_in())).collect()
}

const FILES: &[Files] = &[
    Files {
        folder: "ax021211",
        device: include_str!("../ax021211/device.yaml"),
        variants: &[],
        parts: &[],
        mutants: include_str!("../ax021211/mutants.yaml"),
        freedoms: include_str!("../ax021211/freedoms.yaml"),
    },
    Files {
        folder: "drr460",
        device: include_str!("../drr460/device.yaml"),
        variants: &[],
        parts: &[],
        mutants: include_str!("../drr460/mutants.yaml"),
        freedoms: include_str!("../drr460/freedoms.yaml"),
    },
    Files {
        folder: "em66",
        device: include_str!("../em66/device.yaml"),
        variants: &[
            ("no-external-sensor", include_str!("../em66/variants/no-external-sensor.yaml")),
            ("no-suction", include_str!("../em66/variants/no-suction.yaml")),
            ("no-evacuation", include_str!("../em66/variants/no-evacuation.yaml")),
            ("no-cool-down", include_str!("../em66/variants/no-cool-down.yaml")),
            ("minimum", include_str!("../em66/variants/minimum.yaml")),
        ],
        parts: &[],
        mutants: include_str!("../em66/mutants.yaml"),
        freedoms: include_str!("../em66/freedoms.yaml"),
    },
    Files {
        folder: "generic",
        device: include_str!("../generic/device.yaml"),
        variants: &[],
        parts: &[],
        mutants: include_str!("../generic/mutants.yaml"),
        freedoms: include_str!("../generic/freedoms.yaml"),
    },
    Files {
        folder: "mcm260x",
        device: include_str!("../mcm260x/device.yaml"),
        variants: &[
            ("1ad", include_str!("../mcm260x/variants/1ad.yaml")),
            ("2ad", include_str!("../mcm260x/variants/2ad.yaml")),
            ("3ad", include_str!("../mcm260x/variants/3ad.yaml")),
            ("4ad", include_str!("../mcm260x/variants/4ad.yaml")),
            ("5ad", include_str!("../mcm260x/variants/5ad.yaml")),
            ("9ad", include_str!("../mcm260x/variants/9ad.yaml")),
        ],
        parts: &[
            ("analogue-inputs-2", include_str!("../mcm260x/parts/analogue-inputs-2.yaml")),
            ("digital-inputs-16", include_str!("../mcm260x/parts/digital-inputs-16.yaml")),
            ("digital-inputs-8", include_str!("../mcm260x/parts/digital-inputs-8.yaml")),
            ("digital-outputs-16", include_str!("../mcm260x/parts/digital-outputs-16.yaml")),
            ("digital-outputs-8", include_str!("../mcm260x/parts/digital-outputs-8.yaml")),
            ("encoders", include_str!("../mcm260x/parts/encoders.yaml")),
            ("parameters-50", include_str!("../mcm260x/parts/parameters-50.yaml")),
            ("universal-analogue", include_str!("../mcm260x/parts/universal-analogue.yaml")),
        ],
        mutants: include_str!("../mcm260x/mutants.yaml"),
        freedoms: include_str!("../mcm260x/freedoms.yaml"),
    },
];

#[cfg(test)]
mod tests {
    use canopen::eds::{Access, ObjectKind};
    use canopen::{DataType, Device, Dictionary, Outbox, Value};

    use super::*;
    use crate::rules::Rules;

    #[test]
    fn every_folder_of_data_is_a_device_of_the_program() {
        let folders = std::fs::read_dir(env!("CARGO_MANIFEST_DIR")).unwrap();
        let folders = folders.map(|folder| folder.unwrap().path());
        for folder in folders.filter(|folder| folder.join("device.yaml").exists()) {
            let name = folder.file_name().unwrap().to_str().unwrap();
            let files = FILES.iter().find(|files| files.folder == name);
            let files = files.unwrap_or_else(|| panic!("{name} is not in FILES of devices.rs"));
            let variants = std::fs::read_dir(folder.join("variants")).into_iter().flatten();
            let mut found: Vec<_> = variants.map(|variant| variant.unwrap().path()).collect();
            found.retain(|path| path.extension().is_some_and(|end| end == "yaml"));
            assert_eq!(files.variants.len(), found.len(), "variants of {name} in FILES");
            let parts = std::fs::read_dir(folder.join("parts")).into_iter().flatten().count();
            assert_eq!(files.parts.len(), parts, "parts of {name} in FILES");
        }
    }

    #[test]
    fn each_decision_and_each_closure_of_a_device_has_one_name() {
        let of_stack = Set::of::<crate::rules::Decision>();
        for device in names().map(|name| device(name).unwrap()) {
            let sets = || device.decisions().iter().chain([&of_stack]);
            for known in [
                sets().flat_map(|set| (set.decisions)()).collect::<Vec<_>>(),
                device.decisions().iter().flat_map(|set| (set.names)()).collect(),
            ] {
                let unique: std::collections::BTreeSet<_> = known.iter().collect();
                assert_eq!(unique.len(), known.len(), "{}", device.description.device);
            }
        }
    }

    #[test]
    fn every_device_loads_and_makes_a_dictionary() {
        for name in names() {
            let described = device(name).unwrap().description;
            assert_eq!(described.device, name);
            Dictionary::new(&described.eds, described.default_node).unwrap();
        }
    }

    #[test]
    fn drr460_is_what_its_manual_says() {
        let eds = device("drr460").unwrap().description.eds;
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
    fn generated_files_are_fresh() {
        for name in names() {
            let device = device(name).unwrap();
            for (file, fresh) in device.generated_files() {
                let path = format!("{}/../{file}", env!("CARGO_MANIFEST_DIR"));
                let committed = std::fs::read_to_string(&path).unwrap_or_default();
                let how = format!("{path}: run `harness eds write {name}`");
                assert!(committed == fresh, "{how}");
            }
        }
    }

    #[test]
    fn a_data_sheet_reads_as_it_was_described() {
        // The order is that of each text, and so are the words about the direction of process data.
        let said = |reading: &canopen::eds::Reading| -> std::collections::BTreeSet<String> {
            let all = reading.diagnostics.iter().map(|it| (it.code.to_string(), &it.message));
            let one = |(code, message): (String, &String)| match code.as_str() {
                "eds-mapping-direction" => code,
                _ => format!("{code} {message}"),
            };
            all.map(one).collect()
        };
        for name in names() {
            let device = device(name).unwrap();
            let reading = canopen::eds::read(device.eds_text().as_bytes());
            assert!(!reading.has_errors(), "{:#?}", reading.diagnostics);
            // CiA 311 has no place for the description of the file and its comments.
            let mut described = Eds::clone(&device.description.eds);
            let xdd = canopen::eds::read(canopen::eds::write_xdd(&described).as_bytes());
            assert_eq!(said(&xdd), said(&reading), "{name}");
            assert_eq!(reading.eds.without_lines(), described);
            described.file.description.clear();
            described.comments.clear();
            assert_eq!(xdd.eds.without_lines(), described);
        }
    }

    #[test]
    fn every_device_boots_up() {
        for name in names() {
            let mut node = device(name).unwrap().node(7, Rules::default());
            let mut out = Outbox::default();
            while out.is_empty() {
                let due = node.poll_at().expect("something to do until boot-up");
                node.handle_timeout(due, &mut out);
            }
            assert_eq!(out.pop().unwrap().to_string(), "707#00");
        }
    }
}
