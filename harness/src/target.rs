//! Targets: what the user names, and the device and bus behind it.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use canopen::eds::{Eds, Severity};
use canopen::{Bench, Bus, Device, VirtualBus, catalogue};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::mutant;
use reference_devices::rules::Specification;

use crate::bus::socketcan::SocketCan;
use crate::cli::{DEFAULT_BIT_RATE, Selection};
use crate::compose;
use crate::exit::{Exit, Refused};
use crate::nearest::did_you_mean;
use crate::plan::Dut;
use crate::rig::{Rig, WithRig};
use crate::scan::{self, Found};
use crate::sheet::Sheet;

/// A device under test and the bus it is on.
pub struct Target {
    /// The device.
    pub dut: Dut,
    /// How to get at it.
    pub place: Place,
    /// The bench around it, when it is not simulated.
    pub rig: Option<Arc<Mutex<Rig>>>,
    /// The options that name it again on a command line.
    pub options: String,
}

/// Where a device is.
pub enum Place {
    /// In this process.
    Simulation {
        /// The reference device.
        device: Arc<ReferenceDevice>,
        /// Its deviation.
        mutant: Option<Box<mutant::Mutant>>,
        /// Bit rate of the virtual bus, in bit/s.
        bit_rate: u32,
    },
    /// On this interface.
    SocketCan(String),
}

impl Target {
    /// Opens the bus. A simulated device is switched on at that moment.
    ///
    /// # Errors
    /// When the interface cannot be used, or the mutant cannot be built.
    pub fn open(&self, stop: &Arc<AtomicBool>) -> Result<Box<dyn Bus>, Refused> {
        let bus: Box<dyn Bus> = match &self.place {
            Place::Simulation { device, mutant, bit_rate } => {
                let mut bus = VirtualBus::new(*bit_rate);
                match mutant {
                    None => bus.attach(device.node(self.dut.node, Box::new(Specification))),
                    Some(mutant) => {
                        let built = mutant::build(device, self.dut.node, mutant);
                        bus.attach(built.map_err(Refused::usage)?)
                    }
                };
                Box::new(bus)
            }
            Place::SocketCan(name) => open_interface(name, stop)?,
        };
        Ok(match &self.rig {
            Some(rig) => Box::new(WithRig { bus, rig: Arc::clone(rig) }),
            None => bus,
        })
    }
}

/// Opens a SocketCAN interface.
///
/// # Errors
/// What stands in the way, and what to do about it.
pub fn open_interface(name: &str, stop: &Arc<AtomicBool>) -> Result<Box<dyn Bus>, Refused> {
    let bus = SocketCan::open(name, Arc::clone(stop));
    bus.map(|bus| Box::new(bus) as Box<dyn Bus>).map_err(|error| Refused::bus(error.to_string()))
}

/// The devices a selection means.
///
/// # Errors
/// When the target is not one we know, nobody answers, or no data sheet fits.
pub fn resolve(selection: &Selection, stop: &Arc<AtomicBool>) -> Result<Vec<Target>, Refused> {
    known_options(&selection.without)?;
    match selection.target.as_deref() {
        None => devices::names()
            .filter(|name| selection.device.as_ref().is_none_or(|device| device == name))
            .map(|name| simulation(selection, name, None))
            .collect::<Result<Vec<_>, _>>()
            .and_then(|targets| match targets.is_empty() {
                true => Err(unknown_device(selection.device.as_deref().unwrap_or_default())),
                false => Ok(targets),
            }),
        Some(text) => match text.strip_prefix("sim:") {
            Some(text) => match text.split_once("?mutant=") {
                Some((name, mutant)) => Ok(vec![simulation(selection, name, Some(mutant))?]),
                None => Ok(vec![simulation(selection, text, None)?]),
            },
            None if is_interface_name(text) => on_interface(selection, text, stop),
            None => Err(Refused::usage(format!(
                "unknown target `{text}`: write `vcan0`, `can0`, `sim:drr460` or \
                 `sim:drr460?mutant=NAME`"
            ))),
        },
    }
}

/// Checks that there are options of these names.
fn known_options(names: &[String]) -> Result<(), Refused> {
    let known = || catalogue::profiles().iter().flat_map(|profile| profile.options.keys());
    match names.iter().find(|name| !known().any(|option| option == *name)) {
        None => Ok(()),
        Some(name) => {
            let there_is = known().cloned().collect::<Vec<_>>().join(", ");
            let meant = did_you_mean(name, known().map(String::as_str));
            let message = format!("no option `{name}` of any profile: there is {there_is}{meant}");
            Err(Refused::usage(message))
        }
    }
}

/// The in-tree device of that name.
///
/// # Errors
/// When there is none.
pub fn reference_device(name: &str) -> Result<Arc<ReferenceDevice>, Refused> {
    devices::device(name).map(Arc::new).ok_or_else(|| unknown_device(name))
}

