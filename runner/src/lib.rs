//! The runner: YAML suites against a device under test, on whatever bus a program brings.
//!
//! [`suite`] loads what is demanded, [`plan`] binds it to a device by its data sheet, and [`run`]
//! carries it out on a [`canopen::Bus`] and emits events.
//!
//! Here belongs what decides a verdict. Files, sockets, signals, processes and the command line do
//! not: a program passes sources, a bus, and implementations of [`dut::Hook`] and
//! [`run::KeepChanges`]. The suites in this crate are part of it, so that nothing is read from
//! disk. [`parallel`] starts threads, and nothing here reads a clock.

pub mod dut;
pub mod parallel;
pub mod plan;
pub mod protect;
pub mod run;
pub mod stop;
pub mod suite;
pub mod waivers;

use canopen::{nearest, source};
