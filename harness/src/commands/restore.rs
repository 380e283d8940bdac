//! `harness restore`: sets back the changes that a killed run left in a device.

use std::fmt::Write;
use std::sync::Arc;

use canopen::{BusError, eds};
use reference_devices::devices;
use runner::dut::Dut;
use runner::plan::show_bytes;
use runner::protect::Guarded;
use runner::run::{Abandoned, Address, BroughtBack, Policy};
use runner::stop::Stop;

use super::counted::counted;
use crate::bus::Interface;
use crate::cli::RestoreArgs;
use crate::exit::{Exit, Refused};
use crate::plugged::Plugged;
use crate::reporter::say;
use crate::target::{DEFAULT_BIT_RATE, Selection, dut_of_file, open_interface, protect};
use crate::undo_log::{self, Changes};

/// Sets back what the run changed; without a run, lists those that left something changed.
///
/// # Errors
/// When there is no such run, or the interface cannot be used.
pub(super) fn run(args: &RestoreArgs, stop: &Stop) -> Result<Exit, Refused> {
    let file_error = |why| Refused { exit: Exit::File, message: format!("error: {why}") };
    let folder = undo_log::folder().map_err(file_error)?;
    let Some(name) = &args.run else {
        let logs = undo_log::each(&folder);
        say(&list(&logs));
        return match logs.iter().all(|(_, log)| log.is_ok()) {
            true => Ok(Exit::Green),
            false => Err(file_error("a log cannot be read".to_owned())),
        };
    };
    let read = undo_log::read(&folder, name);
    if let Some(Changes { process, .. }) = read.as_ref().ok().filter(|left| left.is_running()) {
        return Err(Refused::usage(format!(
            "the run is still there, as process {process}: it sets its changes back itself"
        )));
    }
    // One that cannot be read as well.
    if args.forget {
        undo_log::remove(&folder, name).map_err(file_error)?;
        say(&format!("{name} is removed; nothing was sent to the device\n"));
        return Ok(Exit::Green);
    }
    let changes = read.map_err(file_error)?;
    let values = changes.values().map_err(file_error)?;
    let target = args.target.as_ref().unwrap_or(&changes.target);
    let interface: Interface =
        target.parse().map_err(|_| Refused::usage(format!("no interface is called `{target}`")))?;
    let dut = dut(&changes)?;
    let abandoned = Abandoned {
        dut: &dut,
        identity: changes.identity,
        values,
        stores: changes.stores,
        address: changes.address,
        may_reset: !changes.protected,
    };
    let policy = Policy::at_bit_rate(changes.bit_rate.unwrap_or(DEFAULT_BIT_RATE));
    let _held = stop.hold();
    let bus = open_interface(&interface, stop)?;
    let mut bus = Guarded::new(bus, Arc::clone(&dut.protection), (*dut.wire).clone());
    let back = match abandoned.bring_back(&mut bus, &policy, stop) {
        Ok(brought) => back(brought, &abandoned, &changes, target)?,
        Err(BusError::Interrupted) => return Err(Refused::interrupted()),
        Err(error) => return Err(Refused::bus(error.to_string())),
    };
    undo_log::remove(&folder, name).map_err(file_error)?;
    say(&back);
    Ok(Exit::Green)
}

/// What is back, in words.
///
/// # Errors
/// What is not.
fn back(
    brought: BroughtBack,
    abandoned: &Abandoned,
    changes: &Changes,
    target: &str,
) -> Result<String, Refused> {
    let node = changes.node;
    let gone = |what: &str| Refused {
        exit: Exit::DeviceGone,
        message: format!("error: node {node} on {target} {what}"),
    };
    match brought {
        BroughtBack::Lost(why) => {
            let rate = at_another_bit_rate(changes);
            Err(gone(&format!("does not come back: {why}{rate}")))
        }
        BroughtBack::Another => Err(Refused::bus(format!(
            "node {node} on {target} is another device than the run changed, by 1000h and 1018h; \
             no object was written. `harness restore --forget` with the name removes the log"
        ))),
        BroughtBack::Misaddressed => Err(gone(
            "answers, and does not confirm by LSS that it has its node id and bit rate; no object \
             was written",
        )),
        BroughtBack::Except(left) if left.is_empty() => {
            let mut text = String::new();
            for (mux, value) in &abandoned.values {
                _ = writeln!(text, "{mux} = {}", show_bytes(value));
            }
            let objects = counted(abandoned.values.len(), "object");
            let back = match (abandoned.values.len(), changes.address) {
                (_, Address::AsBefore) => objects,
                (0, _) => "node id".to_owned(),
                (_, _) => format!("{objects} and node id"),
            };
            _ = writeln!(text, "{back} of node {node} on {target} set back");
            Ok(text)
        }
        BroughtBack::Except(left) => {
            let left: Vec<String> = left.iter().map(ToString::to_string).collect();
            Err(gone(&format!("refuses {}, or does not answer", left.join(", "))))
        }
    }
}

/// What to try for a device that may have another bit rate, as the end of a sentence.
fn at_another_bit_rate(changes: &Changes) -> String {
    let rate = changes.bit_rate.map_or_else(String::new, |rate| format!(", not {rate} bit/s"));
    match changes.address {
        Address::AsBefore => String::new(),
        Address::Configured | Address::Stored => format!(
            ". It may have another bit rate{rate}: set the interface to that, and `harness \
             restore` again"
        ),
    }
}

/// The device, with what protected it from the run.
fn dut(changes: &Changes) -> Result<Dut, Refused> {
    let mut selection = Selection::of_target(None);
    selection.node = Some(changes.node);
    if changes.device_file.is_some() {
        selection.dut.clone_from(&changes.device_file);
        let mut each = selection.each("")?;
        let is_there = |one: &Selection| one.target.as_ref() == Some(&changes.target);
        let place = each.iter().position(is_there).unwrap_or_default();
        let found = each.swap_remove(place);
        selection.file = found.file;
        selection.others = found.others;
    }
    selection.bitrate = changes.bit_rate;
    selection.modules = Plugged::of(&changes.modules);
    let mut dut = match &changes.eds {
        Some(path) => dut_of_file(&selection, path)?,
        None => {
            // A device with a data sheet of ours is protected by it, too.
            let device = devices::device(&changes.device);
            let eds = device.map(|device| eds::read(device.eds_text().as_bytes()).eds);
            let mut dut = Dut::new(&changes.device, changes.node, eds.unwrap_or_default());
            dut.bit_rate = changes.bit_rate;
            protect(&selection, &mut dut);
            dut
        }
    };
    dut.name.clone_from(&changes.device);
    dut.shares_its_bus = true;
    Arc::make_mut(&mut dut.eds).device.lss = changes.lss;
    Ok(dut)
}

/// A line for each run that left something changed.
fn list(logs: &[(String, Result<Changes, String>)]) -> String {
    if logs.is_empty() {
        return "no run has left anything changed\n".to_owned();
    }
    let line = |(name, log): &(String, Result<Changes, String>)| {
        let changes = match log {
            Ok(changes) => changes,
            Err(why) => return format!("{name}  cannot be read: {why}\n"),
        };
        let running = if changes.is_running() { " (still running)" } else { "" };
        let Changes { target, node, device, .. } = changes;
        format!("{name}  {device}, node {node} on {target}: {}{running}\n", changes.said())
    };
    logs.iter().map(line).collect()
}
