//! From sections and keys to the description of a device.
//!
//! Mistakes of form belong here, such as a number that is none. Whether the values make sense
//! together belongs to [`lint`](super::lint).

mod compact;
mod connect;
mod info;
mod lists;
mod modules;
mod object;

use std::collections::BTreeSet;

use super::codes;
use super::codes::Severity;
use super::diagnostic::{Diagnostic, Findings};
use super::ini::{self, Key, List, Name, Part, Section};
use super::lint;
use super::model::{Eds, Term, UnknownSection};
use super::module::Modules;
use super::text;
use super::value;
use super::xdd::{self, Transcript};
use crate::source::Place;
use crate::value::DataType;

/// The result of reading a data sheet: always a description, and the diagnostics.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// The description, as complete as the text allows.
    pub eds: Eds,
    /// The modules, of which the description has those that are connected.
    pub modules: Modules,
    /// The findings, in the order of the text.
    pub diagnostics: Vec<Diagnostic>,
}

impl Reading {
    /// Whether an error is among the diagnostics.
    pub fn has_errors(&self) -> bool {
        self.diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
    }
}

/// Reads a data sheet in any encoding, however far it is from CiA 306. Every deviation becomes a
/// diagnostic, and text that is not understood is kept as [`unknown`](Eds::unknown). The
/// diagnostics of [`lint`](super::lint) are among those returned.
///
/// With `[ConnectedModules]` the description is that of a device with these modules, and what
/// describes modules has become objects. Without, it is that of a device without modules.
pub fn read(source: &[u8]) -> Reading {
    read_with_modules(source, None)
}

/// The same with the numbers of the modules at places 1, 2, 3 and so on, which take the place of
/// `[ConnectedModules]`. Numbers that no module has are left out.
pub fn read_with_modules(source: &[u8], connected: Option<&[u16]>) -> Reading {
    let mut findings = Findings::default();
    let text = text::decode_with(source, &mut findings);
    let is_xml = xdd::is_xml(&text);
    let transcript;
    let sections = if is_xml {
        // Whatever the encoding, XML may have it, but UTF-16 needs its mark (XML 1.0, 4.3.3).
        findings = Findings::default();
        if text::is_unmarked_utf16(source) {
            let message = "the file is UTF-16 and does not start with a byte order mark";
            findings.add(&codes::ENCODING, Place::new(1, 1), message);
        }
        transcript = Transcript::of(&text, &mut findings);
        if transcript.is_empty() {
            return Reading { diagnostics: findings.finish(), ..Reading::default() };
        }
        transcript.sections(&mut findings)
    } else {
        ini::parse(&text, &mut findings)
    };
    let mut reader = Reader { eds: Eds::default(), findings, compact_pdo: None, expanded: 0 };
    reader.check_sections(&sections);
    let place = |name| sections.partition_point(|section| section.name < name);
    let (objects, modules) = (place(FIRST_OBJECT), place(Name::SupportedModules));
    let others = place(Name::Other);
    for section in &sections[..objects] {
        reader.info(section);
    }
    let listed = reader.lists(&sections[..objects]);
    reader.objects(&sections[objects..modules]);
    for section in &sections[others..] {
        reader.other(section);
    }
    reader.check_lists(listed);
    let (modules, of_modules) = reader.with_modules(&sections[modules..others], connected);
    reader.compact_pdos();
    reader.sort_unknown();
    let origin = lint::Origin { sections: &sections, of_modules, is_xml };
    lint::check(&reader.eds, &origin, &mut reader.findings);
    Reading { eds: reader.eds, modules, diagnostics: reader.findings.finish() }
}

struct Reader {
    eds: Eds,
    findings: Findings,
    /// The subs that undescribed PDOs have, and the place that says so.
    compact_pdo: Option<(u8, Place)>,
    /// How many subs the short forms have stood for so far.
    expanded: usize,
}

