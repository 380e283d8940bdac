//! A device from its data: `device.yaml` holds the choices of the device, the catalogue holds what
//! its profiles define, and both together are the electronic data sheet.
//!
//! What a device does with its objects belongs to its module in [`devices`](crate::devices).

mod check;
mod file;
mod head;
mod markdown;
mod merge;
mod node;
mod variant;
mod wrong;

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::Mux;
use canopen::catalogue::{Block, Catalogue, Mapping, ObjectFacts, Profile, Scalar};
use canopen::eds::{self, Eds};
use canopen::nearest::did_you_mean;
use canopen::source::{At, Complaint, Outline, Source, read_yaml};

use crate::stack::NodeSettings;

use variant::Draft;
use wrong::Named;

pub use file::DeviceFile;
pub use variant::{PartFile, VariantFile};

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
    /// What its bench shows and an exploration does not judge, with the interpretation that leaves
    /// it open.
    pub not_judged: BTreeMap<String, String>,
    /// Bits and codes, by the names that its profiles have for them.
    pub names: BTreeMap<String, i64>,
    /// Groups of objects that its profiles repeat.
    pub blocks: BTreeMap<String, Block>,
    /// The node id, unless another is given.
    pub default_node: u8,
    /// The data sheet, which every simulation of the device shares.
    pub eds: Arc<Eds>,
    /// The settings of the stack that the data sheet does not contain.
    pub settings: NodeSettings,
    /// Notes that have no place in the data sheet, by value.
    pub notes: Arc<BTreeMap<Mux, Note>>,
    /// The same for arrays and records as a whole.
    pub heads: Arc<BTreeMap<u16, Note>>,
}

/// Facts that have no place in a data sheet.
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

/// The data that a description may refer to.
#[derive(Clone, Copy, Debug)]
pub struct Known<'k> {
    /// The profiles.
    pub catalogue: &'k Catalogue,
    /// The modules with the applications of devices.
    pub behaviours: &'k [&'k str],
}

/// The `device.yaml` of a family of devices.
#[derive(Debug)]
pub struct Family {
    /// Name.
    pub name: String,
    /// The variants of which each is a device, where the file itself describes none.
    pub models: Vec<At<String>>,
}

/// The files that describe a variant.
#[derive(Clone, Copy, Debug)]
pub struct VariantFiles<'f> {
    /// The differences of the variant from its device.
    pub variant: &'f Arc<Source>,
    /// The parts that it may name, by their names.
    pub parts: &'f [(String, Arc<Source>)],
    /// Its device.
    pub device: &'f Arc<Source>,
}

impl Family {
    /// Reads what a `device.yaml` says of its family.
    ///
    /// # Errors
    /// When the text is not of the form.
    pub fn read(device: &Arc<Source>) -> Result<Self, Vec<Complaint>> {
        let file: DeviceFile = read_yaml(device).map_err(one)?;
        Ok(Self { name: file.device.value, models: file.models })
    }
}

impl Description {
    /// Reads a `device.yaml` and merges it with the catalogue.
    ///
    /// # Errors
    /// Everything that is wrong: a text that is not of the form, an object that is not fully
    /// described, a value that is not of its type or outside its limits, a default mapping of a
    /// PDO that is not legal.
    pub fn read(device: &Arc<Source>, known: Known<'_>) -> Result<Self, Vec<Complaint>> {
        let mut named = Named::default();
        let draft = draft(device, known, &mut named)?;
        Self::of_draft(draft, None, known, &[device], &named)
    }

    /// Reads what a variant called `name` has otherwise than the device of these files.
    ///
    /// # Errors
    /// As [`read`](Self::read), and when the variant leaves out what is not there.
    pub fn read_variant(
        name: &str,
        files: VariantFiles<'_>,
        known: Known<'_>,
    ) -> Result<Self, Vec<Complaint>> {
        let VariantFiles { variant, parts, device } = files;
        let mut named = Named::default();
        let mut draft = draft(device, known, &mut named)?;
        let file: VariantFile = read_yaml(variant).map_err(one)?;
        head::check_variant(variant, &file, &draft.file, known)?;
        let mut files = vec![device];
        for part in &file.parts {
            let Some((_, source)) = parts.iter().find(|(name, _)| *name == part.value) else {
                let names = parts.iter().map(|(name, _)| name.as_str());
                let meant = did_you_mean(&part.value, names);
                let message = format!("there is no part `{}`{meant}", part.value);
                return Err(one(Complaint::at(variant, part.place, message)));
            };
            let part: PartFile = read_yaml(source).map_err(one)?;
            named.add(source, part.node());
            part.apply(source, &mut draft)?;
            files.insert(0, source);
        }
        named.add(variant, file.node());
        file.apply(variant, &mut draft)?;
        files.insert(0, variant);
        let variant_of = std::mem::replace(&mut draft.file.device.value, name.to_owned());
        Self::of_draft(draft, Some(variant_of), known, &files, &named)
    }

