//! The objects with the data of the application (manual, 11.3 and 11.4).

use canopen::{Dictionary, Mux};

/// Node-ID (11.2.9).
pub(super) const NODE_ID: Mux = Mux::new(0x100B, 0);
/// Store parameters (11.2.12).
pub(super) const STORE: Mux = Mux::new(0x1010, 1);
/// Restore default parameters (11.2.13).
pub(super) const RESTORE: Mux = Mux::new(0x1011, 1);
/// The bit rate in force, as a code (11.3.1).
pub(super) const BIT_RATE: Mux = Mux::new(0x2000, 1);
/// The parameters (11.3.2).
pub(super) const PARAMETERS: u16 = 0x3000;
/// Command set point, in digits (11.3.3).
pub(super) const SET_POINT: Mux = Mux::new(0x4000, 0);
/// Start/stop command (11.3.6).
pub(super) const START: Mux = Mux::new(0x4003, 0);
/// Heating output in hundredths of a per cent (11.3.7).
pub(super) const OUTPUT: Mux = Mux::new(0x4004, 0);
/// Cold output in hundredths of a per cent (11.3.8).
pub(super) const COLD_OUTPUT: Mux = Mux::new(0x4005, 0);
/// Cold junction temperature in tenths of a degree (11.3.9).
pub(super) const COLD_JUNCTION: Mux = Mux::new(0x4006, 0);
/// Error flags (11.3.10).
pub(super) const ERROR_FLAGS: Mux = Mux::new(0x4007, 0);
/// Set point in force, in digits (11.3.11).
pub(super) const REAL_SET_POINT: Mux = Mux::new(0x4008, 0);
/// Digital outputs status (11.3.12).
pub(super) const OUTPUTS: Mux = Mux::new(0x4009, 0);
/// Command output reset (11.3.13).
pub(super) const COMMAND_RESET: Mux = Mux::new(0x400A, 0);
/// Alarms reset (11.3.14).
pub(super) const ALARMS_RESET: Mux = Mux::new(0x400B, 0);
/// Remote alarms (11.3.15, 11.3.16).
pub(super) const REMOTE_ALARMS: [Mux; 2] = [Mux::new(0x400C, 0), Mux::new(0x400D, 0)];
/// Autotuning status (7.5).
pub(super) const TUNING: Mux = Mux::new(0x400E, 0);
/// Automatic/manual command (11.3.18).
pub(super) const MANUAL: Mux = Mux::new(0x400F, 0);
/// The value that is retransmitted (11.3.2, sub 100).
pub(super) const RETRANSMITTED: Mux = Mux::new(0x4010, 0);
/// Latch-on procedure (7.11).
pub(super) const LATCH_ON: u16 = 0x4011;

/// Digital outputs of the master (11.4.1).
pub(super) const MASTER_OUTPUTS: Mux = Mux::new(0x6200, 1);
/// Analogue output of the master (11.4.5).
pub(super) const MASTER_ANALOGUE: Mux = Mux::new(0x6411, 1);

/// A parameter of 3000h by its number (11.3.2).
pub(super) fn parameter(od: &Dictionary, sub: u8) -> i64 {
    value(od, Mux::new(PARAMETERS, sub))
}

/// Gives a parameter of 3000h a value.
pub(super) fn set_parameter(od: &mut Dictionary, sub: u8, value: i64) {
    od.set_int(Mux::new(PARAMETERS, sub), value);
}

/// The whole number at `mux`; 0 for what the data sheet does not have.
pub(super) fn value(od: &Dictionary, mux: Mux) -> i64 {
    od.int(mux).unwrap_or(0)
}
