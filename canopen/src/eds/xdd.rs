//! XDD and XDC (CiA 311): a data sheet as XML. Its elements become the sections and keys of CiA
//! 306, each at its place in the XML, so that one reader has the findings for both forms.
//!
//! What CiA 311 says besides, such as labels in several languages, is not read. Keys that it lacks
//! and CiA 306 demands get the value that means nothing.

mod check;
mod entry;
mod limits;
mod write;

use std::collections::HashMap;

use roxmltree::{Attribute, Document, Node};

use super::codes;
use super::diagnostic::Findings;
use super::ini::{self, Key, List, Name, Section};
use super::number;
use crate::source::{Lines, Place};
use entry::Parameter;

pub use write::write_xdd;

/// Whether a text is XML rather than sections and keys.
pub(super) fn is_xml(text: &str) -> bool {
    text.trim_start().starts_with('<')
}

/// The sections of CiA 306 that say what the elements say.
#[derive(Default)]
pub(super) struct Transcript {
    sections: Vec<Written>,
}

/// A section. The text is new, the place is that of the element.
struct Written {
    title: String,
    at: Place,
    keys: Vec<Line>,
}

#[derive(Clone)]
struct Line {
    name: String,
    value: String,
    name_at: Place,
    at: Place,
}

impl Transcript {
    /// Transcribes a text. XML that is not well-formed, or declares entities, becomes a finding and
    /// no section.
    pub(super) fn of(text: &str, findings: &mut Findings) -> Self {
        if let Some((offset, message)) = limits::excess(text) {
            let at = Lines::of(text).at(offset);
            findings.add(&codes::SYNTAX, at, format!("the XML cannot be read: {message}"));
            return Self::default();
        }
        // Declarations of document types are refused, and with them entities that expand.
        let document = match Document::parse(text) {
            Ok(document) => document,
            Err(error) => {
                let at = error.pos();
                let at = Place::new(at.row as usize, at.col as usize);
                findings.add(&codes::SYNTAX, at, format!("the XML cannot be read: {error}"));
                return Self::default();
            }
        };
        let mut scribe = Scribe::new(&document, findings);
        match scribe.objects.is_empty() {
            true => {
                let message = "the XML has no element CANopenObject: it is no data sheet";
                scribe.findings.add(&codes::SYNTAX, Place::new(1, 1), message);
            }
            false => scribe.everything(),
        }
        Self { sections: scribe.sections }
    }

    /// Whether the text is no data sheet, as its finding says.
    pub(super) fn is_empty(&self) -> bool {
        self.sections.is_empty()
    }

    /// The sections in the order of the reader, each once.
    pub(super) fn sections(&self, findings: &mut Findings) -> Vec<Section<'_>> {
        let sections = self.sections.iter().map(|section| Section {
            name: Name::of(&section.title),
            title: &section.title,
            at: section.at,
            keys: section.keys.iter().map(Line::key).collect(),
        });
        ini::in_order(sections.collect(), findings)
    }
}

impl Line {
    fn key(&self) -> Key<'_> {
        Key { name: &self.name, value: &self.value, name_at: self.name_at, at: self.at }
    }
}

/// Writes down what the elements say.
struct Scribe<'d, 'i, 'f> {
    /// All there is about the device.
    root: Node<'d, 'i>,
    lines: Lines<'d>,
    objects: Vec<Node<'d, 'i>>,
    /// What `uniqueIDRef` refers to: parameters and their data types.
    referred: HashMap<&'d str, Node<'d, 'i>>,
    /// What objects refer to, each read once: any number of objects may refer to one.
    parameters: HashMap<&'d str, Parameter>,
    sections: Vec<Written>,
    findings: &'f mut Findings,
}

