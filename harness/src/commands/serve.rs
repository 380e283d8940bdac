//! `harness serve`: a reference device on a real bus.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use canopen::{BusError, Device, Instant, serve};
use reference_devices::mutant;
use reference_devices::rules::Specification;

use crate::cli::ServeArgs;
use crate::exit::{Exit, Refused};
use crate::target::{mutant_of, open_interface, reference_device};

/// Serves until Ctrl-C.
///
/// # Errors
/// When the device or the interface is not there, or the interface fails for good.
pub(super) fn run(args: &ServeArgs, stop: &Arc<AtomicBool>) -> Result<Exit, Refused> {
    let device = reference_device(&args.device)?;
    let node = args.node.unwrap_or_else(|| device.description.default_node);
    let mut served: Box<dyn Device> = match &args.mutant {
        None => Box::new(device.node(node, Box::new(Specification))),
        Some(name) => {
            let mutant = mutant_of(&device, name)?;
            mutant::build(&device, node, &mutant).map_err(Refused::usage)?
        }
    };
    let mut bus = open_interface(&args.target, stop)?;
    let deviation = args.mutant.as_ref().map(|name| format!(" with {name}")).unwrap_or_default();
    eprintln!("{}{deviation} is node {node} on {}; Ctrl-C ends it", args.device, args.target);
    loop {
        match serve(&mut *bus, &mut *served, Instant::NEVER) {
            Ok(()) | Err(BusError::Interrupted) => return Ok(Exit::Green),
            // A device sees an error frame and goes on.
            Err(BusError::Controller(what)) => eprintln!("the CAN controller reports {what}"),
            Err(error) => return Err(Refused::bus(error.to_string())),
        }
    }
}