/// The mutant of that name.
///
/// # Errors
/// When the device has none.
pub fn mutant_of(device: &ReferenceDevice, name: &str) -> Result<mutant::Mutant, Refused> {
    let mutants = mutant::of(device).map_err(|message| Refused { exit: Exit::File, message })?;
    mutants.into_iter().find(|mutant| mutant.name == name).ok_or_else(|| {
        Refused::usage(format!("no mutant `{name}`: `harness qualify -v` names all of them"))
    })
}

/// The data sheets of the reference devices of the same vendor and product, by the names by which
/// suites ask for them.
pub fn models(eds: &Eds) -> BTreeMap<String, Eds> {
    let same = |model: &Eds| {
        let (ours, theirs) = (&model.device, &eds.device);
        (ours.vendor_number, ours.product_number) == (theirs.vendor_number, theirs.product_number)
    };
    devices::names()
        .filter_map(|name| Some((name.to_owned(), devices::device(name)?.description.eds)))
        .filter(|(_, model)| same(model))
        .collect()
}

/// Reads a data sheet; says so when it has errors, and goes on with what is left.
///
/// # Errors
/// When it cannot be read at all.
pub fn read_eds(path: &Path) -> Result<(Sheet, Eds), Refused> {
    let bytes = fs::read(path).map_err(|error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {error}", path.display()),
    })?;
    let (sheet, eds) = Sheet::read(path.display().to_string(), &bytes);
    if sheet.diagnostics.iter().any(|found| found.severity == Severity::Error) {
        let path = path.display();
        eprintln!("warning: {path} has errors, which `harness eds check {path}` shows");
    }
    if eds.objects.is_empty() {
        let message = format!("error: {}: there is no object in this data sheet", path.display());
        return Err(Refused { exit: Exit::File, message });
    }
    Ok((sheet, eds))
}

/// The data sheet of a reference device, by its place in the project.
fn own_sheet(
    device: &ReferenceDevice,
    mutant: Option<&mutant::Mutant>,
) -> Result<(Sheet, Eds), Refused> {
    let text = match mutant {
        Some(mutant) => mutant.data_sheet(device).map_err(Refused::usage)?,
        None => device.eds_text(),
    };
    let (folder, file) = device.description.place();
    let name = format!("reference-devices/{folder}/{file}.eds");
    let (mut sheet, eds) = Sheet::read(name, text.as_bytes());
    sheet.trusted = !mutant.is_some_and(mutant::Mutant::is_of_data_sheet);
    Ok((sheet, eds))
}

fn simulation(selection: &Selection, name: &str, mutant: Option<&str>) -> Result<Target, Refused> {
    let bit_rate = selection.bitrate;
    let mut device = reference_device(name)?;
    Arc::make_mut(&mut device).description.settings.bit_rate = bit_rate;
    let mutant = match mutant {
        Some(mutant) => Some(Box::new(mutant_of(&device, mutant)?)),
        None => None,
    };
    // The harness knows a reference device as it knows any: by its data sheet.
    let (sheet, eds) = match &selection.eds {
        Some(path) => read_eds(path)?,
        None => own_sheet(&device, mutant.as_deref())?,
    };
    let node = selection.node.unwrap_or_else(|| device.description.default_node);
    let mut options = match &mutant {
        None => format!("--target sim:{name}"),
        Some(mutant) => format!("--target 'sim:{name}?mutant={}'", mutant.name),
    };
    if let Some(node) = selection.node {
        options.push_str(&format!(" --node {node}"));
    }
    say_the_rest(selection, &mut options);
    let (rig, bench) = match rig(selection, &mut options)? {
        Some((rig, names)) => (Some(rig), names),
        None => (None, device.node(node, Box::new(Specification)).bench_names()),
    };
    let without = without(selection, Some(&device));
    let mut target = Target {
        dut: Dut {
            name: name.to_owned(),
            node,
            eds: Arc::new(eds),
            sheet: Arc::new(sheet),
            bench,
            bit_rate,
            without,
            told: None,
        },
        rig,
        place: Place::Simulation { device, mutant, bit_rate },
        options,
    };
    if selection.eds.is_some() {
        // A data sheet of ours tells the profile; any other may leave it to the device.
        let found = scan::scan(&mut *target.open(&Arc::default())?, Some(node))?;
        target.dut.told = found.first().and_then(Found::recognised);
    }
    Ok(target)
}

/// The options that the device does not have: those the user says, and those that a device of ours
/// says of itself.
fn without(selection: &Selection, device: Option<&ReferenceDevice>) -> Vec<String> {
    let mut without = device.map_or_else(Vec::new, |device| device.description.without.clone());
    for option in &selection.without {
        if !without.contains(option) {
            without.push(option.clone());
        }
    }
    without
}

