//! The undo log: the changes of a run on a real bus in a device, kept on disk in case the run is
//! killed. It is written before the first change of an object, of the node id or of the bit rate,
//! and removed when all of that is back; `harness restore` reads it.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf, is_separator};

use canopen::Mux;
use reports::Identity;
use runner::plan::parse_bytes;
use runner::run::{Address, KeepChanges, Snapshot, differs};
use serde::{Deserialize, Serialize};

use crate::files::{read_text, shown, words, write_synced};
use crate::system;

/// The device that the log is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Changes {
    /// The interface, as the user wrote it.
    pub target: String,
    /// The node id.
    pub node: u8,
    /// The name of the device in reports.
    pub device: String,
    /// The bit rate of the bus in bit/s, when it is known.
    pub bit_rate: Option<u32>,
    /// Whether the device has layer setting services, so that its node id may be gone.
    pub lss: bool,
    /// Whether the device must be protected from resets and layer setting services.
    pub protected: bool,
    /// The device file that says from what else.
    pub device_file: Option<PathBuf>,
    /// The data sheet of the user's.
    pub eds: Option<PathBuf>,
    /// The modules with which it was read, where the user named them.
    #[serde(default)]
    pub modules: Vec<u16>,
    /// The identity that the device reported.
    pub identity: Identity,
    /// The process that made the changes.
    pub process: u32,
    /// Whether the device may have stored them.
    pub stores: bool,
    /// The objects with their values from before, in hexadecimal.
    pub objects: BTreeMap<String, String>,
    /// What may have become of `node` and `bit_rate`.
    #[serde(default)]
    pub address: Address,
}

impl Changes {
    /// The objects with their values from before.
    ///
    /// # Errors
    /// What is not an address or a value.
    pub(crate) fn values(&self) -> Result<BTreeMap<Mux, Vec<u8>>, String> {
        let value = |(object, bytes): (&String, &String)| {
            let mux = object.parse().map_err(|_| format!("`{object}` is not an address"))?;
            let bytes = parse_bytes(bytes).ok_or_else(|| format!("`{bytes}` is not a value"))?;
            Ok((mux, bytes))
        };
        self.objects.iter().map(value).collect()
    }

    /// Whether they are about one device: on the same interface, and the same by what both say of
    /// themselves. A device that was left with another node id is known by its serial number.
    pub(crate) fn are_of_the_device_of(&self, other: &Self) -> bool {
        let serial = self.identity.serial.is_some() && other.identity.serial.is_some();
        let node = self.node == other.node || serial && self.address > Address::AsBefore;
        self.target == other.target && node && !differs(&self.identity, &other.identity)
    }

    /// What is changed, as a list.
    pub(crate) fn said(&self) -> String {
        let address = (self.address > Address::AsBefore).then_some("its node id and bit rate");
        let said: Vec<&str> = self.objects.keys().map(String::as_str).chain(address).collect();
        said.join(", ")
    }

    /// Whether the process is still there, so that it may set its changes back itself.
    pub(crate) fn is_running(&self) -> bool {
        system::is_running(self.process)
    }
}

/// The log of one session.
#[derive(Debug)]
pub(crate) struct UndoLog {
    folder: PathBuf,
    name: Option<String>,
    changes: Changes,
    written: bool,
}

impl UndoLog {
    /// A log that is not written yet.
    pub(crate) fn new(folder: PathBuf, changes: Changes) -> Self {
        Self { folder, name: None, changes, written: false }
    }

    fn remove(&mut self) -> Result<(), String> {
        let Some(name) = self.name_if_written() else { return Ok(()) };
        fs::remove_file(path(&self.folder, &name)).map_err(|error| self.failed(&error))?;
        self.written = false;
        Ok(())
    }

    /// Another run may have left one for the same device.
    fn free_name(&self) -> io::Result<String> {
        fs::create_dir_all(&self.folder)?;
        let Changes { target, node, process, .. } = &self.changes;
        // The target may be a path.
        let target = target.replace(|c: char| !c.is_alphanumeric(), "-");
        let first = format!("{target}-node{node}-{process}");
        let names = (2..).map(|count| format!("{first}-{count}"));
        let mut names = std::iter::once(first.clone()).chain(names);
        Ok(names.find(|name| !path(&self.folder, name).exists()).unwrap_or(first))
    }

