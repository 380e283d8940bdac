//! The controller block (3.2): set points, ramps, output, self-optimisation.

use std::time::Duration;

use canopen::{Abort, Dictionary, Mux};

use super::objects::{EFFECTIVE_SET_POINT, EFFECTIVE_VALUE, SET_POINT, STATUS, set, value};
use super::rules::Em66Rules;
use super::{Drive, Duty, Pump, Sensed};

/// What the controller remembers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controller {}

impl Controller {
    /// Whether the device takes what is about to be written.
    pub(super) fn check(
        _mux: Mux,
        _bytes: &[u8],
        _od: &Dictionary,
        _rules: &dyn Em66Rules,
    ) -> Result<(), Abort> {
        Ok(())
    }

    /// The network has written the object at `mux`.
    pub(super) fn written(&mut self, _mux: Mux, _od: &mut Dictionary, _rules: &dyn Em66Rules) {}

    /// What the actuators are to do; shows 6410h, 6427h, 7400h and 7401h.
    pub(super) fn drive(
        &mut self,
        _elapsed: Duration,
        sensed: &Sensed,
        duty: &Duty,
        od: &mut Dictionary,
        _rules: &dyn Em66Rules,
    ) -> Drive {
        set(od, EFFECTIVE_VALUE, sensed.main);
        let set_point = value(od, SET_POINT);
        set(od, EFFECTIVE_SET_POINT, set_point);
        set(od, STATUS, duty.on.into());
        let pump = if duty.on { Pump::Forward } else { Pump::Off };
        Drive { output: 0, pump, draining: duty.evacuating }
    }
}