    /// The device of these objects; complaints are about the first file that says what is wrong.
    fn of_draft(
        draft: Draft,
        variant_of: Option<String>,
        known: Known<'_>,
        files: &[&Arc<Source>],
        named: &Named,
    ) -> Result<Self, Vec<Complaint>> {
        let Draft { file, objects, mut left_out } = draft;
        let identity = [file.vendor.number, file.product.number, file.revision, file.serial];
        let used: Vec<_> = file.node.objects().cloned().collect();
        let mut described = Self::of_head(file, variant_of, known);
        let mut wrong = Vec::new();
        for (index, mut chosen) in objects {
            if index == IDENTITY {
                identify(&mut chosen, identity);
            }
            let is_left_out = |sub| {
                let found = left_out.get_mut(&Mux::new(index, sub));
                found.map(|complaint| *complaint = None).is_some()
            };
            let merged =
                merge::object(&mut described, known.catalogue, index, &chosen, is_left_out);
            wrong.extend(merged.err());
        }
        described.count_pdos();
        if wrong.is_empty() {
            check::values(&described.eds, &mut wrong);
            check::mappings(&described.eds, &mut wrong);
        }
        let mut complaints: Vec<_> = left_out.into_values().flatten().collect();
        complaints.extend(wrong.into_iter().map(|wrong| wrong.complaint(files)));
        if complaints.is_empty() {
            complaints.extend(named.unknown(&used, &described.eds));
            complaints.extend(described.unreadable(files[files.len() - 1]));
        }
        if complaints.is_empty() { Ok(described) } else { Err(complaints) }
    }

    /// A device without objects.
    fn of_head(file: DeviceFile, variant_of: Option<String>, known: Known<'_>) -> Self {
        let values = |texts: Vec<At<String>>| texts.into_iter().map(|at| at.value).collect();
        Self {
            names: of_profiles(&file.profiles, known, |profile| &profile.names),
            blocks: of_profiles(&file.profiles, known, |profile| &profile.blocks),
            eds: Arc::new(Eds {
                file: file.file_info(),
                device: file.device_info(),
                dummies: file.dummy.clone(),
                comments: vec![generated_by(&file.device.value), file.title.value.clone()],
                ..Eds::default()
            }),
            settings: node::settings(&file.node, file.emcy.as_ref()),
            device: file.device.value,
            variant_of,
            title: file.title.value,
            document: file.document,
            profiles: values(file.profiles),
            behaviour: file.behaviour.value,
            without: values(file.without),
            not_judged: file.not_judged.into_iter().map(|(name, by)| (name, by.value)).collect(),
            default_node: file.default_node.value,
            notes: Arc::default(),
            heads: Arc::default(),
        }
    }

    /// A mistake of the data sheet as a whole, although each part of it seemed right.
    fn unreadable(&self, source: &Arc<Source>) -> Option<Complaint> {
        let reading = eds::read(eds::write(&self.eds, &self.generated_by()).as_bytes());
        let error = |found: &&eds::Diagnostic| found.severity == eds::Severity::Error;
        let found = reading.diagnostics.iter().find(error)?;
        let message = format!("the data sheet of this device has an error: {}", found.message);
        let place = Outline::of(source).and_then(|outline| outline.key(&["objects"]));
        Some(Complaint { source: Arc::clone(source), place, message })
    }

    /// The object dictionary as tables for people, in Markdown.
    pub fn markdown(&self) -> String {
        markdown::write(self)
    }

    /// The note of origin in generated files.
    pub fn generated_by(&self) -> String {
        generated_by(&self.device)
    }

    /// Counts the PDOs for the head of the data sheet.
    pub(crate) fn count_pdos(&mut self) {
        let count = |first: u16, last: u16| {
            let within = |object: &&eds::Object| (first..=last).contains(&object.index);
            self.eds.objects.iter().filter(within).count() as u16
        };
        let (rpdos, tpdos) = (count(0x1400, 0x15FF), count(0x1800, 0x19FF));
        let device = &mut Arc::make_mut(&mut self.eds).device;
        (device.rpdo_count, device.tpdo_count) = (rpdos, tpdos);
    }
}

