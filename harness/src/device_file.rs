//! The device file: which device is tested, how, and what must not be done to it. The command line
//! takes precedence, except over the protection of the device.

mod nodes;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canopen::eds::Eds;
use runner::dut::{Hook, Hooks};
use runner::protect::{Deed, Objects, Protection};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use crate::command_line::{CommandLine, is_path};
use crate::files::read_source;
use crate::hook::Program;
use crate::nearest::did_you_mean;
use crate::source::{At, Complaint, Place, Source, read_yaml};
use crate::system;

pub use nodes::NodeEntry;
use nodes::Outer;

/// A device file, and where it is.
#[derive(Debug)]
pub struct DeviceFile {
    /// The text, for complaints.
    pub source: Arc<Source>,
    /// The folder that paths in it are relative to.
    folder: PathBuf,
    /// The content.
    pub said: DutFile,
    /// The file that names this device among others, and says the rest.
    outer: Option<Outer>,
}

/// A device file: everything that a run needs to know of a device under test.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct DutFile {
    /// Where the device is: `can0`, `slcan:/dev/ttyACM0`, `exec:./firmware`, `sim:drr460`.
    #[serde(default)]
    pub target: Option<String>,
    /// Its node id; a bus is scanned when absent.
    #[serde(default)]
    pub node: Option<At<u8>>,
    /// Its data sheet.
    #[serde(default)]
    pub eds: Option<At<PathBuf>>,
    /// The modules that are plugged into a modular device, in their order: their numbers in the
    /// data sheet.
    #[serde(default)]
    pub modules: Option<At<Vec<At<u16>>>>,
    /// Its name in reports and for the `device` key of suites.
    #[serde(default)]
    pub device: Option<String>,
    /// Bit rate of the bus in bit/s; that of the interface when absent.
    #[serde(default)]
    pub bit_rate: Option<At<u32>>,
    /// Folders with suites of your own, in addition to those in the program.
    #[serde(default)]
    pub suites: Vec<PathBuf>,
    /// Folders with the only suites to read.
    #[serde(default)]
    pub only_suites: Vec<PathBuf>,
    /// Folder with files that override profiles of the catalogue.
    #[serde(default)]
    pub catalogue: Option<PathBuf>,
    /// Which suites and cases run: names or globs; all that apply when absent.
    #[serde(default)]
    pub select: Vec<At<String>>,
    /// Options of the profile that the device does not have, such as `suction`.
    #[serde(default)]
    pub without: Vec<String>,
    /// Objects that may be written with any data although the data sheet does not say so.
    #[serde(default)]
    pub free_to_write: Vec<ObjectRange>,
    /// The bench around the device: `unix:PATH`, or a program with its arguments.
    #[serde(default)]
    pub bench: Option<String>,
    /// Whether LENIENT is good enough; it is unless `strict` is said.
    #[serde(default)]
    pub grade: Option<GradeWord>,
    /// A file of waivers.
    #[serde(default)]
    pub waivers: Option<At<PathBuf>>,
    /// Multiplies how long the cases of a profile wait for the application of the device.
    #[serde(default)]
    pub patience: Option<At<u32>>,
    /// A program that resets the device when nothing else brings it back.
    #[serde(default)]
    pub reset: Option<At<String>>,
    /// A program that switches the supply of the device: its last argument is `off` or `on`.
    #[serde(default)]
    pub power: Option<At<String>>,
    /// Several devices instead of one, each by the path of its own device file or by what such a
    /// file says; what this file says besides holds for each that does not say otherwise.
    #[serde(default)]
    pub nodes: Vec<At<NodeEntry>>,
    /// What must not be done to the device.
    #[serde(default)]
    pub protect: Protect,
    /// What may be done to the device that is refused otherwise.
    #[serde(default)]
    pub allow: Allow,
}

/// What must not be done to a device. A case that needs it is skipped.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Protect {
    /// Objects that are never written, neither by SDO nor by PDO.
    #[serde(default)]
    pub objects: Vec<At<ObjectRange>>,
    /// Whether objects that the data sheet calls DOMAIN are never written.
    #[serde(default)]
    pub domains: Option<At<bool>>,
    /// How often 1010h (store parameters) may be written in a run; any number when absent.
    #[serde(default)]
    pub stores: Option<At<u32>>,
    /// How often 1011h (restore default parameters) may be written in a run. When absent: never, if
    /// objects or domains are protected, since it changes them as well; else any number.
    #[serde(default)]
    pub loads: Option<At<u32>>,
    /// Layer setting services that are not used.
    #[serde(default)]
    pub lss: Vec<At<LssWord>>,
    /// NMT commands that are not sent.
    #[serde(default)]
    pub nmt: Vec<At<NmtWord>>,
}

