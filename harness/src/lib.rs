//! The harness: runs YAML suites against a CANopen device under test.
//!
//! [`suite`] loads what is demanded, [`plan`] binds it to a device by its data sheet, [`run`]
//! carries it out on a [`canopen::Bus`] and reports events, which `reporter` takes to terminal,
//! journal and reports. This is the only crate with I/O.

/// Prints a line to standard error. When it cannot be written, as on a full disk, nothing stops.
macro_rules! complain {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

pub mod bus;
pub mod candump;
pub mod cli;
pub mod commands;
pub mod device_file;
pub mod exit;
mod files;
pub mod folders;
mod hook;
mod reporter;
pub mod rig;
mod signals;
pub mod target;
mod undo_log;

use canopen::{nearest, source};