    fn failed(&self, error: &io::Error) -> String {
        format!(
            "the undo log in {} cannot be written: {}; if this run is killed, `harness restore` \
             cannot set back what it changed",
            self.folder.display(),
            words(error)
        )
    }
}

impl KeepChanges for UndoLog {
    fn name_if_written(&self) -> Option<String> {
        self.name.clone().filter(|_| self.written)
    }

    /// Names the logs that other runs have left of this device.
    fn identify(&mut self, identity: Identity) {
        self.changes.identity = identity;
        for (name, left) in all(&self.folder) {
            if left.are_of_the_device_of(&self.changes) && !left.is_running() {
                complain!("note: {}", offer(&name, &left));
            }
        }
    }

    fn write(&mut self, left: &Snapshot) -> Result<(), String> {
        self.changes.objects =
            left.values.iter().map(|(mux, value)| (mux.to_string(), hex(value))).collect();
        (self.changes.stores, self.changes.address) = (left.stores, left.address);
        if left.is_as_before() {
            return self.remove();
        }
        let name = match &self.name {
            Some(name) => name.clone(),
            None => self.free_name().map_err(|error| self.failed(&error))?,
        };
        self.name = Some(name.clone());
        let path = path(&self.folder, &name);
        let text = serde_json::to_string_pretty(&self.changes).expect("only string keys") + "\n";
        let beside = path.with_extension("new");
        let written = write_synced(&beside, &text).and_then(|()| fs::rename(&beside, &path));
        written.map_err(|error| self.failed(&error))?;
        self.written = true;
        Ok(())
    }
}

/// A log that a killed run has left, and what can be done about it.
pub(crate) fn offer(name: &str, left: &Changes) -> String {
    format!(
        "a run that was killed may have left changed in node {}: {}; `harness restore {name}` sets \
         this back, and with `--forget` it only removes this note",
        left.node,
        left.said()
    )
}

/// Where the logs are: `harness/undo` where programs of this user keep their state.
///
/// # Errors
/// Why there are no logs.
pub(crate) fn folder() -> Result<PathBuf, String> {
    let state = system::state_folder();
    let folder = state.map(|state| state.join("harness").join("undo"));
    folder.map_err(|why| format!("undo logs have no place: {why}"))
}

/// The existing logs, by name.
pub(crate) fn all(folder: &Path) -> Vec<(String, Changes)> {
    let readable = |(name, log): (String, Result<Changes, String>)| Some((name, log.ok()?));
    each(folder).into_iter().filter_map(readable).collect()
}

/// The files of the folder, by name; of those that cannot be read, why.
pub(crate) fn each(folder: &Path) -> Vec<(String, Result<Changes, String>)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let name = |path: &Path| Some(path.file_name()?.to_str()?.strip_suffix(".json")?.to_owned());
    let names = entries.filter_map(|entry| name(&entry.path()));
    let log = |name: String| (name.clone(), read(folder, &name));
    let mut logs: Vec<_> = names.map(log).collect();
    logs.sort_by(|one, other| one.0.cmp(&other.0));
    logs
}

/// The log of that name, or at that path.
///
/// # Errors
/// Why it cannot be read.
pub(crate) fn read(folder: &Path, name: &str) -> Result<Changes, String> {
    let path = find(folder, name);
    let said = |why: String| format!("{}: {why}", shown(&path));
    let text = read_text(&path).map_err(|error| said(words(&error)))?;
    serde_json::from_str(&text).map_err(|_| said("this is not an undo log".to_owned()))
}

/// Removes the log of that name, or at that path.
///
/// # Errors
/// Why it cannot be removed.
pub(crate) fn remove(folder: &Path, name: &str) -> Result<(), String> {
    let path = find(folder, name);
    fs::remove_file(&path).map_err(|error| format!("{}: {}", path.display(), words(&error)))
}

fn find(folder: &Path, name: &str) -> PathBuf {
    match name.contains(is_separator) {
        true => PathBuf::from(name),
        false => path(folder, name),
    }
}

