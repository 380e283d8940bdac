//! A valve with a motor: Q1 opens it, and Q2 closes it (manual, 11.3.2, parameters 16 and 24).

/// The controller's knowledge of the valve, which has no feedback.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Valve {
    /// Where it is, from closed at 0 to open at 1.
    at: f64,
    motion: Motion,
}

/// The motion of the valve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Motion {
    #[default]
    Rests,
    Opens,
    Closes,
}

impl Valve {
    /// Advances by `elapsed` seconds in the present motion, for a valve that travels from end to
    /// end in `travel` seconds.
    pub(super) fn advance(&mut self, elapsed: f64, travel: f64) {
        let way = elapsed / travel.max(1.0);
        self.at = match self.motion {
            Motion::Rests => self.at,
            Motion::Opens => self.at + way,
            Motion::Closes => self.at - way,
        }
        .clamp(0.0, 1.0);
    }

    /// Where it shall be. A short way is not worth a motion, but the ends are reached.
    pub(super) fn go_to(&mut self, wanted: f64) {
        let way = wanted.clamp(0.0, 1.0) - self.at;
        let is_end = wanted <= 0.0 || wanted >= 1.0;
        let moves = self.motion != Motion::Rests;
        let least = if is_end || moves { ROUNDING } else { SHORTEST_WAY };
        self.motion = match way {
            _ if way > least => Motion::Opens,
            _ if way < -least => Motion::Closes,
            _ => Motion::Rests,
        };
    }

    pub(super) const fn motion(&self) -> Motion {
        self.motion
    }

    /// Where it is.
    pub(super) const fn at(&self) -> f64 {
        self.at
    }

    /// Seconds until it arrives; `None` while it rests.
    pub(super) fn next(&self, wanted: f64, travel: f64) -> Option<f64> {
        let way = (wanted.clamp(0.0, 1.0) - self.at).abs();
        (self.motion != Motion::Rests).then_some(way * travel)
    }
}

/// As a share of the whole way. The manual leaves it open.
const SHORTEST_WAY: f64 = 0.01;
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_travels_from_end_to_end_in_its_time() {
        let mut valve = Valve::default();
        valve.go_to(1.0);
        assert_eq!((valve.motion(), valve.next(1.0, 60.0)), (Motion::Opens, Some(60.0)));
        valve.advance(30.0, 60.0);
        valve.go_to(0.5);
        assert_eq!((valve.motion(), valve.at()), (Motion::Rests, 0.5));
        valve.go_to(0.505);
        assert_eq!(valve.motion(), Motion::Rests);
        valve.go_to(0.0);
        valve.advance(31.0, 60.0);
        valve.go_to(0.0);
        assert_eq!((valve.motion(), valve.at()), (Motion::Rests, 0.0));
    }
}