/// What may be done to a device.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Allow {
    /// Whether outputs may be driven: objects that can be mapped into an RPDO, parameters whose
    /// name in the data sheet is about an output, and with CiA 401 also what outputs do on errors.
    /// Unless this is `true` they may not, and while one is on, nothing is sent that may move it.
    #[serde(default)]
    pub outputs: Option<At<bool>>,
}

/// A layer setting service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LssWord {
    /// Switch state global, which puts every slave of the bus into configuration state.
    Global,
    /// Configure and activate bit timing parameters.
    BitTiming,
    /// Configure node id.
    NodeId,
    /// Store configuration.
    Store,
}

/// An NMT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NmtWord {
    /// Reset node.
    ResetNode,
    /// Reset communication.
    ResetCommunication,
    /// Any command to all nodes.
    AllNodes,
}

/// What counts as green.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GradeWord {
    /// LENIENT is not good enough.
    Strict,
    /// LENIENT is good enough.
    Lenient,
}

/// Objects by their addresses: `"2000"`, `"2000:01"` or `"2000..20FF"`.
#[derive(Clone, Debug)]
pub struct ObjectRange {
    /// As it is written.
    pub text: String,
    /// Which they are.
    pub objects: Objects,
}

impl<'de> Deserialize<'de> for ObjectRange {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let objects = parse_objects(&text).ok_or_else(|| {
            let forms =
                "objects are written \"2000\", \"2000:01\" or \"2000..20FF\", in hexadecimal";
            D::Error::custom(forms)
        })?;
        Ok(Self { text, objects })
    }
}

impl JsonSchema for ObjectRange {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "ObjectRange".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let hex = "[0-9A-Fa-f]";
        json_schema!({
            "description": "Objects by their addresses: `2000`, `2000:01` or `2000..20FF`.",
            "type": "string",
            "pattern": format!("^{hex}{{4}}(:{hex}{{2}}|\\.\\.{hex}{{4}})?$"),
        })
    }
}

fn parse_objects(text: &str) -> Option<Objects> {
    let hex = |text: &str, len| {
        let fits = text.len() == len && text.bytes().all(|digit| digit.is_ascii_hexdigit());
        fits.then(|| u16::from_str_radix(text, 16).ok()).flatten()
    };
    if let Some((first, last)) = text.split_once("..") {
        let (first, last) = (hex(first, 4)?, hex(last, 4)?);
        return (first <= last).then_some(Objects { indices: first..=last, sub: None });
    }
    let (index, sub) = match text.split_once(':') {
        Some((index, sub)) => (index, Some(hex(sub, 2)? as u8)),
        None => (text, None),
    };
    let index = hex(index, 4)?;
    Some(Objects { indices: index..=index, sub })
}

/// Whether what is before the colon of a target says that a program follows.
fn is_exec(text: &str) -> bool {
    text == "exec" || text.starts_with("exec@")
}

