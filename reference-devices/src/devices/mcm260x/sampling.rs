//! From samples to the value of an analogue input: when they are taken, which of them count, and
//! how they are averaged (manual, chapters 6 to 8).

use std::collections::VecDeque;
use std::time::Duration;

use canopen::Instant;

use super::parameters::{Item, Parameters};
use super::sensor::{self, Connected, Sample};

/// An analogue input. It has no deadline while every sample would be like the last one.
#[derive(Clone, Debug, Default)]
pub(super) struct AnalogueInput {
    pub(super) connected: Connected,
    /// The samples of the average, the newest last.
    samples: VecDeque<f64>,
    /// Samples are discarded since then.
    discarding: Option<Instant>,
    /// The sensor that the samples are of.
    sensor: Option<i64>,
    out_of_range: bool,
    off: bool,
    /// The average, in digits without gain and offset.
    measured: f64,
    /// Digits, to be shown in 6401h.
    pub(super) value: i64,
    next: Option<Instant>,
    /// From one sample to the next; zero until there is one.
    period: Duration,
    /// When a sample that began with another period ends.
    under_way: Option<Instant>,
}

impl AnalogueInput {
    /// Restarts; the next sample is taken at once.
    pub(super) fn restart(&mut self) {
        *self = Self { connected: self.connected, ..Self::default() };
    }

    /// The sensor is selected, even if it is the same one: its average begins anew.
    pub(super) const fn select_again(&mut self) {
        self.sensor = None;
    }

    /// Takes the samples that are due, at multiples of the period since power-on. `changed` says
    /// that something may have happened to the signal or to a parameter since the last call.
    pub(super) fn follow(
        &mut self,
        now: Instant,
        changed: bool,
        (place, terminals): (usize, f64),
        parameters: Parameters,
    ) {
        if !changed && self.next.is_none_or(|due| due > now) {
            return;
        }
        let sensor = parameters.value(Item::SensorType, place);
        if self.sensor.replace(sensor) != Some(sensor) {
            self.samples.clear();
            self.next = Some(now);
        }
        self.pace(now, period(parameters.value(Item::Frequency, place)), parameters);
        let sample = sensor::sample(self.connected, terminals, place, parameters);
        let wanted = wanted(place, parameters);
        while let Some(due) = self.next.filter(|due| *due <= now) {
            self.take(due, sample, place, parameters);
            self.next = (!self.is_settled(sample, parameters.rules.kept_samples(wanted)))
                .then(|| self.after(due));
        }
        if changed {
            // The next sample sees any change.
            self.next = (!self.is_settled(sample, parameters.rules.kept_samples(wanted)))
                .then(|| self.after(now));
            self.show(place, parameters);
        }
    }

    /// The period of the samples from now on.
    fn pace(&mut self, now: Instant, period: Duration, parameters: Parameters) {
        let before = std::mem::replace(&mut self.period, period);
        self.under_way = self.under_way.filter(|end| *end > now);
        let is_new = before != period && !before.is_zero();
        if is_new && self.under_way.is_none() && parameters.rules.sample_under_way_ends() {
            self.under_way = Some(after(now, before));
        }
    }

    /// When the first sample after `now` is due.
    fn after(&self, now: Instant) -> Instant {
        let under_way = self.under_way.filter(|end| *end > now);
        under_way.unwrap_or_else(|| after(now, self.period))
    }

    /// When the next sample is due that will differ.
    pub(super) const fn poll_at(&self) -> Option<Instant> {
        self.next
    }

    /// The signal is out of the range of the sensor.
    pub(super) const fn is_out_of_range(&self) -> bool {
        self.out_of_range
    }

    /// The input is switched off.
    pub(super) const fn is_off(&self) -> bool {
        self.off
    }

    fn take(&mut self, now: Instant, sample: Sample, place: usize, parameters: Parameters) {
        self.out_of_range = matches!(sample, Sample::OutOfRange(_));
        self.off = sample == Sample::Off;
        let digits = match sample {
            Sample::Off => {
                self.samples.clear();
                self.value = 0;
                return;
            }
            Sample::OutOfRange(end) => {
                self.samples.clear();
                self.discarding = None;
                self.value = shown(end);
                return;
            }
            Sample::Valid(digits) => digits,
        };
        if !self.accepts(now, digits, place, parameters) {
            return;
        }
        self.samples.push_back(digits);
        let wanted = wanted(place, parameters);
        while parameters.rules.average_starts_full() && self.samples.len() < wanted {
            self.samples.push_front(self.samples[0]);
        }
        while self.samples.len() > parameters.rules.kept_samples(wanted) {
            self.samples.pop_front();
        }
        let last = self.samples.iter().rev().take(wanted);
        self.measured = parameters.rules.average(last.clone().sum(), last.len());
        self.show(place, parameters);
    }

