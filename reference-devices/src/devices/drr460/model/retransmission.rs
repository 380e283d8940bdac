//! The analogue output when it neither is the command nor belongs to an alarm (manual, 7.10 and
//! 11.3.2, parameters 100 to 105).

use super::parameters::Parameters;
use super::rules::Rules;
use super::state::State;

/// The settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    source: i64,
    live_zero: bool,
    low: f64,
    high: f64,
    error: State,
    stop: State,
}

impl Settings {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let is_temperature = parameters.get(1) < FIRST_LINEAR;
        let limit =
            |sub| parameters.rules.retransmission_limit(parameters.get(sub), is_temperature);
        Self {
            source: parameters.get(100),
            live_zero: parameters.is_set(101),
            low: limit(102),
            high: limit(103),
            error: State(parameters.get(104)),
            stop: State(parameters.get(105)),
        }
    }
}

/// The values that can be retransmitted, in digits or tenths of an ampere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sources {
    pub(super) process: i64,
    pub(super) set_point: i64,
    pub(super) alarms: [i64; 2],
    pub(super) amperes: f64,
    pub(super) remote: i64,
    /// There is no process value to go by.
    pub(super) error: bool,
    pub(super) running: bool,
}

/// The current of the output in microamperes; `None` when nothing is retransmitted.
pub(super) fn microamperes(sources: &Sources, settings: &Settings, rules: &Rules) -> Option<f64> {
    let value = match settings.source {
        1 => sources.process as f64,
        2 => sources.set_point as f64,
        3 => sources.alarms[0] as f64,
        4 => sources.alarms[1] as f64,
        5 => sources.amperes,
        6 => sources.remote as f64,
        _ => return None,
    };
    let fails = sources.error && rules.error_goes_before_stop();
    if !sources.running && settings.stop.0 != WORKS_IN_STOP && !fails {
        return Some(settings.stop.microamperes(rules));
    }
    if sources.error {
        return Some(settings.error.microamperes(rules));
    }
    let share = rules.share(value, settings.low, settings.high);
    Some(rules.microamperes(share, settings.live_zero))
}

const WORKS_IN_STOP: i64 = 4;
/// The first sensor of sub 1 that is no temperature.
const FIRST_LINEAR: i64 = 14;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    const SOURCES: Sources = Sources {
        process: 100,
        set_point: 200,
        alarms: [300, 400],
        amperes: 500.0,
        remote: 600,
        error: false,
        running: true,
    };

    fn given(list: &[(u8, i64)], sources: Sources) -> Option<f64> {
        let list: Vec<_> = list.iter().copied().chain([(103, 1000)]).collect();
        let settings = Settings::of(&Parameters::listed(&list, &Rules::plain()));
        microamperes(&sources, &settings, &Rules::plain())
    }

    #[test]
    fn each_source_has_its_code() {
        assert_eq!(given(&[], SOURCES), None);
        for code in 1..=6 {
            let share = code as f64 / 10.0;
            assert_eq!(given(&[(100, code)], SOURCES), Some(20_000.0 * share), "{code}");
            let live = given(&[(100, code), (101, 1)], SOURCES).unwrap();
            assert!((live - 4000.0 - 16_000.0 * share).abs() < 1e-6, "{code}");
        }
    }

    #[test]
    fn the_range_ends_at_its_limits_and_may_fall() {
        let process = |process| Sources { process, ..SOURCES };
        assert_eq!(given(&[(100, 1)], process(-5)), Some(0.0));
        assert_eq!(given(&[(100, 1)], process(1005)), Some(20_000.0));
        assert_eq!(given(&[(100, 1), (102, 1000), (103, 0)], process(250)), Some(15_000.0));
        assert_eq!(given(&[(100, 1), (102, 7), (103, 7)], process(250)), Some(0.0));
    }

    #[test]
    fn stop_and_errors_have_their_own_states() {
        let stopped = Sources { running: false, ..SOURCES };
        let wrong = Sources { error: true, ..SOURCES };
        let list = [(100, 6), (104, 3), (105, 1)];
        assert_eq!(given(&list, stopped), Some(4000.0));
        assert_eq!(given(&list, wrong), Some(21_500.0));
        assert_eq!(given(&[(100, 6), (105, 4)], stopped), Some(12_000.0));
    }
}
