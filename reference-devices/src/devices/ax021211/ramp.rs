//! The ramps of an analogue output and its static bias (1.3).

use std::time::Duration;

/// How an output goes from one field value to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ramp {
    /// The way that the times are for, in units of the field value.
    pub(super) span: f64,
    pub(super) up: Duration,
    pub(super) down: Duration,
    /// Values between 0 and this one are jumped over.
    pub(super) bias: f64,
}

impl Ramp {
    /// Where the output is when `elapsed` has gone by.
    pub(super) fn step(&self, level: f64, target: f64, elapsed: Duration) -> f64 {
        if target > level {
            let start = if level < self.bias { self.bias.min(target) } else { level };
            match self.way(self.up, elapsed) {
                Some(way) => (start + way).min(target),
                None => target,
            }
        } else {
            let next = match self.way(self.down, elapsed) {
                Some(way) => (level - way).max(target),
                None => target,
            };
            if next < self.bias { target } else { next }
        }
    }

    /// How far the output goes in that time; `None` without a ramp.
    fn way(&self, time: Duration, elapsed: Duration) -> Option<f64> {
        let part = elapsed.as_secs_f64() / time.as_secs_f64();
        (!time.is_zero()).then_some(self.span * part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAMP: Ramp = Ramp {
        span: 1500.0,
        up: Duration::from_millis(1000),
        down: Duration::from_millis(500),
        bias: 0.0,
    };

    fn step(ramp: Ramp, level: f64, target: f64, millis: u64) -> f64 {
        ramp.step(level, target, Duration::from_millis(millis))
    }

    #[test]
    fn the_time_is_for_the_way_between_the_scalings() {
        assert_eq!(step(RAMP, 0.0, 1500.0, 1), 1.5);
        assert_eq!(step(RAMP, 0.0, 1500.0, 1000), 1500.0);
        assert_eq!(step(RAMP, 0.0, 300.0, 1000), 300.0);
        assert_eq!(step(RAMP, 1500.0, 0.0, 1), 1497.0);
        assert_eq!(step(RAMP, 1500.0, 0.0, 500), 0.0);
        assert_eq!(step(RAMP, 700.0, 700.0, 1), 700.0);
        let none = Ramp { up: Duration::ZERO, ..RAMP };
        assert_eq!(step(none, 0.0, 1500.0, 0), 1500.0);
    }

    #[test]
    fn a_ramp_jumps_over_the_static_bias() {
        let biased = Ramp { bias: 200.0, ..RAMP };
        assert_eq!(step(biased, 0.0, 1500.0, 0), 200.0);
        assert_eq!(step(biased, 0.0, 1500.0, 10), 215.0);
        assert_eq!(step(biased, 201.0, 0.0, 1), 0.0);
        assert_eq!(step(biased, 0.0, 100.0, 0), 100.0);
        assert_eq!(step(biased, 500.0, 300.0, 1000), 300.0);
    }
}
