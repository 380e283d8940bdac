//! What the controller controls: a body of the first order with a heater or a cooler.

use super::PERIOD;

/// A body that follows its surroundings and the actuator on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plant {
    celsius: f64,
    /// Kelvin above ambient temperature that the actuator leads to in the end.
    push: f64,
    /// The part of a distance that is left after one sample.
    decay: f64,
}

impl Plant {
    /// A body at ambient temperature whose actuator is off.
    pub(super) fn new() -> Self {
        let decay = (-PERIOD.as_secs_f64() / TIME_CONSTANT).exp();
        Self { celsius: AMBIENT, push: 0.0, decay }
    }

    /// One sample goes by: the exact solution for a constant actuator, not an approximation.
    pub(super) fn advance(&mut self) {
        let end = AMBIENT + self.push;
        self.celsius = end + (self.celsius - end) * self.decay;
    }

    /// Drives the actuator with a share of its power; it heats, or it cools.
    pub(super) fn drive(&mut self, share: f64, cools: bool) {
        self.push = share * if cools { -FULL_COOLING } else { FULL_HEATING };
    }

    /// Its temperature in degrees Celsius.
    pub(super) const fn celsius(&self) -> f64 {
        self.celsius
    }
}

/// In degrees Celsius. The terminals of the sensor are at this temperature, too.
pub(super) const AMBIENT: f64 = 25.0;
/// In seconds.
const TIME_CONSTANT: f64 = 5.0;
/// In kelvin.
const FULL_HEATING: f64 = 100.0;
/// In kelvin.
const FULL_COOLING: f64 = 50.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn after(seconds: f64, plant: &mut Plant) -> f64 {
        for _ in 0..(seconds / PERIOD.as_secs_f64()).round() as u32 {
            plant.advance();
        }
        plant.celsius()
    }

    #[test]
    fn a_step_is_answered_with_an_exponential() {
        let mut plant = Plant::new();
        assert_eq!(after(10.0, &mut plant), AMBIENT);
        plant.drive(1.0, false);
        let reached = AMBIENT + 100.0 * (1.0 - (-1.0f64).exp());
        assert!((after(5.0, &mut plant) - reached).abs() < 1e-9);
        plant.drive(0.5, true);
        assert!((after(100.0, &mut plant) - 0.0).abs() < 1e-6);
    }
}
