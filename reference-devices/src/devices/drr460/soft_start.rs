//! The way to the set point after a start (manual, 7.9 and parameters 80 to 84).

use canopen::Dictionary;

use super::delay::SAMPLES_PER_SECOND;
use super::objects::parameter;

/// A soft start under way, or none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SoftStart {
    phase: Phase,
    kind: i64,
    /// Samples since it began.
    elapsed: u64,
}

#[derive(Clone, Copy, Debug, Default)]
enum Phase {
    #[default]
    Done,
    /// The set point in force moves towards the one that is wanted.
    Gradient { at: f64 },
    /// The output is held until the process passes the threshold.
    Percentage,
}

impl SoftStart {
    /// The controller starts with this process value.
    pub(super) fn begin(kind: i64, process: i64) -> Self {
        let phase = match kind {
            1 => Phase::Gradient { at: process as f64 },
            2 => Phase::Percentage,
            _ => Phase::Done,
        };
        Self { phase, kind, elapsed: 0 }
    }

    /// One sample: the set point in force. A soft start that is no longer selected is over.
    pub(super) fn set_point(&mut self, wanted: i64, process: i64, od: &Dictionary) -> i64 {
        let longest = parameter(od, LONGEST_MINUTES).unsigned_abs() * 60 * SAMPLES_PER_SECOND;
        let over = longest != 0 && self.elapsed >= longest;
        if over || parameter(od, KIND) != self.kind {
            self.phase = Phase::Done;
        }
        self.elapsed += 1;
        match self.phase {
            Phase::Gradient { at } => {
                let step = parameter(od, GRADIENT_PER_HOUR) as f64 / SAMPLES_PER_HOUR;
                let left = wanted as f64 - at;
                if left.abs() <= step {
                    self.phase = Phase::Done;
                    return wanted;
                }
                let at = at + step.copysign(left);
                self.phase = Phase::Gradient { at };
                at.round() as i64
            }
            Phase::Percentage if process >= parameter(od, THRESHOLD) => {
                self.phase = Phase::Done;
                wanted
            }
            Phase::Percentage | Phase::Done => wanted,
        }
    }

    /// The output in hundredths of a per cent that is held; `None` when the controller decides.
    pub(super) fn output(&self, od: &Dictionary) -> Option<i64> {
        matches!(self.phase, Phase::Percentage).then(|| parameter(od, HELD_PERCENT) * 100)
    }
}

/// Which soft start follows a START.
pub(super) const KIND: u8 = 80;
const GRADIENT_PER_HOUR: u8 = 81;
const HELD_PERCENT: u8 = 82;
const THRESHOLD: u8 = 83;
const LONGEST_MINUTES: u8 = 84;
const SAMPLES_PER_HOUR: f64 = 3600.0 * SAMPLES_PER_SECOND as f64;

#[cfg(test)]
mod tests {
    use canopen::Mux;

    use super::*;
    use crate::devices;

    fn od(parameters: &[(u8, i64)]) -> Dictionary {
        let mut od =
            Dictionary::new(&devices::device("drr460").unwrap().description.eds, 1).unwrap();
        for (sub, number) in parameters {
            od.set_int(Mux::new(0x3000, *sub), *number);
        }
        od
    }

    #[test]
    fn a_gradient_is_so_many_digits_in_an_hour() {
        let od = od(&[(KIND, 1), (GRADIENT_PER_HOUR, 3600)]);
        let mut start = SoftStart::begin(1, 250);
        let second = |start: &mut SoftStart, wanted| {
            (0..SAMPLES_PER_SECOND).map(|_| start.set_point(wanted, 0, &od)).last().unwrap()
        };
        assert_eq!(second(&mut start, 1000), 251);
        assert_eq!(second(&mut start, 1000), 252);
        assert_eq!(second(&mut start, 0), 251);
        assert_eq!(second(&mut start, 251), 251);
        assert_eq!(second(&mut start, 9000), 9000);
    }

    #[test]
    fn a_percentage_is_held_up_to_the_threshold() {
        let od = od(&[(KIND, 2), (THRESHOLD, 500), (HELD_PERCENT, 30)]);
        let mut start = SoftStart::begin(2, 250);
        assert_eq!((start.set_point(900, 499, &od), start.output(&od)), (900, Some(3000)));
        assert_eq!((start.set_point(900, 500, &od), start.output(&od)), (900, None));
        assert_eq!((start.set_point(900, 0, &od), start.output(&od)), (900, None));
    }

    #[test]
    fn a_soft_start_ends_when_it_is_not_selected_any_more() {
        let mut start = SoftStart::begin(1, 0);
        assert_eq!(start.set_point(9000, 0, &od(&[])), 9000);
        assert_eq!(start.set_point(9000, 0, &od(&[(KIND, 1)])), 9000);
    }

    #[test]
    fn a_soft_start_ends_after_its_time() {
        let od = od(&[(KIND, 1), (GRADIENT_PER_HOUR, 1), (LONGEST_MINUTES, 1)]);
        let mut start = SoftStart::begin(1, 0);
        let last = (0..60 * SAMPLES_PER_SECOND).map(|_| start.set_point(9000, 0, &od)).last();
        assert_eq!((last, start.set_point(9000, 0, &od)), (Some(0), 9000));
    }
}