impl DeviceFile {
    /// Reads a device file.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub(crate) fn load(path: &Path) -> Result<Self, Vec<Complaint>> {
        let source = read_source(path).map_err(|complaint| vec![complaint])?;
        let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
        let said = read_yaml(&source).map_err(|complaint| vec![complaint])?;
        Self::checked(source, folder, said)
    }

    /// The same of what was read.
    fn checked(
        source: Arc<Source>,
        folder: PathBuf,
        said: DutFile,
    ) -> Result<Self, Vec<Complaint>> {
        let file = Self::sound(source, folder, said)?;
        let missing = file.missing();
        if missing.is_empty() { Ok(file) } else { Err(missing) }
    }

    /// The files that it names and that are not there, and the programs that cannot be started.
    fn missing(&self) -> Vec<Complaint> {
        let said = &self.said;
        let files = said.eds.iter().chain(&said.waivers).filter_map(|At { value, place }| {
            let there = self.path(value).is_file();
            (!there).then(|| (*place, format!("there is no file {}", self.path(value).display())))
        });
        let programs = said.reset.iter().chain(&said.power).filter_map(|At { value, place }| {
            let line = match CommandLine::parse_in(&self.folder, value) {
                Ok(line) => line,
                Err(wrong) => return Some((*place, wrong)),
            };
            // The name of a program is looked for elsewhere.
            let program = line.words.first().filter(|word| is_path(word))?;
            let path = self.path(&line.folder.unwrap_or_default()).join(program);
            let wrong = match fs::metadata(&path) {
                Err(_) => format!("there is no program {}", path.display()),
                Ok(found) if system::is_program(&found, &path) => return None,
                Ok(_) => system::no_program(&path),
            };
            Some((*place, wrong))
        });
        let all = files.chain(programs);
        all.map(|(place, wrong)| Complaint::at(&self.source, place, wrong)).collect()
    }

    /// Reads the text of a device file, whose paths are relative to `folder`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn of_source(source: Arc<Source>, folder: PathBuf) -> Result<Self, Vec<Complaint>> {
        let said = read_yaml(&source).map_err(|complaint| vec![complaint])?;
        Self::sound(source, folder, said)
    }

    fn sound(source: Arc<Source>, folder: PathBuf, said: DutFile) -> Result<Self, Vec<Complaint>> {
        let complaints = said.wrong(&source);
        match complaints.is_empty() {
            true => Ok(Self { source, folder, said, outer: None }),
            false => Err(complaints),
        }
    }

    /// A path of the file as the program needs it.
    pub(crate) fn path(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }

    /// The target as the program needs it: a simulated device may be a folder.
    pub fn target(&self) -> Option<String> {
        let target = self.said.target.as_ref()?;
        if let Some((exec, command)) = target.split_once(':').filter(|(exec, _)| is_exec(exec)) {
            return Some(format!("{exec}:{}", self.command(command)));
        }
        let of_folder = target.strip_prefix("sim:").and_then(|device| {
            let (path, rest) = device.split_at(device.find('?').unwrap_or(device.len()));
            let path = self.path(Path::new(path));
            path.exists().then(|| format!("sim:{}{rest}", path.display()))
        });
        Some(of_folder.unwrap_or_else(|| target.clone()))
    }

    /// The bench as the program needs it: its path, or that of its program.
    pub fn bench(&self) -> Option<String> {
        let bench = self.said.bench.as_ref()?;
        if let Some(socket) = bench.strip_prefix("unix:") {
            return Some(format!("unix:{}", self.path(Path::new(socket)).display()));
        }
        Some(self.command(bench))
    }

    /// A command line whose paths are relative to this program. What is wrong with it is said when
    /// it is started.
    fn command(&self, command: &str) -> String {
        let line = CommandLine::parse_in(&self.folder, command);
        line.map_or_else(
            |_| command.to_owned(),
            |line| line.from(|path| self.path(path)).to_string(),
        )
    }

    /// The programs that bring the device back.
    pub fn hooks(&self) -> Hooks {
        let hook = |of: fn(&DutFile) -> Option<&At<String>>| {
            let said = |file: &Self| {
                let command = of(&file.said)?.value.clone();
                Some(Program { command, folder: file.folder.clone() })
            };
            let program: Arc<dyn Hook> = Arc::new(self.files().find_map(said)?);
            Some(program)
        };
        Hooks { reset: hook(|said| said.reset.as_ref()), power: hook(|said| said.power.as_ref()) }
    }

    /// The protection of a device with this data sheet: what this file protects, and the one that
    /// names it among others.
    pub fn protection(&self, eds: &Eds, generic_io: bool) -> Protection {
        let mut protection = Protection::default();
        self.files().for_each(|file| file.protect(&mut protection, eds));
        if let Some(by) = self.outputs_stay() {
            protection.protect_outputs(eds, generic_io, &by.into());
        }
        protection
    }

    /// What keeps outputs from being driven, unless they may be.
    fn outputs_stay(&self) -> Option<String> {
        let outputs = |file: &Self| {
            let At { value, place } = file.said.allow.outputs.clone()?;
            Some((value, format!("`outputs: {value}` in {}:{}", file.source.name, place.line)))
        };
        let said: Vec<_> = self.files().filter_map(outputs).collect();
        let forbidden = said.iter().find(|(may, _)| !may).map(|(_, by)| by.clone());
        let unsaid = || {
            let name = &self.source.name;
            said.is_empty()
                .then(|| format!("the absence of `allow: {{ outputs: true }}` in {name}"))
        };
        forbidden.or_else(unsaid)
    }

    /// Adds what this file alone protects.
    fn protect(&self, protection: &mut Protection, eds: &Eds) {
        let (protect, name) = (&self.said.protect, &self.source.name);
        let by = |what: String, place: Place| format!("`{what}` in {name}:{}", place.line);
        for At { value: ObjectRange { text, objects }, place } in &protect.objects {
            protection.protect(objects.clone(), by(format!("objects: {text}"), *place));
        }
        if let Some(At { place, .. }) = protect.domains.as_ref().filter(|domains| domains.value) {
            protection.protect_domains(eds, &by("domains: true".to_owned(), *place).into());
        }
        let changed_by_loads =
            !protect.objects.is_empty() || protect.domains.as_ref().is_some_and(|all| all.value);
        for (index, key, budget) in
            [(0x1010, "stores", &protect.stores), (0x1011, "loads", &protect.loads)]
        {
            match budget {
                Some(At { value, place }) => {
                    protection.limit(index, *value, by(format!("{key}: {value}"), *place));
                }
                None if index == 0x1011 && changed_by_loads => {
                    let by = format!("the absence of `loads` beside protected objects in {name}");
                    protection.limit(index, 0, by);
                }
                None => {}
            }
        }
        for At { value, place } in &protect.lss {
            let (deed, word) = value.meant();
            protection.forbid(deed, by(format!("lss: {word}"), *place));
        }
        for At { value, place } in &protect.nmt {
            let (deed, word) = value.meant();
            protection.forbid(deed, by(format!("nmt: {word}"), *place));
        }
    }

    /// The protected objects that the data sheet does not have, which may be a slip.
    pub fn absent_objects(&self, eds: &Eds) -> Vec<Complaint> {
        let objects = self
            .said
            .protect
            .objects
            .iter()
            .filter(|range| !eds.entries().any(|entry| range.value.objects.contain(entry.mux)));
        let indices: Vec<String> =
            eds.objects.iter().map(|object| format!("{:04X}", object.index)).collect();
        let complain = |range: &At<ObjectRange>| {
            let text = &range.value.text;
            let meant = did_you_mean(text, indices.iter().map(String::as_str));
            let message = format!("the data sheet has no object {text}{meant}");
            Complaint::at(&self.source, range.place, message)
        };
        objects.map(complain).collect()
    }
}

