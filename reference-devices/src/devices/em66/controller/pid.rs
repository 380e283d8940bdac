//! From the deviation to the output: proportional and integral action, within limits.

use crate::devices::em66::PERIOD;

/// The parameters, which EUROMAP 66-2 leaves inside the device (3.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gains {
    /// Output in tenths of a percent for a tenth of a kelvin.
    pub(super) proportional: f64,
    /// In seconds.
    pub(super) integral_time: f64,
}

impl Gains {
    /// For the plant as it is delivered.
    pub(super) const COMMISSIONED: Self = Self { proportional: 40.0, integral_time: 90.0 };
}

/// The memory of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pid {
    /// The parameters in use.
    pub(super) gains: Gains,
    /// The integral part in tenths of a percent.
    integral: f64,
}

impl Pid {
    /// A controller that has not run.
    pub(super) const fn new() -> Self {
        Self { gains: Gains::COMMISSIONED, integral: 0.0 }
    }

    /// Forgets what it has learnt of the load, not its parameters.
    pub(super) const fn restart(&mut self) {
        self.integral = 0.0;
    }

    /// One sample: the output in tenths of a percent for `missing` tenths of a kelvin.
    ///
    /// The integral part stands still while the output is at a limit and would go beyond it, and
    /// while more is missing than the proportional part can ask for: far away there is nothing to
    /// learn of the load, and what is learnt there is overshoot.
    pub(super) fn advance(&mut self, missing: f64, low: f64, high: f64) -> f64 {
        let proportional = self.gains.proportional * missing;
        let grown = self.integral + proportional * PERIOD.as_secs_f64() / self.gains.integral_time;
        let beyond = |part: f64| part > high || part < low;
        if !beyond(proportional) && !beyond(proportional + grown) {
            self.integral = grown;
        }
        (proportional + self.integral).clamp(low, high)
    }
}