impl<'d, 'i, 'f> Scribe<'d, 'i, 'f> {
    fn new(document: &'d Document<'i>, findings: &'f mut Findings) -> Self {
        let mut containers = document.descendants().filter(|it| is(it, "ISO15745ProfileContainer"));
        let root = containers.next().unwrap_or_else(|| document.root());
        let elements = root.descendants().filter(Node::is_element);
        let mut referred = HashMap::new();
        for (id, node) in elements.clone().filter_map(|it| Some((it.attribute("uniqueID")?, it))) {
            referred.entry(id).or_insert(node);
        }
        let scribe = Self {
            root,
            lines: Lines::of(document.input_text()),
            objects: elements.clone().filter(|it| is(it, "CANopenObject")).collect(),
            referred,
            parameters: HashMap::new(),
            sections: Vec::new(),
            findings,
        };
        // Editors save a network as one file.
        if let Some(second) = containers.next() {
            let devices = 2 + containers.count();
            let message = format!("the XML describes {devices} devices; the first of them is read");
            scribe.findings.add(&codes::SYNTAX, scribe.place(second), message);
        }
        scribe
    }

    fn everything(&mut self) {
        self.check_elements();
        self.read_parameters();
        self.leave_out_disabled();
        self.leave_out_second_objects();
        self.file_info();
        self.device_info();
        self.dummy_usage();
        self.lists();
        for object in self.objects.clone() {
            self.object(object);
        }
        self.commissioning();
    }

    /// The object dictionary of an editor's project has objects that the device is built without.
    fn leave_out_disabled(&mut self) {
        let (disabled, objects) = self.objects.iter().partition(|it| self.is_disabled(**it));
        self.objects = objects;
        let disabled: Vec<Node<'d, 'i>> = disabled;
        for object in disabled {
            let message = "the object is marked as disabled (CO_disabled); it is left out";
            self.findings.habit(&codes::DISABLED, self.place(object), message);
        }
    }

    fn is_disabled(&self, object: Node<'d, 'i>) -> bool {
        self.parameter_of(object).is_some_and(|parameter| parameter.is_disabled)
    }

    /// The first element of that name, wherever it stands: editors nest them differently.
    fn find(&self, name: &str) -> Option<Node<'d, 'i>> {
        self.root.descendants().find(|it| is(it, name))
    }

    fn place(&self, node: Node<'_, '_>) -> Place {
        self.lines.at(node.range().start)
    }

    fn section(&mut self, title: impl Into<String>, at: Place) -> &mut Written {
        self.sections.push(Written { title: title.into(), at, keys: Vec::new() });
        self.sections.last_mut().expect("it was pushed")
    }

    /// A key with the value of an attribute.
    fn line(&self, name: &str, attribute: Attribute<'_, '_>, value: &str) -> Line {
        Line {
            name: name.to_owned(),
            value: in_a_line(value),
            name_at: self.lines.at(attribute.range().start),
            at: self.lines.at(attribute.range_value().start),
        }
    }

    /// The attributes of an element that have a key, each transcribed.
    fn attributes(&self, node: Node<'d, 'i>, table: &[Told]) -> Vec<Line> {
        let told = |(attribute, key, transcribe): &Told| {
            let attribute = node.attributes().find(|it| it.name() == *attribute)?;
            Some(self.line(key, attribute, &transcribe(attribute.value().trim())))
        };
        table.iter().filter_map(told).collect()
    }

    fn file_info(&mut self) {
        let is_body = |it: &Node<'_, '_>| is(it, "ProfileBody") && it.has_attribute("fileName");
        let bodies: Vec<_> = self.root.descendants().filter(is_body).collect();
        let Some(at) = bodies.first().map(|body| self.place(*body)) else { return };
        let mut keys = Vec::new();
        for body in bodies {
            let mut said = self.attributes(body, FILE);
            // CiA 311 writes both numbers as one version.
            let version = body.attributes().find(|it| it.name() == "fileVersion");
            if let Some(version) = version.filter(|it| !it.value().trim().is_empty()) {
                let (number, revision) = file_version(version.value());
                said.push(self.line("FileVersion", version, &number.to_string()));
                said.push(self.line("FileRevision", version, &revision.to_string()));
            }
            fill(&mut keys, said);
        }
        for key in ["FileVersion", "FileRevision"] {
            fill(&mut keys, vec![Line::at(key, "0", at)]);
        }
        // The sections that are made of the elements follow this edition.
        keys.push(Line::at("EDSVersion", "4.0", at));
        self.section("FileInfo", at).keys = keys;
    }

