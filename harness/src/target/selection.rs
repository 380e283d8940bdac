//! What a user says about a device: with options, and in a device file where no option beats it.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::several::Other;
use crate::argument::whole;
use crate::bus::load::MOST as MOST_LOAD;
use crate::device_file::DeviceFile;
use crate::folders::Folders;
use crate::plugged::Plugged;
use crate::rig::Rigs;

/// Bit rate of the virtual bus, and of one that nobody knows, unless something else is said, in
/// bit/s.
pub const DEFAULT_BIT_RATE: u32 = 1_000_000;

/// What to run, against what.
#[derive(Debug, Clone, Args)]
pub struct Selection {
    /// Suites and cases: names or globs, such as `cia301/nmt` or `'*/heartbeat-*'`
    #[arg(value_name = "SUITE|CASE")]
    pub patterns: Vec<String>,
    /// Device file: target, data sheet, suites, and what must not be done to the device; the other
    /// options beat it
    #[arg(long, value_name = "FILE")]
    pub dut: Option<PathBuf>,
    /// `vcan0`, `can0`, `sim:drr460`, `sim:drr460?mutant=NAME`, or `sim:PATH` for a device that is
    /// described in a folder; `slcan:/dev/ttyACM0` or `slcan:tcp://HOST:PORT` for an adapter with
    /// Lawicel's protocol, `gs_usb:` or `gs_usb:SERIAL` for one with that protocol (candleLight),
    /// `python-can:INTERFACE:CHANNEL` for one that python-can drives, `socketcand://HOST/can0` for
    /// an interface of another machine; `exec:COMMAND` for a program that is the device and speaks
    /// lines of candump on its standard input and output, `exec@vcan0:COMMAND` for one on an
    /// interface; every reference device when absent
    #[arg(long)]
    pub target: Option<String>,
    /// Node id of the device; a bus is scanned when absent
    #[arg(long, value_parser = whole::<u8>(1..=127))]
    pub node: Option<u8>,
    /// Data sheet of the device; without it, one in this program that matches its identity
    #[arg(long, value_name = "FILE")]
    pub eds: Option<PathBuf>,
    /// What is plugged into it.
    #[command(flatten)]
    pub modules: Plugged,
    /// Name of the device in reports and for the `device` key of suites
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub folders: Folders,
    /// Bit rate of the bus in bit/s, on which the tolerances of times depend, and which an adapter
    /// is set to; that of the interface when absent
    #[arg(long, value_name = "BITS")]
    #[arg(value_parser = whole::<u32>(1..=1_000_000))]
    pub bitrate: Option<u32>,
    /// Load the bus beside the test by so many percent of its time, on an interface of Linux: with
    /// frames of 7F3h, which no device listens to
    #[arg(long, value_name = "PERCENT", value_parser = whole::<u8>(1..=MOST_LOAD))]
    pub load: Option<u8>,
    /// The bench around the device: `unix:PATH`, or a program with its arguments that answers lines
    /// of JSON
    #[arg(long, value_name = "RIG")]
    pub bench: Option<String>,
    /// Option of the profile that the device does not have, such as `suction`; may be repeated
    #[arg(long, value_name = "OPTION")]
    pub without: Vec<String>,
    /// Object, such as `2F20`, that may be written with any data although the data sheet does not
    /// say so by `ObjFlags=0`; may be repeated
    #[arg(long, value_name = "INDEX", value_parser = hex_index)]
    pub free_to_write: Vec<u16>,
    /// What was read from `dut`.
    #[arg(skip)]
    pub(crate) file: Option<Arc<DeviceFile>>,
    /// The options that name the same again, beside a device file.
    #[arg(skip)]
    pub(crate) typed: Option<String>,
    /// The other devices of the device file.
    #[arg(skip)]
    pub(crate) others: Vec<Other>,
    /// The benches that are open, which devices of one file share.
    #[arg(skip)]
    pub(crate) rigs: Rigs,
}

impl Selection {
    /// Everything that can run against `target`, as if nothing else had been said.
    pub fn of_target(target: Option<&str>) -> Self {
        Self {
            patterns: Vec::new(),
            dut: None,
            target: target.map(str::to_owned),
            node: None,
            eds: None,
            modules: Plugged::default(),
            device: None,
            folders: Folders::default(),
            bitrate: None,
            load: None,
            bench: None,
            without: Vec::new(),
            free_to_write: Vec::new(),
            file: None,
            typed: None,
            others: Vec::new(),
            rigs: Rigs::default(),
        }
    }

