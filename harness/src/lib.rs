//! The harness: runs YAML suites against a CANopen device under test.
//!
//! [`suite`] loads what is demanded, [`plan`] binds it to a device by its data sheet, [`run`]
//! carries it out on a [`canopen::Bus`] and tells of it in events, which [`reporter`] takes to
//! terminal, journal and JUnit. This is the only crate with I/O.

pub mod bus;
pub mod cli;
pub mod commands;
pub mod dut;
pub mod exit;
pub mod parallel;
pub mod plan;
pub mod properties;
pub mod reporter;
pub mod rig;
pub mod run;
pub mod suite;
pub mod target;

use canopen::{nearest, source};