    /// Shows what is measured with the gain and the offset of now.
    fn show(&mut self, place: usize, parameters: Parameters) {
        // Without samples the value is that of an input which is off or out of range.
        if self.samples.is_empty() {
            return;
        }
        self.value = match parameters.rules.calibrates_samples() {
            true => shown(self.measured),
            false => shown(sensor::calibrated(self.measured, place, parameters)),
        };
    }

    /// Whether a sample counts: it is near the value, or samples were discarded for too long. In
    /// the latter case the average restarts.
    fn accepts(&mut self, now: Instant, digits: f64, place: usize, parameters: Parameters) -> bool {
        let near = parameters.value(Item::MaximumDifference, place) as f64;
        let difference = digits - self.measured.round();
        if self.samples.is_empty() || parameters.rules.is_near(difference, near) {
            self.discarding = self.discarding.filter(|_| !parameters.rules.rejection_begins_anew());
            return true;
        }
        let tenths = parameters.value(Item::MaximumRejection, place).max(0) as u64;
        let since = *self.discarding.get_or_insert(now);
        if now.since(since) < Duration::from_millis(100 * tenths) {
            return false;
        }
        self.discarding = None;
        self.samples.clear();
        true
    }

    /// Whether another sample like this one would change nothing, now and after a step.
    fn is_settled(&self, sample: Sample, kept: usize) -> bool {
        match sample {
            Sample::Off => self.off && self.value == 0,
            Sample::OutOfRange(end) => self.out_of_range && self.value == shown(end),
            Sample::Valid(digits) => {
                let known = !self.samples.is_empty() && self.discarding.is_none();
                let known = known && !self.out_of_range && !self.off;
                let known = known && self.samples.len() >= kept;
                known && self.samples.iter().all(|sample| *sample == digits)
            }
        }
    }
}

/// How many samples the average has, once it has all of them.
fn wanted(place: usize, parameters: Parameters) -> usize {
    parameters.value(Item::Filter, place).max(1) as usize
}

/// Digits as an object can hold them.
fn shown(digits: f64) -> i64 {
    (digits.round() as i64).clamp(-i64::from(i16::MAX), i64::from(i16::MAX))
}

/// The first multiple of the period after `now`.
fn after(now: Instant, period: Duration) -> Instant {
    let period = period.as_nanos() as u64;
    Instant((now.0 / period + 1) * period)
}

/// From one sample to the next, for a code of the conversion frequency.
fn period(code: i64) -> Duration {
    let hertz = usize::try_from(code).ok().and_then(|code| HERTZ.get(code)).unwrap_or(&17);
    Duration::from_secs(1) / *hertz
}

/// The frequencies by their codes; the last one is that of the small models, see
/// [`SMALL_FREQUENCY`](super::parameters::SMALL_FREQUENCY).
const HERTZ: [u32; 15] = [4, 6, 8, 10, 12, 17, 20, 33, 39, 50, 62, 123, 242, 470, 100];

#[cfg(test)]
mod tests {
    use canopen::Dictionary;

    use super::*;
    use crate::devices::mcm260x::parameters::{Table, parameters_only};
    use crate::devices::mcm260x::rules::Mcm260xRules;

    struct Bench {
        od: Dictionary,
        input: AnalogueInput,
    }

    impl Bench {
        /// 0 to 10 V on the third input, 0 to 1000 digits, and what is set.
        fn with(settings: &[(Item, i64)]) -> Self {
            let mut od = parameters_only();
            for (item, value) in [&[(Item::SensorType, 17)], settings].concat() {
                od.set_int(Table::Analogue.address(item, 2).unwrap(), value);
            }
            let mut bench = Self { od, input: AnalogueInput::default() };
            bench.at(0, 0.0);
            bench
        }

        /// Applies `volts` from this millisecond on; returns the value then.
        fn at(&mut self, millisecond: u64, volts: f64) -> i64 {
            self.run(millisecond);
            self.input.connected.millivolts = volts * 1000.0;
            self.run(millisecond);
            self.input.value
        }