impl LssWord {
    const fn meant(self) -> (Deed, &'static str) {
        match self {
            Self::Global => (Deed::AllSlaves, "global"),
            Self::BitTiming => (Deed::BitTiming, "bit-timing"),
            Self::NodeId => (Deed::NodeId, "node-id"),
            Self::Store => (Deed::StoreLss, "store"),
        }
    }
}

impl NmtWord {
    const fn meant(self) -> (Deed, &'static str) {
        match self {
            Self::ResetNode => (Deed::ResetNode, "reset-node"),
            Self::ResetCommunication => (Deed::ResetCommunication, "reset-communication"),
            Self::AllNodes => (Deed::AllNodes, "all-nodes"),
        }
    }
}

impl DutFile {
    fn wrong(&self, source: &Arc<Source>) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        let mut complain = |place, message: String| {
            complaints.push(Complaint::at(source, place, message));
        };
        if let Some(At { value: 0 | 128.., place }) = self.node {
            complain(place, "a node id is 1 to 127".to_owned());
        }
        match self.bit_rate {
            Some(At { value: rate @ 1..=1000, place }) => {
                complain(place, format!("the bit rate is in bit/s: write {rate}000"));
            }
            Some(At { value: 0 | 1_000_001.., place }) => {
                complain(place, "a bit rate is at most 1000000 bit/s".to_owned());
            }
            _ => {}
        }
        if let Some(At { value: 0 | 101.., place }) = self.patience {
            complain(place, "the patience is 1 to 100".to_owned());
        }
        complaints
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_written_in_three_ways() {
        let contains =
            |text: &str, mux: &str| parse_objects(text).unwrap().contain(mux.parse().unwrap());
        assert!(contains("2000", "2000:07"));
        assert!(contains("2000:07", "2000:07"));
        assert!(!contains("2000:07", "2000:08"));
        assert!(contains("2000..20FF", "20FF:01"));
        assert!(!contains("2000..20FF", "2100:00"));
        for wrong in ["", "200", "2000:1", "20FF..2000", "2000..", "0x2000", "2000h", "+200"] {
            assert_eq!(parse_objects(wrong), None, "{wrong}");
        }
    }
}
