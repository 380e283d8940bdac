//! `harness restore`: sets back what a run that was killed left changed in a device.

use std::fmt::Write;

use canopen::BusError;
use canopen::eds::Eds;

use super::counted::counted;
use crate::bus::Interface;
use crate::cli::{DEFAULT_BIT_RATE, RestoreArgs};
use crate::dut::Dut;
use crate::exit::{Exit, Refused};
use crate::plan::show_bytes;
use crate::reporter::say;
use crate::run::{Abandoned, BroughtBack, Policy};
use crate::stop::Stop;
use crate::target::open_interface;
use crate::undo_log::{self, Changes};

/// Sets back what the run changed; without a run, lists those that left something changed.
///
/// # Errors
/// When there is no such run, or the interface cannot be used.
pub(super) fn run(args: &RestoreArgs, stop: &Stop) -> Result<Exit, Refused> {
    let folder = undo_log::folder();
    let file_error = |why| Refused { exit: Exit::File, message: format!("error: {why}") };
    let Some(name) = &args.run else {
        say(&list(&undo_log::all(&folder)));
        return Ok(Exit::Green);
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
    let mut eds = Eds::default();
    eds.device.lss = changes.lss;
    let dut = Dut::new(&changes.device, changes.node, eds);
    let abandoned = Abandoned {
        dut: &dut,
        identity: changes.identity,
        values,
        stores: changes.stores,
        may_reset: !changes.protected,
    };
    let policy = Policy::at_bit_rate(changes.bit_rate.unwrap_or(DEFAULT_BIT_RATE));
    let _held = stop.hold();
    let mut bus = open_interface(&interface, stop)?;
    let node = changes.node;
    match abandoned.bring_back(&mut *bus, &policy, stop) {
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
            let message = format!("error: node {node} on {target} refuses {}", left.join(", "));
            Err(Refused { exit: Exit::Failed, message })
        }
        Err(BusError::Interrupted) => Err(Refused::interrupted()),
        Err(error) => Err(Refused::bus(error.to_string())),
    }
}

/// A line for each run that left something changed.
fn list(logs: &[(String, Changes)]) -> String {
    if logs.is_empty() {
        return "no run has left anything changed\n".to_owned();
    }
    let line = |(name, changes): &(String, Changes)| {
        let objects: Vec<&str> = changes.objects.keys().map(String::as_str).collect();
        let running = if changes.is_running() { " (still running)" } else { "" };
        let Changes { target, node, device, .. } = changes;
        format!("{name}  {device}, node {node} on {target}: {}{running}\n", objects.join(", "))
    };
    logs.iter().map(line).collect()
}
