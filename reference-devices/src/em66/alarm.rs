//! The alarm block (3.3): sixteen alarms, each on one object.

use canopen::{Abort, Dictionary, Mux};

use super::Duty;
use super::rules::Em66Rules;

/// What the alarms remember.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Alarms {}

impl Alarms {
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

    /// Shows the states of the alarms.
    pub(super) fn watch(&mut self, _duty: &Duty, _od: &mut Dictionary, _rules: &dyn Em66Rules) {}
}