/// The named items of a device's profiles; the first profile that has a name decides.
fn of_profiles<'k, T: Clone + 'k>(
    profiles: &[At<String>],
    known: Known<'k>,
    part: impl Fn(&'k Profile) -> &'k BTreeMap<String, T>,
) -> BTreeMap<String, T> {
    let profiles = profiles.iter().filter_map(|name| known.catalogue.profile(&name.value));
    let mut found = BTreeMap::new();
    for (name, value) in profiles.flat_map(Profile::chain).flat_map(part) {
        found.entry(name.clone()).or_insert_with(|| value.clone());
    }
    found
}

/// The content of a `device.yaml`, with the objects that its `node` names.
fn draft(
    device: &Arc<Source>,
    known: Known<'_>,
    named: &mut Named,
) -> Result<Draft, Vec<Complaint>> {
    let mut file: DeviceFile = read_yaml(device).map_err(one)?;
    head::check(device, &file, known)?;
    named.add(device, &file.node);
    let objects = std::mem::take(&mut file.objects).by_index(device)?;
    let objects = objects.into_iter().map(|(index, object)| (index, object.value)).collect();
    Ok(Draft { file, objects, left_out: BTreeMap::new() })
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

fn one(complaint: Complaint) -> Vec<Complaint> {
    vec![complaint]
}

fn generated_by(device: &str) -> String {
    format!("generated by `harness eds write {device}`")
}

const IDENTITY: u16 = 0x1018;

#[cfg(test)]
mod tests {
    use canopen::Value;

    use super::*;

    #[test]
    fn mistakes_have_places() {
        let table = [
            ("\"400\": {}", "17:3: `400` is neither an index"),
            ("\"5000\": {}", "17:3: 5000: neither the device nor a profile gives its object code"),
            ("\"5000\": { object: var, type: integer8 }", "17:3: 5000 has no name"),
            ("\"5000\": { object: var, name: N, type: integer8 }", "17:3: 5000:00 has no access"),
            ("\"1003\": {}", "17:3: 1003: neither `count` nor `subs`"),
            ("\"1003\": { count: 1, subs: { 2: {} } }", "17:31: 1003:02 lies beyond `count: 1`"),
            ("\"1017\": { value: 70000 }", "17:20: 70000 is not a value of type unsigned16"),
            (
                "\"1017\": { value: 9, low: 10 }",
                "17:20: 1017:00: the default value 9 lies below 10",
            ),
            ("\"1017\": { access: ro, pdo: rpdo }", "17:30: 1017:00 has access ro"),
            (
                "\"1600\": { count: 1, subs: { 1: { value: 0x10170010 } } }",
                "17:43: 1600:01 maps 1017:00, which does not exist",
            ),
            ("\"1017\": {}\n  \"1017..1018\": {}", "18:3: 1017 is described twice"),
            (
                "\"2000\": { object: var, name: N, type: unsigned8, access: ro, \
                 value: $NODEID+200 }",
                "17:71: $NODEID+200 is not a value of type unsigned8",
            ),
        ];
        let wrong = table.map(|(objects, expected)| (complaint(&with(objects)), expected));
        let wrong: Vec<_> =
            wrong.iter().filter(|(got, expected)| !got.starts_with(expected)).collect();
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn mistakes_of_the_head_have_places() {
        let table = [
            ("device: x", "device: X/Y", "1:9: `X/Y` is not a name"),
            ("date: 01-01-2026", "date: 2026-01-01", "4:7: `2026-01-01` is not a date"),
            (
                "profiles: [cia301]",
                "profiles: [cia310]",
                "9:12: no profile `cia310` in the catalogue; did you mean `cia301`?",
            ),
            (
                "behaviour: inert",
                "behaviour: inrt",
                "10:12: no behaviour `inrt`; did you mean `inert`?",
            ),
            (
                "bit-rates: [125]",
                "bit-rates: [125, 1001]",
                "11:18: a bit rate is 10 to 1000 kbit/s",
            ),
            ("default-node: 1", "default-node: 128", "12:15: a node id is 1 to 127"),
            ("title: X", "title: \"X\\nY\"", "2:8: this text does not fit on a line"),
            ("lss: false", "lss: flase", "`true` or `false` belongs here"),
            (
                "lss: false",
                "lss: false\nnode: { clock: \"2F30:01\" }",
                "15:16: the device has no object 2F30:01",
            ),
            ("lss: false", "lss: false\nwithout: [suction]", "no option `suction`"),
            ("lss: false", "lss: false\nnot-judged: { led: A-I-1 }", "no bench has a `led`"),
            (
                "\"1017\": {}",
                "\"6200\": { access: rw }",
                "17:3: 6200 is another object in cia401 than in cia404: say name, object, type",
            ),
        ];
        let both = |yaml: String| yaml.replace("[cia301]", "[cia301, cia401, cia404]");
        let got = |good, bad: &str| {
            let yaml = with("\"1017\": {}").replace(good, bad);
            complaint(&if bad.contains("6200") { both(yaml) } else { yaml })
        };
        let wrong = table.map(|(good, bad, expected)| (got(good, bad), expected));
        let wrong: Vec<_> =
            wrong.iter().filter(|(got, expected)| !got.contains(expected)).collect();
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn a_variant_is_its_device_but_for_what_it_says() {
        let device = source(
            "device.yaml",
            &with("\"1016\": { count: 1, value: 0 }\n  \"1017\": { value: 7, high: 9 }"),
        );
        let read = |rest: &str| {
            let head = "title: Y\nproduct: { name: Q, number: 5, order-code: R }\n";
            let variant = source("variants/small.yaml", &format!("{head}{rest}"));
            let files = VariantFiles { variant: &variant, parts: &[], device: &device };
            Description::read_variant("x-small", files, known())
        };
        let small = read(
            "leave-out: [\"1010..1016\"]\n\
            objects: { \"1017\": { value: 8 }, \"1005\": { value: 128 } }",
        )
        .unwrap();
        assert_eq!((small.title.as_str(), small.eds.device.product_number), ("Y", 5));
        assert_eq!(small.variant_of, Some("x".into()));
        let indices: Vec<u16> = small.eds.objects.iter().map(|object| object.index).collect();
        assert_eq!(indices, [0x1000, 0x1001, 0x1005, 0x1017, 0x1018]);
        let period = small.eds.entry(Mux::new(0x1017, 0)).unwrap();
        let [value, high] = [&period.default, &period.high];
        assert_eq!(value.as_ref().map(|term| term.resolve(1)), Some(Value::Int(8)));
        assert_eq!(high.as_ref().map(|term| term.resolve(1)), Some(Value::Int(9)));
        for (rest, file, expected) in [
            ("leave-out: [\"3000\"]", "variants/small.yaml", "3:13: `3000` is left out, but"),
            ("objects: { \"1017\": { high: 6 } }", "device.yaml", "18:20: 1017:00: the default"),
            (
                "objects: { \"1017\": { value: 10 } }",
                "variants/small.yaml",
                "3:29: 1017:00: the de",
            ),
            ("objects: { \"5000\": {} }", "variants/small.yaml", "3:12: 5000: neither the device"),
        ] {
            let wrong = read(rest).unwrap_err().remove(0);
            assert_eq!(wrong.source.name, file);
            assert!(shown(&wrong).starts_with(expected), "{}", shown(&wrong));
        }
    }

    fn complaint(yaml: &str) -> String {
        match Description::read(&source("device.yaml", yaml), known()) {
            Ok(_) => "nothing".to_owned(),
            Err(complaints) => shown(&complaints[0]),
        }
    }

    fn shown(complaint: &Complaint) -> String {
        let at =
            complaint.place.map_or_else(String::new, |at| format!("{}:{}", at.line, at.column));
        format!("{at}: {}", complaint.message)
    }

    fn known() -> Known<'static> {
        Known { catalogue: Catalogue::built_in(), behaviours: &["inert"] }
    }

    fn source(name: &str, text: &str) -> Arc<Source> {
        Arc::new(Source::new(name, text.to_owned()))
    }

    /// A `device.yaml` with these objects.
    fn with(objects: &str) -> String {
        let head = "device: x\ntitle: X\ndocument: x\ndate: 01-01-2026\n\
            vendor: { name: V, number: 1 }\nproduct: { name: P, number: 2, order-code: O }\n\
            revision: 3\nserial: 4\nprofiles: [cia301]\nbehaviour: inert\nbit-rates: [125]\n\
            default-node: 1\ngranularity: 8\nlss: false\ndummy: []\nobjects:\n";
        let rest = "\"1000\": { value: 0 }\n  \"1001\": {}\n  \"1018\": { count: 1 }\n";
        format!("{head}  {objects}\n  {rest}")
    }
}