fn path(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{}.json", name.trim_end_matches(".json")))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes() -> Changes {
        Changes {
            target: "can0".to_owned(),
            node: 5,
            device: "mine".to_owned(),
            bit_rate: Some(500_000),
            lss: true,
            protected: false,
            device_file: None,
            eds: None,
            modules: Vec::new(),
            identity: Identity::default(),
            process: u32::MAX,
            stores: false,
            objects: BTreeMap::new(),
            address: Address::AsBefore,
        }
    }

    fn of(values: &BTreeMap<Mux, Vec<u8>>, stores: bool) -> Snapshot {
        Snapshot { values: values.clone(), stores, address: Address::AsBefore }
    }

    #[test]
    fn a_log_is_there_while_something_is_changed() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("undo");
        let mut log = UndoLog::new(folder.clone(), changes());
        let values: BTreeMap<Mux, Vec<u8>> =
            [(Mux::new(0x1017, 0), vec![0x64, 0]), (Mux::new(0x2000, 1), Vec::new())].into();
        assert!(all(&folder).is_empty());
        log.write(&of(&values, true)).unwrap();
        assert_eq!(log.name_if_written().as_deref(), Some("can0-node5-4294967295"));
        let left = all(&folder);
        assert_eq!(left.len(), 1);
        assert_eq!((left[0].1.values(), left[0].1.stores), (Ok(values.clone()), true));
        assert!(!left[0].1.is_running());

        let mut other = UndoLog::new(folder.clone(), changes());
        other.write(&of(&values, false)).unwrap();
        assert_eq!(other.name_if_written().as_deref(), Some("can0-node5-4294967295-2"));

        let target = "slcan:/dev/ttyACM0".to_owned();
        let mut path = UndoLog::new(folder.clone(), Changes { target, ..changes() });
        path.write(&of(&values, false)).unwrap();
        let name = path.name_if_written().unwrap();
        assert_eq!(name, "slcan--dev-ttyACM0-node5-4294967295");
        remove(&folder, &name).unwrap();

        log.write(&Snapshot::default()).unwrap();
        assert_eq!(log.name_if_written(), None);
        assert_eq!(all(&folder).len(), 1);
        remove(&folder, "can0-node5-4294967295-2").unwrap();
        assert!(all(&folder).is_empty());
    }

    #[test]
    fn a_node_id_is_logged_and_a_log_is_of_one_device() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("undo");
        let mut log = UndoLog::new(folder.clone(), changes());
        let identity = |serial| Identity { vendor: Some(1), serial, ..Identity::default() };
        log.identify(identity(Some(7)));
        log.write(&Snapshot { address: Address::Configured, ..Snapshot::default() }).unwrap();
        let left = all(&folder).remove(0).1;
        assert_eq!(left.said(), "its node id and bit rate");
        let of = |node, serial| {
            let other = Changes { node, identity: identity(serial), ..changes() };
            left.are_of_the_device_of(&other)
        };
        assert!(of(5, Some(7)) && of(5, None) && of(6, Some(7)));
        assert!(!of(5, Some(8)) && !of(6, None));
        assert!(!left.are_of_the_device_of(&Changes { target: "can1".to_owned(), ..left.clone() }));
        let objects = Changes { address: Address::AsBefore, ..left.clone() };
        assert!(!objects.are_of_the_device_of(&Changes { node: 6, ..left }));
    }

    #[test]
    fn a_log_that_cannot_be_written_or_read_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let no_folder = folder.path().join("file");
        fs::write(&no_folder, "").unwrap();
        let mut log = UndoLog::new(no_folder.join("undo"), changes());
        let why = log.write(&of(&BTreeMap::new(), true)).unwrap_err();
        // Systems do not agree on what is wrong with it.
        let said = why.split_once("undo cannot be written: ").is_some_and(|(_, why)| {
            why.starts_with("Not a directory;") || why.starts_with("File exists;")
        });
        assert!(said, "{why}");
        let none = read(folder.path(), "none").unwrap_err();
        assert!(none.ends_with("none.json: No such file or directory"), "{none}");
        fs::write(folder.path().join("odd.json"), "{}").unwrap();
        assert!(read(folder.path(), "odd").unwrap_err().ends_with("this is not an undo log"));
        assert!(all(folder.path()).is_empty());
        for (object, bytes) in [("1017", "00"), ("1017:00", "0"), ("1017:00", "0x")] {
            let objects = [(object.to_owned(), bytes.to_owned())].into();
            assert!(Changes { objects, ..changes() }.values().is_err(), "{object} {bytes}");
        }
    }
}
