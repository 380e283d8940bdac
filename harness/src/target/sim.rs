//! Simulated devices: `sim:NAME`, and with a deviation `sim:NAME?mutant=NAME`, or the path of a
//! device for its name.

use std::sync::Arc;

use canopen::Device;
use canopen::catalogue::Catalogue;
use reference_devices::change::Deviation;
use reference_devices::partner::Partner;
use reference_devices::rules::Rules;
use runner::dut::{Dut, OtherNode};
use runner::stop::Stop;

use super::can::no_load;
use super::connection::{Connection, Target};
use super::lengths::value_lengths;
use super::options::{rig, without};
use super::reference::{Named, reference_device_at};
use super::scan::{Found, ROUNDS, scan};
use super::sheet::{own_sheet, read_eds};
use super::{DEFAULT_BIT_RATE, Selection};
use crate::exit::Refused;

/// The reference device of that name, with that deviation.
///
/// # Errors
/// When there is no such device or deviation, or the data sheet or the bench cannot be used.
pub(super) fn target(
    selection: &Selection,
    name: &str,
    deviation: Option<&Named>,
    catalogue: &Catalogue,
) -> Result<Target, Refused> {
    if selection.load.is_some() {
        return Err(no_load("a simulated device"));
    }
    let bit_rate = selection.bitrate.unwrap_or(DEFAULT_BIT_RATE);
    let device = reference_device_at(bit_rate, name, catalogue)?;
    let deviation = deviation.map(|named| named.find(&device)).transpose()?.map(Box::new);
    // The harness knows a reference device as it knows any: by its data sheet.
    let (sheet, eds) = match &selection.eds {
        Some(path) => read_eds(path, &selection.modules)?,
        None => own_sheet(&device, deviation.as_deref())?,
    };
    let node = selection.node.unwrap_or_else(|| device.description.default_node);
    if let Some(deviation) = &deviation {
        // A deviation that cannot be built is a mistake in its file. It is reported before anything
        // runs.
        deviation.build(&device, node)?;
    }
    let mut options = match &deviation {
        None => format!("--target {}", quoted(&format!("sim:{name}"))),
        Some(deviation) => {
            format!("--target {}", quoted(&format!("sim:{name}?{}", deviation.query)))
        }
    };
    if let Some(node) = selection.node {
        options.push_str(&format!(" --node {node}"));
    }
    selection.say_the_rest(&mut options);
    let (rig, (bench, bench_needs)) = match rig(selection, &mut options)? {
        Some((rig, offer)) => (Some(rig), offer),
        None => {
            let node = device.node(node, Rules::default());
            (None, (node.bench_names(), node.bench_needs()))
        }
    };
    let without = without(selection, Some(&device));
    let mut target = Target {
        dut: Dut {
            sheet: Arc::new(sheet),
            bench,
            own_bench: selection.bench.is_some(),
            bench_needs,
            interface: None,
            bit_rate: Some(bit_rate),
            without,
            partner: Some(simulated_partner(node)),
            ..Dut::new(own_name(selection).unwrap_or(&device.description.device), node, eds)
        },
        rig,
        connection: Connection::Simulation { device, deviation, bit_rate },
        load: None,
        options,
    };
    if selection.eds.is_some() {
        // A data sheet of ours names the profile; another one may leave it to the device.
        let mut bus = target.open(&Stop::default())?;
        let found = scan(&mut *bus, Some(node), ROUNDS, catalogue)?;
        target.dut.told = found.first().and_then(Found::recognised);
        let lengths = value_lengths(&mut *bus, &target.dut);
        target.dut.lengths = lengths.map_err(|error| Refused::bus(error.to_string()))?;
    }
    Ok(target)
}

impl Target {
    /// The same simulated device with a deviation, known by the data sheet that it comes with.
    ///
    /// # Errors
    /// When a change does not fit the device.
    pub(crate) fn deviating(&self, deviation: Deviation) -> Result<Self, Refused> {
        let Connection::Simulation { device, bit_rate, .. } = &self.connection else {
            unreachable!("only a simulated device has deviations")
        };
        let mut dut = self.dut.clone();
        if deviation.changes_data_sheet() {
            let (sheet, eds) = own_sheet(device, Some(&deviation))?;
            (dut.sheet, dut.eds) = (Arc::new(sheet), Arc::new(eds));
        }
        let connection = Connection::Simulation {
            device: Arc::clone(device),
            deviation: Some(Box::new(deviation)),
            bit_rate: *bit_rate,
        };
        Ok(Self { dut, connection, rig: None, load: None, options: String::new() })
    }
}

/// The node that is simulated beside the device.
fn simulated_partner(node: u8) -> OtherNode {
    OtherNode { name: "simulated partner".to_owned(), node: Partner::id_beside(node) }
}

/// The user's name for the device. Without a target, `--device` chooses a reference device.
fn own_name(selection: &Selection) -> Option<&str> {
    selection.target.as_ref().and(selection.device.as_deref())
}

/// A word quoted for a shell if it has other characters than letters, digits and `:/.-_`.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || ":/.-_".contains(c);
    match word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}
