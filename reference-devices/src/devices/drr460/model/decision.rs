//! The inputs and results of a decision of the controller.

use super::flags::Faults;
use super::tuning::Found;
use super::wiring::Terminals;
use crate::devices::pixsys::sensor::Connected;

/// The inputs of a decision.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Inputs {
    pub(crate) connected: Connected,
    /// Degrees Celsius at the terminals.
    pub(crate) terminals: f64,
    /// Of the current transformer.
    pub(crate) milliamperes: f64,
    pub(crate) faults: Faults,
    pub(crate) set_point: i64,
    pub(crate) limits: [i64; 2],
    pub(crate) running: bool,
    /// The master asks for manual mode.
    pub(crate) manual: bool,
    /// The value of 4004h, as a share of full output.
    pub(crate) output: f64,
    pub(crate) remote: [bool; 2],
    /// The value of 4010h.
    pub(crate) retransmitted: i64,
    pub(crate) offline: bool,
    /// The key enables the command.
    pub(crate) test: bool,
    /// The terminals as the master of an expansion module has them.
    pub(crate) master: Option<Terminals>,
}

/// The result of a decision, for the objects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) process: i64,
    pub(crate) flags: i64,
    pub(crate) set_point: i64,
    /// Shares of full output.
    pub(crate) output: f64,
    pub(crate) cooling: f64,
    /// The controller is in manual mode, maybe by itself.
    pub(crate) manual: bool,
    pub(crate) found: Option<Found>,
    /// There is no process value to go by.
    pub(crate) error: bool,
    /// The network has fallen silent.
    pub(crate) offline: bool,
}