impl Reader {
    fn check_sections(&mut self, sections: &[Section<'_>]) {
        for name in [Name::FileInfo, Name::DeviceInfo, Name::Objects(List::Mandatory)] {
            if !sections.iter().any(|section| section.name == name) {
                let message =
                    format!("section [{}] is missing", name.canonical().unwrap_or_default());
                self.findings.add(&codes::MISSING_SECTION, Place::new(1, 1), message);
            }
        }
    }

    fn info(&mut self, section: &Section<'_>) {
        match section.name {
            Name::FileInfo => self.file_info(section),
            Name::DeviceInfo => self.device_info(section),
            Name::DummyUsage => self.dummy_usage(section),
            Name::Comments => self.comments(section),
            // Read afterwards, those of one kind together.
            _ => {}
        }
    }

    /// Reads what describes modules, and adds those that are connected. Gives the objects that
    /// modules can have, too.
    fn with_modules(
        &mut self,
        sections: &[Section<'_>],
        connected: Option<&[u16]>,
    ) -> (Modules, BTreeSet<u16>) {
        let (described, of_sheet) = self.modules(sections);
        let connected = connected.map(<[u16]>::to_vec).or(of_sheet);
        let supported: Vec<_> = described.iter().map(|described| described.as_module()).collect();
        let mut modules = Modules { supported, connected, ..Modules::default() };
        match &modules.connected {
            Some(connected) if !described.is_empty() => {
                modules.entries = self.connect(&described, connected);
            }
            _ => {
                if let Some(first) = sections.first().filter(|_| !described.is_empty()) {
                    let message = "the sheet does not say which modules are connected; the \
                                   objects are those of a device without modules";
                    self.findings.add(&codes::MODULE, first.at, message);
                }
                for section in sections {
                    self.keep(section.title.to_owned(), section.keys.iter());
                }
            }
        }
        let objects = described.iter().flat_map(|described| described.indices());
        (modules, objects.collect())
    }

    /// Keeps a section that has no place in the description.
    fn other(&mut self, section: &Section<'_>) {
        let title = section.title;
        let (code, message) = if is_one_of(title, &COMMISSIONING) {
            self.commissioning(section);
            (&codes::DCF, format!("section [{title}] is for a configured device (DCF, XDC)"))
        } else if is_one_of(title, &KNOWN_OTHERS) || is_tool(title) {
            return self.keep(title.to_owned(), section.keys.iter());
        } else {
            (
                &codes::UNKNOWN_SECTION,
                format!("section [{title}] is not defined by CiA 306; it is kept"),
            )
        };
        self.findings.habit(code, section.at, message);
        self.keep(title.to_owned(), section.keys.iter());
    }

    fn keep<'k, 'a: 'k>(&mut self, name: String, keys: impl Iterator<Item = &'k Key<'a>>) {
        let keys = keys.map(|key| (key.name.to_owned(), key.value.to_owned())).collect();
        self.eds.unknown.push(UnknownSection { name, keys });
    }

    /// Keeps the keys of a section that has a place; without keys there is no section.
    fn keep_keys(&mut self, name: Name, keys: Kept) {
        if !keys.is_empty()
            && let Some(name) = name.canonical()
        {
            self.eds.unknown.push(UnknownSection { name, keys });
        }
    }

    /// Puts what is unknown into the order of the text that [`write`](super::write) makes of it.
    fn sort_unknown(&mut self) {
        self.eds.unknown.sort_by_key(|section| Name::of(&section.name));
    }

    /// The keys of a section that have no place; reports those that mean nothing at all.
    fn others(&mut self, section: &Section<'_>, known: impl Fn(&str) -> bool) -> Kept {
        let mut kept = Kept::new();
        for key in section.keys.iter().filter(|key| !known(key.name)) {
            kept.push((key.name.to_owned(), key.value.to_owned()));
            if is_one_of(key.name, &DCF_KEYS) {
                let message = format!("key {:?} is for a configured device (DCF, XDC)", key.name);
                self.findings.habit(&codes::DCF, key.name_at, message);
            } else if !is_one_of(key.name, &KEPT_KEYS) {
                let message =
                    format!("key {:?} is not defined for this section; it is kept", key.name);
                self.findings.habit(&codes::UNKNOWN_KEY, key.name_at, message);
            }
        }
        kept
    }

    /// The value of a key in that type; text that is none goes to `kept`.
    fn term(&mut self, key: &Key<'_>, data_type: DataType, kept: &mut Kept) -> Option<Term> {
        let term = value::term(key, data_type, &mut self.findings);
        if term.is_none() {
            kept.push((key.name.to_owned(), key.value.to_owned()));
        }
        term
    }
}

/// Keys that have no place in the description, and values that could not be understood.
type Kept = Vec<(String, String)>;

fn is_one_of(text: &str, names: &[&str]) -> bool {
    names.iter().any(|name| name.eq_ignore_ascii_case(text))
}

/// Sections of CiA 306 that say nothing about the dictionary.
fn is_tool(title: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let links = title.get(4..).is_some_and(|rest| rest.eq_ignore_ascii_case("ObjectLinks"));
    links || starts_with(title, "Tool") && digits(&title[4..])
}

fn starts_with(text: &str, word: &str) -> bool {
    text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
}

const FIRST_OBJECT: Name = Name::Object(0, Part::Head);

/// The first spelling is that of CiA 306.
const COMMISSIONING: [&str; 2] = ["DeviceComissioning", "DeviceCommissioning"];

const KNOWN_OTHERS: [&str; 2] = ["DynamicChannels", "Tools"];

const DCF_KEYS: [&str; 5] =
    ["ParameterValue", "Denotation", "UploadFile", "DownloadFile", "LastEDS"];

/// Keys that CiA 306 knows and the description does not hold.
const KEPT_KEYS: [&str; 7] = [
    "DynamicChannelsSupported",
    "CANopenSafetySupported",
    "LSS_Master",
    "NG_Slave",
    "NG_Master",
    "NrOfNG_MonitoredNodes",
    "ObjFlags",
];
