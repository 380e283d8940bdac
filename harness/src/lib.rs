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
mod candump;
pub mod cli;
pub mod commands;
mod data;
mod device_file;
pub mod dut;
pub mod exit;
mod files;
pub mod parallel;
pub mod plan;
pub mod properties;
mod protect;
mod reporter;
mod rig;
pub mod run;
pub mod stop;
pub mod suite;
pub mod target;
mod undo_log;
pub mod waivers;

use canopen::{nearest, source};