    /// Adds what else a verdict depends on to the options that repeat a run.
    pub(crate) fn say_the_rest(&self, options: &mut String) {
        if let Some(path) = &self.eds {
            options.push_str(&format!(" --eds {}", path.display()));
        }
        options.push_str(&self.modules.option());
        if let (Some(_), Some(name)) = (&self.target, &self.device) {
            options.push_str(&format!(" --device {name}"));
        }
        if let Some(bit_rate) = self.bitrate {
            options.push_str(&format!(" --bitrate {bit_rate}"));
        }
        if let Some(load) = self.load {
            options.push_str(&format!(" --load {load}"));
        }
        for option in &self.without {
            options.push_str(&format!(" --without {option}"));
        }
        for index in &self.free_to_write {
            options.push_str(&format!(" --free-to-write {index:04X}"));
        }
    }

    /// The options as they were typed, without patterns.
    pub(crate) fn typed(&self) -> String {
        let mut typed = Vec::new();
        typed.extend(self.dut.as_ref().map(|path| format!("--dut {}", path.display())));
        typed.extend(self.target.as_ref().map(|target| format!("--target '{target}'")));
        typed.extend(self.node.map(|node| format!("--node {node}")));
        typed.extend(self.bench.as_ref().map(|bench| format!("--bench '{bench}'")));
        // Beside a target it is said with the rest.
        let beside = self.device.iter().filter(|_| self.dut.is_some() && self.target.is_none());
        typed.extend(beside.map(|name| format!("--device {name}")));
        let mut typed = typed.join(" ");
        self.say_the_rest(&mut typed);
        typed + &self.folders.options()
    }

    /// The same with what a device file says where nothing was typed.
    pub(super) fn with(&self, file: Arc<DeviceFile>, typed: String) -> Self {
        let mut all = self.clone();
        file.files().for_each(|file| all.take(file));
        all.typed = Some(typed);
        all.file = Some(file);
        all
    }

    /// Names another device beside this one, for what is said of a run as a whole.
    pub(crate) fn join(&mut self, other: &Self) {
        let more = other.target.iter().filter(|more| self.targets().all(|known| known != *more));
        let targets: Vec<&str> = self.targets().chain(more.map(String::as_str)).collect();
        let target = (!targets.is_empty()).then(|| targets.join(BETWEEN));
        self.target = target;
        self.bench = self.bench.take().or_else(|| other.bench.clone());
        (self.device, self.node, self.eds) = (None, None, None);
        self.modules = Plugged::default();
    }

    /// The targets, of which there are several after [`join`](Self::join).
    pub(crate) fn targets(&self) -> impl Iterator<Item = &str> {
        self.target.iter().flat_map(|target| target.split(BETWEEN))
    }

    /// Takes from one file what is not said yet.
    fn take(&mut self, file: &DeviceFile) {
        let said = &file.said;
        self.target = self.target.take().or_else(|| file.target());
        self.node = self.node.or_else(|| said.node.as_ref().map(|node| node.value));
        let eds = || said.eds.as_ref().map(|path| file.path(&path.value));
        self.eds = self.eds.take().or_else(eds);
        if let Some(row) = said.modules.as_ref().filter(|_| !self.modules.is_said()) {
            self.modules = Plugged::in_file(&file.source, row);
        }
        self.device = self.device.take().or_else(|| said.device.clone());
        self.bitrate = self.bitrate.or_else(|| said.bit_rate.as_ref().map(|rate| rate.value));
        self.bench = self.bench.take().or_else(|| file.bench());
        if self.patterns.is_empty() {
            self.patterns = said.select.iter().map(|pattern| pattern.value.clone()).collect();
        }
        self.without.extend(said.without.iter().cloned());
        let free = said.free_to_write.iter().flat_map(|range| range.objects.indices.clone());
        self.free_to_write.extend(free);
        let folders = &mut self.folders;
        if folders.only.is_empty() {
            folders.only = said.only_suites.iter().map(|path| file.path(path)).collect();
        }
        let own = said.suites.iter().map(|path| file.path(path));
        folders.more = own.chain(folders.more.drain(..)).collect();
        let catalogue = said.catalogue.as_ref().map(|path| file.path(path));
        folders.catalogue.folder = folders.catalogue.folder.take().or(catalogue);
    }
}

/// What stands between targets.
const BETWEEN: &str = ", ";

/// An index as data sheets write it, in hexadecimal.
fn hex_index(text: &str) -> Result<u16, String> {
    let digits = text.trim_start_matches("0x");
    u16::from_str_radix(digits, 16).map_err(|_| "an index has up to four hex digits".to_owned())
}