    fn device_info(&mut self) {
        let identities = ["DeviceIdentity", "identity"].map(|name| self.find(name));
        let general = self.find("CANopenGeneralFeatures");
        let mut places = identities.into_iter().flatten().chain(general);
        let Some(at) = places.next().map(|it| self.place(it)) else { return };
        let mut keys = Vec::new();
        for identity in identities.into_iter().flatten() {
            let known = identity.children().filter_map(|child| {
                let (_, key) = IDENTITY.iter().find(|(element, _)| is(&child, element))?;
                Some(self.element(key, child))
            });
            fill(&mut keys, known.collect());
        }
        self.general_features(general, &mut keys, at);
        if let Some(master) = self.find("CANopenMasterFeatures") {
            keys.extend(self.attributes(master, MASTER));
        }
        self.of_identity_object(&mut keys, at);
        keys.extend(self.bit_rates());
        self.section("DeviceInfo", at).keys = keys;
    }

    /// Attributes that are absent are 0. The element itself may be absent; then nothing is said
    /// about the PDOs, and there are those of the dictionary.
    fn general_features(&self, general: Option<Node<'d, 'i>>, keys: &mut Vec<Line>, at: Place) {
        let at = general.map_or(at, |it| self.place(it));
        let pdos = |first: u16| match general {
            Some(_) => 0,
            None => {
                let pdos = first..first + 0x200;
                self.objects.iter().filter_map(index).filter(|(_, it)| pdos.contains(it)).count()
            }
        };
        keys.extend(general.map_or_else(Vec::new, |it| self.attributes(it, GENERAL)));
        supply(keys, [("NrOfRXPDO", pdos(0x1400)), ("NrOfTXPDO", pdos(0x1800))], at);
        supply(keys, [("LSS_Supported", 0)], at);
        if general.is_none() {
            supply(keys, [("Granularity", 0)], at);
        }
    }

    /// The text of an element as a value. A comment in it says nothing.
    fn element(&self, key: &str, node: Node<'d, 'i>) -> Line {
        let texts = || node.children().filter(Node::is_text);
        let said = |it: &Node<'_, '_>| it.text().is_some_and(|text| !in_a_line(text).is_empty());
        let name_at = self.place(node);
        Line {
            name: key.to_owned(),
            value: in_a_line(&texts().filter_map(|it| it.text()).collect::<String>()),
            name_at,
            at: texts().find(said).map_or(name_at, |it| self.place(it)),
        }
    }

    /// What CiA 311 has in the dictionary alone, or does not ask for beside it: numbers of the
    /// identity object, by sub-index.
    fn of_identity_object(&self, keys: &mut Vec<Line>, at: Place) {
        let number = |node: &Node<'_, '_>, name, wanted| {
            node.attribute(name).and_then(entry::hex).is_some_and(|found| found == wanted)
        };
        let identity = self.objects.iter().find(|it| number(it, "index", 0x1018));
        for (sub, key) in (1..).zip(["VendorNumber", "ProductNumber", "RevisionNumber"]) {
            let sub = identity.and_then(|it| it.children().find(|it| number(it, "subIndex", sub)));
            let default = sub.and_then(|it| {
                let keys = self.entry(it);
                keys.into_iter().find(|line| line.name == "DefaultValue" && !line.value.is_empty())
            });
            match default {
                Some(line) => fill(keys, vec![Line { name: key.to_owned(), ..line }]),
                None if keys.iter().all(|line| line.name != key) => {
                    keys.push(Line::at(key, "0", at));
                }
                None => {}
            }
        }
    }

