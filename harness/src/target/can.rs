//! Devices on a CAN interface.

use std::sync::Arc;

use canopen::catalogue::Catalogue;
use runner::dut::Dut;
use runner::run::Traffic;
use runner::stop::Stop;

use super::connection::{Connection, Target, open_interface};
use super::lengths::value_lengths;
use super::options::{rig, without};
use super::reference::reference_device;
use super::scan::{Found, rounds, scan};
use super::sheet;
use super::sim::quoted;
use super::{DEFAULT_BIT_RATE, Selection};
use crate::bus::Interface;
use crate::bus::load::Load;
use crate::exit::Refused;

/// The device that answers on an interface.
///
/// # Errors
/// When none does, several do, or it has no data sheet.
pub(super) fn target(
    selection: &Selection,
    interface: &Interface,
    catalogue: &Catalogue,
    stop: &Stop,
) -> Result<Target, Refused> {
    let interface = &interface.clone().at_bit_rate(selection.bitrate);
    if selection.load.is_some() && interface.network().is_none() {
        return Err(no_load(&interface.to_string()));
    }
    let mut bus = open_interface(interface, stop)?;
    let bit_rate = selection.bitrate.or_else(|| interface.bit_rate(DEFAULT_BIT_RATE));
    let name = &interface.to_string();
    let found = scan(&mut *bus, selection.node, rounds(name), catalogue)?;
    if found.is_empty() {
        let load = Traffic::heard(&mut *bus, bit_rate);
        return Err(nobody_beside(load, name, selection.node));
    }
    let found = only(found, name, selection.node)?;
    let load = load(selection.load, bit_rate, name)?;
    // An adapter that echoes is recognised by its first frames.
    let times = bus.remark();
    let of_bus = times.into_iter().chain(load.as_ref().map(Load::wanted)).collect();
    let (dut_name, (sheet, eds)) = {
        let selection = Selection { bitrate: bit_rate, ..selection.clone() };
        sheet::of_found(&selection, &found, &mut *bus, catalogue)?
    };
    let mut options = format!("--target {} --node {}", quoted(name), found.node);
    selection.say_the_rest(&mut options);
    let own = selection.device.as_ref().or(found.device.as_ref());
    let own = own.and_then(|name| reference_device(name, catalogue).ok());
    let (rig, offer) = rig(selection, &mut options)?.unzip();
    let (bench, bench_needs) = offer.unwrap_or_default();
    let mut dut = Dut {
        sheet: Arc::new(sheet),
        bench,
        own_bench: selection.bench.is_some(),
        bench_needs,
        interface: interface.network().filter(|_| !interface.is_program()).map(str::to_owned),
        shares_its_bus: interface.is_shared(),
        shares_its_machine: interface.is_on_this_machine(),
        bit_rate,
        of_bus,
        without: without(selection, own.as_deref()),
        told: found.recognised(),
        ..Dut::new(dut_name, found.node, eds)
    };
    let lengths = value_lengths(&mut *bus, &dut);
    dut.lengths = lengths.map_err(|error| Refused::bus(error.to_string()))?;
    Ok(Target { dut, rig, connection: Connection::Interface(interface.clone()), load, options })
}

/// The load of a bus, which is a share of its bit rate.
///
/// # Errors
/// When nobody knows the bit rate: on a slower bus it would leave no room.
fn load(percent: Option<u8>, bit_rate: Option<u32>, name: &str) -> Result<Option<Load>, Refused> {
    match (percent, bit_rate) {
        (None, _) => Ok(None),
        (Some(percent), Some(bit_rate)) => Ok(Some(Load::new(percent, bit_rate))),
        (Some(_), None) => Err(Refused::usage(format!(
            "--load is a share of the bit rate, and that of {name} is not known: say it with \
             --bitrate"
        ))),
    }
}

/// The refusal of a load where there is no interface that several programs send on.
pub(super) fn no_load(target: &str) -> Refused {
    Refused::usage(format!(
        "--load needs a network interface of Linux, such as `can0` or `vcan0`, which two senders \
         can share: {target} is none"
    ))
}

/// The node that was found on a bus, when it is the only one.
///
/// # Errors
/// When there is none, or another one, too.
pub(crate) fn only(mut found: Vec<Found>, name: &str, node: Option<u8>) -> Result<Found, Refused> {
    if found.len() > 1 {
        let nodes: Vec<String> = found.iter().map(|found| found.node.to_string()).collect();
        return Err(Refused::usage(format!(
            "nodes {} answer on {name}: choose one with --node",
            nodes.join(", ")
        )));
    }
    found.pop().ok_or_else(|| nobody(name, node))
}

/// The sentence for a bus on which no node, or not `node`, answers.
pub(crate) fn nobody(interface: &str, node: Option<u8>) -> Refused {
    nobody_beside(None, interface, node)
}

/// The same, with what others take of the bus.
fn nobody_beside(load: Option<String>, interface: &str, node: Option<u8>) -> Refused {
    let who = node.map_or_else(
        || "no node answers".to_owned(),
        |node| format!("node {node} does not answer"),
    );
    let parsed = interface.parse::<Interface>();
    let load = load.map(|load| format!(", where {load}")).unwrap_or_default();
    if parsed.as_ref().is_ok_and(|parsed| parsed.network().is_none() && !parsed.is_program()) {
        return Refused::bus(format!(
            "{who} on {interface}{load}. Does the device have power, is the bus terminated, and is \
             its bit rate that of the adapter (--bitrate)? This command shows the frames on it:\n  \
             harness monitor --target {interface}"
        ));
    }
    let Some(interface) = parsed.as_ref().map_or(Some(interface), Interface::network) else {
        return Refused::bus(format!(
            "{who} on {interface}. The program writes each frame that it sends as a line, such as \
             `(0.001000) can0 701#00`, and gets each frame as such a line"
        ));
    };
    Refused::bus(format!(
        "{who} on {interface}{load}. These commands show the frames on it and add a device:\n  \
         candump -e {interface},0:0,#FFFFFFFF\n  \
         harness serve drr460 --target {interface}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_without_a_known_bit_rate_is_not_loaded() {
        let refused = load(Some(60), None, "can0").unwrap_err();
        assert!(refused.message.contains("that of can0 is not known"), "{}", refused.message);
        assert!(load(Some(60), Some(125_000), "can0").unwrap().is_some());
        assert!(load(None, None, "can0").unwrap().is_none());
    }
}
