//! The harness: suites against a CANopen device under test, from the command line.
//!
//! `target` finds the device and opens its bus, [`runner`] plans and runs, and `reporter` takes its
//! events to terminal, journal and reports. This is the only crate with I/O. Code that decides a
//! verdict does not belong here.

/// Prints a line to standard error. When it cannot be written, as on a full disk, nothing stops.
macro_rules! complain {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        crate::progress::beside(|| _ = writeln!(std::io::stderr(), $($text)*));
    }};
}

mod argument;
pub mod bus;
pub mod candump;
pub mod cli;
mod command_line;
pub mod commands;
mod data;
pub mod device_file;
pub mod exit;
mod files;
pub mod folders;
mod hook;
pub mod plugged;
mod progress;
mod reporter;
pub mod rig;
mod signals;
mod system;
pub mod target;
mod undo_log;
mod version;

use canopen::{nearest, source};