    /// `125 Kbps` as `BaudRate_125=1`. That a device finds out the bit rate has no key.
    fn bit_rates(&mut self) -> Vec<Line> {
        let rates = self.root.descendants().filter(|it| is(it, "supportedBaudRate"));
        let mut keys = Vec::new();
        for value in rates.filter_map(|it| it.attribute_node("value")) {
            match (number::bit_rate(value.value().trim()), value.value()) {
                (Some(rate), _) => keys.push(self.line(&format!("BaudRate_{rate}"), value, "1")),
                (None, "auto-baudRate") => {}
                (None, other) => {
                    let message = format!("{other:?} is not a bit rate like \"125 Kbps\"");
                    let at = self.lines.at(value.range_value().start);
                    self.findings.add(&codes::BIT_RATE, at, message);
                }
            }
        }
        keys
    }

    /// `<dummy entry="Dummy0005=1"/>`; a dummy that is not named is none.
    fn dummy_usage(&mut self) {
        let Some(usage) = self.find("dummyUsage") else { return };
        let mut keys = Vec::new();
        for entry in usage.children().filter_map(|it| it.attribute_node("entry")) {
            let dummy = entry.value().split_once('=').filter(|(name, _)| is_dummy(name.trim()));
            match dummy {
                Some((name, value)) => keys.push(self.line(name.trim(), entry, value)),
                None => {
                    let message = format!("entry {:?} is not like \"Dummy0005=1\"", entry.value());
                    let at = self.lines.at(entry.range_value().start);
                    self.findings.add(&codes::SYNTAX, at, message);
                }
            }
        }
        let at = self.place(usage);
        supply(&mut keys, DUMMIES.map(|name| (name, 0)), at);
        self.section("DummyUsage", at).keys = keys;
    }

    /// The lists follow from the indices; a list of CiA 311 may say how many there are.
    fn lists(&mut self) {
        let Some(list) = self.find("CANopenObjectList") else { return };
        for (kind, counted) in [
            (List::Mandatory, "mandatoryObjects"),
            (List::Optional, "optionalObjects"),
            (List::Manufacturer, "manufacturerObjects"),
        ] {
            let indices = self.objects.iter().filter_map(index);
            let indices = indices.filter(|(_, index)| List::of(*index) == kind);
            let mut keys: Vec<Line> = (1..)
                .zip(indices)
                .map(|(place, (attribute, index))| {
                    self.line(&place.to_string(), attribute, &format!("0x{index:04X}"))
                })
                .collect();
            let count = match list.attribute_node(counted) {
                Some(count) => self.line("SupportedObjects", count, &decimal(count.value().trim())),
                None => Line::at("SupportedObjects", &keys.len().to_string(), self.place(list)),
            };
            keys.push(count);
            let at = self.place(list);
            self.section(kind.title(), at).keys = keys;
        }
    }

    fn object(&mut self, object: Node<'d, 'i>) {
        let Some(index) = self.number(object, "index", 0xFFFF) else { return };
        let (at, keys) = (self.place(object), self.entry(object));
        self.section(format!("{index:04X}"), at).keys = keys;
        let (subs, seconds) = entry::subs(object);
        if subs.is_empty() {
            self.direction(object);
        }
        for [first, second] in seconds {
            let sub = second.attribute("subIndex").and_then(entry::hex).unwrap_or_default();
            let (name, at) = (format!("{index:04X}:{sub:02X}"), self.place(second));
            self.second(&codes::DUPLICATE_SECTION, &name, first, at);
        }
        for sub in subs {
            let Some(number) = self.number(sub, "subIndex", 0xFF) else { continue };
            self.direction(sub);
            let (at, keys) = (self.place(sub), self.entry(sub));
            self.section(format!("{index:04X}sub{number:X}"), at).keys = keys;
        }
    }

