//! What the device is to do: on or off, by which sensor, in suction or not (3.4.2 to 3.4.6).

use canopen::{Abort, Dictionary, Mux};

use super::rules::Em66Rules;
use super::{Duty, Options, Sensed};

/// What was asked for and what became of it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Operation {}

impl Operation {
    /// Whether the device takes what is about to be written.
    pub(super) fn check(
        _mux: Mux,
        _bytes: &[u8],
        _options: Options,
        _od: &Dictionary,
        _rules: &dyn Em66Rules,
    ) -> Result<(), Abort> {
        Ok(())
    }

    /// The network has written the object at `mux`.
    pub(super) fn written(&mut self, _mux: Mux, _od: &mut Dictionary, _rules: &dyn Em66Rules) {}

    /// What the device is to do now; shows it in 2002h, 2004h, 2006h, 2007h and 2009h.
    pub(super) fn decide(
        &mut self,
        _sensed: &Sensed,
        blocked: bool,
        _options: Options,
        od: &mut Dictionary,
        _rules: &dyn Em66Rules,
    ) -> Duty {
        let on = super::objects::value(od, super::objects::CONTROL_BYTE) & 1 != 0;
        Duty { on, blocked, ..Duty::default() }
    }
}
