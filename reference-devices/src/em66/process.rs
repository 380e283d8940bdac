//! The process: a tank with heater and cooler, a pump, a main line, a mould and a return line.

use std::time::Duration;

use super::Drive;

/// Temperatures, flow, pressure and contents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Process {
    /// In degrees Celsius.
    pub(super) main: f64,
}

impl Process {
    /// Everything at ambient temperature, the mould full and the pump at rest.
    pub(super) fn new() -> Self {
        Self { main: AMBIENT }
    }

    /// Time goes by while the actuators stay as they are.
    pub(super) fn advance(&mut self, elapsed: Duration, drive: Drive) {
        let push = drive.output as f64 / 1000.0 * 10.0;
        self.main += (push - (self.main - AMBIENT) * 0.001) * elapsed.as_secs_f64() / 60.0;
    }
}

/// In degrees Celsius.
const AMBIENT: f64 = 25.0;
