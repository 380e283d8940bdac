//! The common part of the Pixsys devices: their manuals read CiA 401 in the same words and list the
//! same sensors.

pub(crate) mod emergency;
pub(crate) mod led;
pub(crate) mod sensor;

use std::sync::Arc;
use std::time::Duration;

use canopen::{Dictionary, Mux, NmtState};

use crate::decisions::Taken;
use crate::profiles::cia401::{Cia401Decision as By, Cia401Rules, EVERY_LEVEL, Setting};
use crate::stack::CommunicationEvent;

/// Inputs and outputs as the manuals describe them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PixsysIo {
    /// The parameter with the time that every digital input has to hold, in units of 0.5 ms.
    pub(super) filter: Option<Mux>,
    /// STOPPED sets the outputs as a communication error does, which CiA 401 says and a manual may
    /// leave out.
    pub(super) stop_is_failure: bool,
    /// The objects of outputs keep what the network wrote, while the terminals have their error
    /// values; only a new value ends those (MCM260X 11.4.7).
    pub(super) objects_stay: bool,
}

impl PixsysIo {
    /// The decisions of CiA 401 as the manuals take them.
    pub(super) fn rules(self) -> Cia401Rules {
        let Self { filter, stop_is_failure, objects_stay } = self;
        let steps = move |od: &Dictionary| filter.and_then(|mux| od.int(mux)).unwrap_or(0);
        let own = [
            By::filter_time(Taken::By(Arc::new(move |_, od| {
                FILTER_STEP.saturating_mul(u32::try_from(steps(od)).unwrap_or(0))
            }))),
            // The lower limit belongs to the values that trigger (DRR460 11.4.9, MCM260X 11.4.14),
            // in contrast to the profile.
            By::below_limit(Taken::By(Arc::new(|_, value, limit| value <= limit))),
            // For the DRR460 only a communication error sets the outputs (DRR460 11.4.2).
            By::fails(Taken::By(Arc::new(move |_, event| match event {
                CommunicationEvent::Entered(NmtState::STOPPED) => stop_is_failure,
                _ => event == CommunicationEvent::CommunicationError,
            }))),
            By::failure_writes_objects(Taken::Is(!objects_stay)),
            By::recovers(Taken::By(Arc::new(move |_, event| {
                !objects_stay && event == CommunicationEvent::Entered(NmtState::OPERATIONAL)
            }))),
            By::setting(Taken::By(Arc::new(move |_, setting, configured| match setting {
                Setting::InputFilter if filter.is_some() => EVERY_LEVEL,
                _ => configured,
            }))),
        ];
        own.into_iter().fold(Cia401Rules::default(), |rules, taken| rules.under(taken, None))
    }
}

/// Degrees Celsius that the temperature sensors measure, in the order of their codes: eight
/// thermocouples (K, S, R, J, T, E, N, B), Pt100, Ni100, NTC, PTC, Pt500, Pt1000.
pub(super) const SENSOR_RANGES: [(f64, f64); 14] = [
    (-260.0, 1360.0),
    (-40.0, 1760.0),
    (-40.0, 1760.0),
    (-200.0, 1200.0),
    (-260.0, 400.0),
    (-260.0, 980.0),
    (-260.0, 1280.0),
    (100.0, 1820.0),
    (-100.0, 600.0),
    (-60.0, 180.0),
    (-40.0, 125.0),
    (-50.0, 150.0),
    (-100.0, 600.0),
    (-100.0, 600.0),
];

/// The unit of a filter parameter.
const FILTER_STEP: Duration = Duration::from_micros(500);

#[cfg(test)]
mod tests {
    use canopen::{Dictionary, Mux};

    use super::*;
    use crate::devices;
    use crate::profiles::cia401::IoBlock;
    use crate::stack::Behaviour;

    type Objects = &'static [(u16, i64)];

    fn verdict(objects: &[(u16, i64)], last: i16, now: i64) -> bool {
        let eds = devices::device("drr460").unwrap().description.eds;
        let mut od = Dictionary::new(&eds, 1).unwrap();
        od.set_int(Mux::new(0x6423, 0), 1);
        for (index, number) in objects {
            od.set_int(Mux::new(*index, if *index == 0x6423 { 0 } else { 1 }), *number);
        }
        od.set_int(Mux::new(0x6401, 1), now);
        IoBlock::new(&eds, PixsysIo::default().rules()).triggers(
            Mux::new(0x6401, 1),
            &last.to_le_bytes(),
            &od,
        )
    }

    #[test]
    fn nothing_goes_out_unless_released_and_changed() {
        assert!(verdict(&[], 250, 251));
        assert!(!verdict(&[(0x6423, 0)], 250, 251));
        assert!(!verdict(&[], 250, 250));
        assert!(!verdict(&[(0x6421, 0)], 250, 9000));
    }

    #[test]
    fn each_condition_stands_for_itself() {
        let table: [(Objects, i16, i64, bool); 10] = [
            (&[(0x6421, 1), (0x6424, 300)], 250, 299, false),
            (&[(0x6421, 1), (0x6424, 300)], 250, 300, true),
            (&[(0x6421, 2), (0x6425, -10)], 0, -9, false),
            (&[(0x6421, 2), (0x6425, -10)], 0, -10, true),
            (&[(0x6421, 4), (0x6426, 5)], 250, 245, false),
            (&[(0x6421, 4), (0x6426, 5)], 250, 244, true),
            (&[(0x6421, 8), (0x6427, 5)], 250, 256, false),
            (&[(0x6421, 8), (0x6427, 5)], 250, 244, true),
            (&[(0x6421, 16), (0x6428, 5)], 250, 244, false),
            (&[(0x6421, 16), (0x6428, 5)], 250, 256, true),
        ];
        for (objects, last, now, expected) in table {
            assert_eq!(verdict(objects, last, now), expected, "{objects:?} {last} {now}");
        }
    }
}
