//! The functions of a DRR460, as small types that know neither objects nor a clock: each has
//! settings, looks at inputs, and is given the elapsed time.

pub(crate) mod parameters;
pub(crate) mod rules;

mod alarm;
pub(crate) mod bench;
pub(crate) mod controller;
mod current;
mod cycle;
pub(crate) mod decision;
mod delay;
pub(crate) mod expansion;
mod filter;
pub(crate) mod flags;
mod latch;
pub(crate) mod load;
mod on_off;
mod pid;
mod reading;
mod retransmission;
mod soft_start;
mod state;
pub(crate) mod switches;
pub(crate) mod tuning;
mod valve;
pub(crate) mod wiring;

/// Seconds from one decision to the next while something moves. The manual leaves it open.
pub(crate) const PERIOD: f64 = 0.1;