    /// The hexadecimal number of an object. One that has none is left out.
    fn number(&mut self, node: Node<'d, 'i>, name: &str, largest: u32) -> Option<u32> {
        let text = node.attribute(name);
        let number = text.and_then(entry::hex).filter(|number| *number <= largest);
        if number.is_none() {
            let message = match text {
                Some(text) => {
                    format!("{name}: {text:?} is not a hexadecimal number to {largest:X}")
                }
                None => format!("{name} is missing"),
            };
            self.findings.add(&codes::SYNTAX, self.place(node), message);
        }
        number
    }

    /// The configuration of one device, in an XDC.
    fn commissioning(&mut self) {
        let Some(node) = self.find("deviceCommissioning") else { return };
        let (at, keys) = (self.place(node), self.attributes(node, COMMISSIONING));
        self.section("DeviceComissioning", at).keys = keys;
    }
}

impl Line {
    /// What CiA 311 has no attribute for, at the place of the element.
    fn at(name: &str, value: &str, at: Place) -> Self {
        Self { name: name.to_owned(), value: value.to_owned(), name_at: at, at }
    }
}

/// Adds what was not said before, or was empty: a file has a profile of the device and one of the
/// network, and editors fill in either.
fn fill(keys: &mut Vec<Line>, with: Vec<Line>) {
    for line in with {
        match keys.iter_mut().find(|key| key.name == line.name) {
            Some(key) if key.value.is_empty() => *key = line,
            Some(_) => {}
            None => keys.push(line),
        }
    }
}

/// Adds numbers that CiA 311 leaves out.
fn supply<'n>(
    keys: &mut Vec<Line>,
    numbers: impl IntoIterator<Item = (&'n str, usize)>,
    at: Place,
) {
    for (name, number) in numbers {
        if !keys.iter().any(|line| line.name == name) {
            keys.push(Line::at(name, &number.to_string(), at));
        }
    }
}

/// The index of an object, and where it stands.
fn index<'n, 'd, 'i>(object: &'n Node<'d, 'i>) -> Option<(Attribute<'n, 'i>, u16)> {
    let attribute = object.attribute_node("index")?;
    Some((attribute, u16::try_from(entry::hex(attribute.value())?).ok()?))
}

/// A value has no line ends, and no space around it.
fn in_a_line(text: &str) -> String {
    text.replace(['\r', '\n'], " ").trim_ascii().to_owned()
}

fn is_dummy(name: &str) -> bool {
    let digits = name.strip_prefix("Dummy").unwrap_or_default();
    digits.len() == 4 && digits.bytes().all(|it| it.is_ascii_hexdigit())
}

