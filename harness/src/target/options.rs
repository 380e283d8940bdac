//! Options of the command line that a verdict depends on.

use std::sync::Arc;

use canopen::catalogue::Catalogue;
use reference_devices::devices::ReferenceDevice;
use runner::dut::Dut;
use runner::protect::{Deed, Protection, Wire};

use super::Selection;
use super::several::Other;
use crate::exit::Refused;
use crate::nearest::did_you_mean;
use crate::rig::{OwnBench, Rigs};

/// Checks that there are options of these names.
pub(super) fn known(names: &[String], catalogue: &Catalogue) -> Result<(), Refused> {
    let known = || catalogue.profiles().iter().flat_map(|profile| profile.options.keys());
    match names.iter().find(|name| !known().any(|option| option == *name)) {
        None => Ok(()),
        Some(name) => {
            let there_is = known().cloned().collect::<Vec<_>>().join(", ");
            let meant = did_you_mean(name, known().map(String::as_str));
            let message = format!("no option `{name}` of any profile: there are {there_is}{meant}");
            Err(Refused::usage(message))
        }
    }
}

/// The options that the device does not have: those the user says, and those that a device of ours
/// says of itself.
pub(super) fn without(selection: &Selection, device: Option<&ReferenceDevice>) -> Vec<String> {
    let mut without = device.map_or_else(Vec::new, |device| device.description.without.clone());
    for option in &selection.without {
        if !without.contains(option) {
            without.push(option.clone());
        }
    }
    without
}

/// Lets the objects that the user names be written with any data.
///
/// # Errors
/// When the data sheet does not have one of them.
pub(super) fn free_to_write(selection: &Selection, dut: &mut Dut) -> Result<(), Refused> {
    for index in &selection.free_to_write {
        let eds = Arc::make_mut(&mut dut.eds);
        let object = eds.objects.iter_mut().find(|object| object.index == *index);
        let Some(object) = object else {
            return Err(Refused::usage(format!("{} has no object {index:04X}h", dut.name)));
        };
        object.flags = Some(object.flags.unwrap_or_default() & !1);
    }
    Ok(())
}

/// Protects the device as its file says, and from another bit rate where the bit rate of the bus
/// could not be set back.
pub(crate) fn protect(selection: &Selection, dut: &mut Dut) {
    const GENERIC_IO: u16 = 401;
    dut.wire = Arc::new(Wire::of(&dut.eds));
    let mut protection = Protection::default();
    if let Some(file) = &selection.file {
        let generic_io = dut.profile_number() == Some(GENERIC_IO);
        protection = file.protection(&dut.eds, generic_io);
        dut.hooks = file.hooks();
        for complaint in file.absent_objects(&dut.eds) {
            complain!("{}\n", complaint.to_string().replacen("error", "warning", 1));
        }
    }
    if let Some(why) = dut.unlisted_bit_rate() {
        protection.forbid(Deed::BitTiming, format!("its bit rate ({why})"));
    }
    let beside = || selection.others.iter().filter(|other| other.shares_the_bus);
    for other in beside() {
        dut.other_nodes.push(other.known.clone());
        spare(&mut protection, other);
    }
    let may_change = |other: &&Other| other.keeps_heartbeat.is_none();
    if let Some(partner) = beside().find(may_change).or_else(|| beside().next()) {
        dut.partner = Some(partner.known.clone());
        if let Some(why) = &partner.keeps_heartbeat {
            protection.forbid(Deed::Partner, format!("{why}, for {}", partner.known));
        }
    }
    dut.protection = Arc::new(protection);
}

/// Keeps from another device on the same bus what is meant for the one under test.
fn spare(protection: &mut Protection, other: &Other) {
    let Other { known, place, keeps_from_all, .. } = other;
    if let Some(why) = keeps_from_all {
        // What every node misses may be the heartbeat that it monitors.
        for deed in [Deed::AllNodes, Deed::Partner] {
            protection.forbid(deed, format!("{why}, for {known} on the same bus"));
        }
    }
    for deed in [Deed::AllSlaves, Deed::NodeId, Deed::BitTiming] {
        protection.forbid(deed, format!("{known} on the same bus, in {place}"));
    }
}

/// The bench the user names.
pub(super) fn rig(
    selection: &Selection,
    options: &mut String,
) -> Result<Option<OwnBench>, Refused> {
    let Some(text) = &selection.bench else { return Ok(None) };
    let quote = if text.contains(' ') { "'" } else { "" };
    options.push_str(&format!(" --bench {quote}{text}{quote}"));
    // Without a device file, each simulated device has a bench of its own.
    let rigs = if selection.others.is_empty() { &Rigs::default() } else { &selection.rigs };
    rigs.open(text).map(Some).map_err(|error| Refused::bus(error.to_string()))
}
