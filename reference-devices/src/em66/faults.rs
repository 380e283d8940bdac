//! Errors of the device (3.4.7) and their reset (3.4.2).

use canopen::{Dictionary, Mux};

use super::Sensed;
use super::rules::Em66Rules;
use crate::errors::Errors;

/// The errors that are present.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {}

impl Faults {
    /// Shows the errors in 2008h and tells them; whether one forbids to heat and to cool.
    pub(super) fn judge(
        &mut self,
        _sensed: &Sensed,
        _od: &mut Dictionary,
        _errors: &mut Errors,
        _rules: &dyn Em66Rules,
    ) -> bool {
        false
    }

    /// The network has written the object at `mux`.
    pub(super) fn written(&mut self, _mux: Mux, _od: &mut Dictionary, _rules: &dyn Em66Rules) {}
}
