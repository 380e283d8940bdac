//! `harness restore`: sets back the changes that a killed run left in a device.

use std::fmt::Write;
use std::sync::Arc;

use canopen::{BusError, eds};
use reference_devices::devices;
use runner::dut::Dut;
use runner::plan::show_bytes;
use runner::protect::Guarded;
use runner::run::{Abandoned, BroughtBack, Policy};
use runner::stop::Stop;

use super::counted::counted;
use crate::bus::Interface;
use crate::cli::RestoreArgs;
use crate::device_file::DeviceFile;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::{DEFAULT_BIT_RATE, Selection, dut_of_file, open_interface, protect};
use crate::undo_log::{self, Changes};

/// Sets back what the run changed; without a run, lists those that left something changed.
///
/// # Errors
/// When there is no such run, or the interface cannot be used.
pub(super) fn run(args: &RestoreArgs, stop: &Stop) -> Result<Exit, Refused> {
    let folder = undo_log::folder();
    let file_error = |why| Refused { exit: Exit::File, message: format!("error: {why}") };
    let Some(name) = &args.run else {
        let logs = undo_log::each(&folder);
        say(&list(&logs));
        return match logs.iter().all(|(_, log)| log.is_ok()) {
            true => Ok(Exit::Green),
            false => Err(file_error("a log cannot be read".to_owned())),
        };
    };
    let changes = undo_log::read(&folder, name).map_err(file_error)?;
    if changes.is_running() {
        let process = changes.process;
        return Err(Refused::usage(format!(
            "the run is still there, as process {process}: it sets its changes back itself"
        )));
    }
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
        may_reset: !changes.protected,
    };
    let policy = Policy::at_bit_rate(changes.bit_rate.unwrap_or(DEFAULT_BIT_RATE));
    let _held = stop.hold();
    let bus = open_interface(&interface, stop)?;
    let mut bus = Guarded::new(bus, Arc::clone(&dut.protection), (*dut.wire).clone());
    let node = changes.node;
    match abandoned.bring_back(&mut bus, &policy, stop) {
        Ok(BroughtBack::Lost(why)) => Err(Refused {
            exit: Exit::DeviceGone,
            message: format!("error: node {node} on {target} does not come back: {why}"),
        }),
        Ok(BroughtBack::Another) => Err(Refused {
            exit: Exit::Failed,
            message: format!(
                "error: node {node} on {target} is another device than the run changed, by 1000h \
                 and 1018h; nothing was written"
            ),
        }),
        Ok(BroughtBack::Except(left)) if left.is_empty() => {
            undo_log::remove(&folder, name).map_err(file_error)?;
            let mut text = String::new();
            for (mux, value) in &abandoned.values {
                _ = writeln!(text, "{mux} = {}", show_bytes(value));
            }
            let count = abandoned.values.len();
            _ = writeln!(text, "{} of node {node} on {target} set back", counted(count, "object"));
            say(&text);
            Ok(Exit::Green)
        }
        Ok(BroughtBack::Except(left)) => {
            let left: Vec<String> = left.iter().map(ToString::to_string).collect();
            let left = left.join(", ");
            let message =
                format!("error: node {node} on {target} refuses {left}, or does not answer");
            Err(Refused { exit: Exit::Failed, message })
        }
        Err(BusError::Interrupted) => Err(Refused::interrupted()),
        Err(error) => Err(Refused::bus(error.to_string())),
    }
}

/// The device, with what protected it from the run.
fn dut(changes: &Changes) -> Result<Dut, Refused> {
    let mut selection = Selection::of_target(None);
    selection.node = Some(changes.node);
    selection.bitrate = changes.bit_rate;
    if let Some(path) = &changes.device_file {
        selection.file = Some(Arc::new(DeviceFile::load(path)?));
    }
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
        let objects: Vec<&str> = changes.objects.keys().map(String::as_str).collect();
        let running = if changes.is_running() { " (still running)" } else { "" };
        let Changes { target, node, device, .. } = changes;
        format!("{name}  {device}, node {node} on {target}: {}{running}\n", objects.join(", "))
    };
    logs.iter().map(line).collect()
}