/// Adds what else a verdict depends on to the options that repeat a run.
fn say_the_rest(selection: &Selection, options: &mut String) {
    if let Some(path) = &selection.eds {
        options.push_str(&format!(" --eds {}", path.display()));
    }
    if selection.bitrate != DEFAULT_BIT_RATE {
        options.push_str(&format!(" --bitrate {}", selection.bitrate));
    }
    for option in &selection.without {
        options.push_str(&format!(" --without {option}"));
    }
}

fn on_interface(
    selection: &Selection,
    name: &str,
    stop: &Arc<AtomicBool>,
) -> Result<Vec<Target>, Refused> {
    let mut bus = open_interface(name, stop)?;
    let found = only(scan::scan(&mut *bus, selection.node)?, name, selection.node)?;
    let (dut_name, (sheet, eds)) = data_sheet(selection, &found, &mut *bus)?;
    let mut options = format!("--target {name} --node {}", found.node);
    say_the_rest(selection, &mut options);
    let own = selection.device.as_ref().or(found.device.as_ref());
    let own = own.and_then(|name| reference_device(name).ok());
    let (rig, bench) = rig(selection, &mut options)?.unzip();
    let bench = bench.unwrap_or_default();
    Ok(vec![Target {
        dut: Dut {
            name: dut_name,
            node: found.node,
            eds: Arc::new(eds),
            sheet: Arc::new(sheet),
            bench,
            bit_rate: selection.bitrate,
            without: without(selection, own.as_deref()),
            told: found.recognised(),
        },
        rig,
        place: Place::SocketCan(name.to_owned()),
        options,
    }])
}

/// The node that was found on a bus, when it is the only one.
///
/// # Errors
/// When there is none, or another one, too.
pub fn only(mut found: Vec<Found>, name: &str, node: Option<u8>) -> Result<Found, Refused> {
    if found.len() > 1 {
        let nodes: Vec<String> = found.iter().map(|found| found.node.to_string()).collect();
        return Err(Refused::usage(format!(
            "nodes {} answer on {name}: choose one with --node",
            nodes.join(", ")
        )));
    }
    found.pop().ok_or_else(|| nobody(name, node))
}

/// A bench of the user's, and what it offers.
type OwnBench = (Arc<Mutex<Rig>>, Vec<String>);

/// The bench the user names.
fn rig(selection: &Selection, options: &mut String) -> Result<Option<OwnBench>, Refused> {
    let Some(text) = &selection.bench else { return Ok(None) };
    options.push_str(&format!(" --bench {text}"));
    let opened = Rig::open(text).and_then(|mut rig| Ok((rig.names()?, rig)));
    let (names, rig) = opened.map_err(|error| Refused::bus(error.to_string()))?;
    Ok(Some((Arc::new(Mutex::new(rig)), names)))
}

/// The data sheet of a device on a bus: the user's, or one of ours that fits, or what the device
/// answers.
fn data_sheet(
    selection: &Selection,
    found: &Found,
    bus: &mut dyn Bus,
) -> Result<(String, (Sheet, Eds)), Refused> {
    if let Some(path) = &selection.eds {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = selection.device.clone().or(stem).unwrap_or_else(|| "device".to_owned());
        return Ok((name, read_eds(path)?));
    }
    let name = match &selection.device {
        Some(name) => Some(name.clone()),
        None => found.device.clone(),
    };
    match name {
        Some(name) => {
            let device = reference_device(&name)?;
            let sheet = own_sheet(&device, None)?;
            Ok((name, sheet))
        }
        None => {
            let what = found.follows().map(|follows| format!(", {follows},")).unwrap_or_default();
            let node = found.node;
            eprintln!(
                "note: there is no data sheet of node {node}{what} in this program. One is \
                 composed of what the device answers; --eds FILE names a better one."
            );
            let name = found.name.clone().filter(|name| !name.trim().is_empty());
            let composed = compose::compose(bus, found, selection.bitrate)?;
            Ok((name.unwrap_or_else(|| format!("node-{node}")), composed))
        }
    }
}

/// The sentence for a bus on which nobody, or not `node`, answers.
pub fn nobody(interface: &str, node: Option<u8>) -> Refused {
    let who = node
        .map_or_else(|| "nobody answers".to_owned(), |node| format!("node {node} does not answer"));
    Refused::bus(format!(
        "{who} on {interface}. These two show what is there and put a device on it:\n  \
         candump -e {interface},0:0,#FFFFFFFF\n  \
         harness serve drr460 --target {interface}"
    ))
}

fn unknown_device(name: &str) -> Refused {
    let names: Vec<&str> = devices::names().collect();
    Refused::usage(format!("no reference device `{name}`: there is {}", names.join(", ")))
}

/// Linux allows anything without blanks and slashes; what has a colon is meant for another backend.
fn is_interface_name(text: &str) -> bool {
    !text.is_empty()
        && text.len() < 16
        && !text.contains(|c: char| c == '/' || c == ':' || c.is_whitespace())
}