        fn run(&mut self, millisecond: u64) {
            self.run_by(&Mcm260xRules::plain(), millisecond);
        }

        fn run_by(&mut self, rules: &Mcm260xRules, millisecond: u64) {
            let until = Instant(millisecond * 1_000_000);
            let parameters = Parameters { table: Table::Analogue, od: &self.od, rules };
            while let Some(due) = self.input.poll_at().filter(|due| *due < until) {
                self.input.follow(due, false, (2, 25.0), parameters);
            }
            self.input.follow(until, true, (2, 25.0), parameters);
        }

        fn value_at(&mut self, millisecond: u64) -> i64 {
            self.run(millisecond);
            self.input.value
        }
    }

    #[test]
    fn the_filter_averages_so_many_samples_at_the_frequency_of_the_pair() {
        let items = [(Item::Filter, 4), (Item::Frequency, 3), (Item::MaximumDifference, 32767)];
        let mut bench = Bench::with(&items);
        bench.at(50, 8.0);
        let seen = [99, 100, 199, 200, 300, 400, 900].map(|at| bench.value_at(at));
        assert_eq!(seen, [0, 200, 200, 400, 600, 800, 800]);
        assert_eq!(bench.input.poll_at(), None, "settled");
    }

    #[test]
    fn a_sample_far_away_is_discarded_until_it_has_been_for_too_long() {
        let items = [(Item::Filter, 1), (Item::Frequency, 3), (Item::MaximumRejection, 5)];
        let mut bench = Bench::with(&items);
        assert_eq!((bench.at(50, 0.3), bench.value_at(100)), (0, 30), "as far as it may be");
        bench.at(150, 0.61);
        assert_eq!([200, 699, 700].map(|at| bench.value_at(at)), [30, 30, 61]);
        bench.at(750, 5.0);
        assert_eq!(bench.value_at(1200), 61);
        bench.at(1210, 0.61);
        bench.at(1410, 5.0);
        assert_eq!([1900, 1999, 2000].map(|at| bench.value_at(at)), [61, 61, 500]);
    }

    #[test]
    fn an_offset_is_no_step_of_the_signal() {
        let mut bench = Bench::with(&[(Item::Frequency, 3)]);
        bench.od.set_int(Table::Analogue.address(Item::Offset, 2).unwrap(), 240);
        assert_eq!(bench.value_at(150), 240, "further than a sample may be away");
        bench.at(250, 0.2);
        assert_eq!(bench.value_at(2000), 260);
        assert_eq!(bench.input.poll_at(), None, "settled");
    }

    #[test]
    fn an_error_shows_with_the_next_sample_and_ends_with_one() {
        let mut bench = Bench::with(&[(Item::Frequency, 3)]);
        bench.at(50, 12.0);
        bench.run(99);
        assert!(!bench.input.is_out_of_range());
        assert_eq!((bench.value_at(100), bench.input.is_out_of_range()), (1000, true));
        bench.at(150, 2.0);
        assert_eq!((bench.value_at(200), bench.input.is_out_of_range()), (200, false));
        bench.od.set_int(Table::Analogue.address(Item::SensorType, 2).unwrap(), 0);
        assert_eq!((bench.value_at(250), bench.input.is_off()), (0, true));
    }

    #[test]
    fn a_new_frequency_may_wait_for_the_sample_under_way() {
        let items = [(Item::Filter, 1), (Item::Frequency, 3), (Item::MaximumDifference, 32767)];
        let seen = |rules: &Mcm260xRules| {
            let mut bench = Bench::with(&items);
            bench.run_by(rules, 110);
            bench.od.set_int(Table::Analogue.address(Item::Frequency, 2).unwrap(), 13);
            bench.input.connected.millivolts = 5000.0;
            bench.run_by(rules, 120);
            [150, 199, 200].map(|at| {
                bench.run_by(rules, at);
                bench.input.value
            })
        };
        assert_eq!(seen(&Mcm260xRules::plain()), [500, 500, 500]);
        let waits = Mcm260xRules::otherwise("sample-under-way-ends: true");
        assert_eq!(seen(&waits), [0, 0, 500]);
    }

    #[test]
    fn the_codes_of_the_frequency() {
        let codes: Vec<u128> = (0..14).map(|code| period(code).as_micros()).collect();
        let hertz = [4, 6, 8, 10, 12, 17, 20, 33, 39, 50, 62, 123, 242, 470];
        assert_eq!(codes, hertz.map(|hertz: u128| 1_000_000 / hertz));
    }
}
