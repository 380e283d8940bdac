//! The runner: YAML suites against a device under test, on any bus that a program provides.
//!
//! [`suite`] loads the demands, [`plan`] binds them to a device by its data sheet, and [`run`]
//! carries them out on a [`canopen::Bus`] and emits events.
//!
//! This crate contains everything that decides a verdict. Files, sockets, signals, processes and
//! the command line are left out: a program passes sources, a bus, and implementations of
//! [`dut::Hook`] and [`run::KeepChanges`]. The suites are part of this crate, so that nothing is
//! read from disk. [`parallel`] starts threads, and nothing here reads a clock.

pub mod dut;
pub mod parallel;
pub mod plan;
pub mod protect;
pub mod run;
pub mod stop;
pub mod suite;
pub mod waivers;

use canopen::{nearest, source};