fn is(node: &Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

/// An attribute, its key in CiA 306, and the value there.
type Told = (&'static str, &'static str, fn(&str) -> String);

fn as_is(text: &str) -> String {
    text.to_owned()
}

fn truth(text: &str) -> String {
    match text {
        _ if text.eq_ignore_ascii_case("true") => "1".to_owned(),
        _ if text.eq_ignore_ascii_case("false") => "0".to_owned(),
        other => other.to_owned(),
    }
}

/// `V1.2` as 1 and 2, which are numbers in CiA 306. In CiA 311 they are any text, so that what is
/// no number is 0.
fn file_version(text: &str) -> (u32, u32) {
    let mut parts = text.trim().trim_start_matches(['V', 'v']).split('.');
    let mut number = || {
        let part = parts.next().unwrap_or_default();
        let is_hex = part.starts_with("0x");
        let number = if is_hex { entry::hex(part) } else { part.parse().ok() };
        number.unwrap_or_default()
    };
    (number(), number())
}

/// Digits of a decimal number, which a zero before them makes octal in CiA 306.
fn decimal(text: &str) -> String {
    match text.trim_start_matches('0') {
        "" if !text.is_empty() => "0".to_owned(),
        digits if digits.bytes().all(|it| it.is_ascii_digit()) => digits.to_owned(),
        _ => text.to_owned(),
    }
}

/// `2026-11-21` as `11-21-2026`, also with a time zone; another form stays, for the reader to
/// report.
fn date(text: &str) -> String {
    let day = text.get(..10).filter(|_| text[10..].starts_with(['Z', '+', '-'])).unwrap_or(text);
    match day.split('-').collect::<Vec<_>>().as_slice() {
        [year, month, day] if year.len() == 4 => format!("{month}-{day}-{year}"),
        _ => text.to_owned(),
    }
}

/// `14:05:00` and `2:05:00 PM` as `02:05PM`; another form stays.
fn time(text: &str) -> String {
    let mut parts = text.splitn(3, ':');
    let hour = parts.next().and_then(|hour| hour.parse::<u8>().ok()).filter(|hour| *hour < 24);
    match (hour, parts.next()) {
        (Some(hour), Some(minute)) if minute.len() == 2 => {
            let half = match text.get(text.len().saturating_sub(2)..) {
                Some(half @ ("AM" | "PM")) => half,
                _ if hour < 12 => "AM",
                _ => "PM",
            };
            format!("{:02}:{minute}{half}", (hour + 11) % 12 + 1)
        }
        _ => text.to_owned(),
    }
}

const FILE: &[Told] = &[
    ("fileName", "FileName", as_is),
    ("fileCreator", "CreatedBy", as_is),
    ("fileCreationDate", "CreationDate", date),
    ("fileCreationTime", "CreationTime", time),
    ("fileModificationDate", "ModificationDate", date),
    ("fileModificationTime", "ModificationTime", time),
    ("fileModifiedBy", "ModifiedBy", as_is),
];

const IDENTITY: [(&str, &str); 5] = [
    ("vendorName", "VendorName"),
    ("vendorID", "VendorNumber"),
    ("productName", "ProductName"),
    ("productID", "ProductNumber"),
    ("orderNumber", "OrderCode"),
];

const GENERAL: &[Told] = &[
    ("granularity", "Granularity", decimal),
    ("nrOfRxPDO", "NrOfRXPDO", decimal),
    ("nrOfTxPDO", "NrOfTXPDO", decimal),
    ("bootUpSlave", "SimpleBootUpSlave", truth),
    ("groupMessaging", "GroupMessaging", truth),
    ("dynamicChannels", "DynamicChannelsSupported", as_is),
    ("layerSettingServiceSlave", "LSS_Supported", truth),
];

const DUMMIES: [&str; 7] =
    ["Dummy0001", "Dummy0002", "Dummy0003", "Dummy0004", "Dummy0005", "Dummy0006", "Dummy0007"];

const MASTER: &[Told] = &[("bootUpMaster", "SimpleBootUpMaster", truth)];

const COMMISSIONING: &[Told] = &[
    ("nodeID", "NodeID", decimal),
    ("nodeName", "NodeName", as_is),
    ("actualBaudRate", "Baudrate", as_is),
    ("networkNumber", "NetNumber", as_is),
    ("networkName", "NetworkName", as_is),
    ("CANopenManager", "CANopenManager", truth),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_dates_of_editors() {
        for (text, expected) in [
            ("14:05:00", "02:05PM"),
            ("00:30:00.0000000+02:00", "12:30AM"),
            ("12:00:00", "12:00PM"),
            ("9:48:42 PM", "09:48PM"),
            ("soon", "soon"),
        ] {
            assert_eq!(time(text), expected, "{text}");
        }
        assert_eq!(date("2020-09-27"), "09-27-2020");
        assert_eq!(date("2020-09-27-07:00"), "09-27-2020");
        assert_eq!(date("2020-09-27Z"), "09-27-2020");
        assert_eq!(date("27.9.2020"), "27.9.2020");
        assert_eq!(date("27.9.202ü"), "27.9.202ü");
    }

    #[test]
    fn versions_are_any_text() {
        for (text, expected) in [
            ("1", (1, 0)),
            ("V2.08", (2, 8)),
            ("0x01", (1, 0)),
            ("1.2.3", (1, 2)),
            ("", (0, 0)),
            ("-", (0, 0)),
            ("2.beta", (2, 0)),
        ] {
            assert_eq!(file_version(text), expected, "{text}");
        }
    }
}
