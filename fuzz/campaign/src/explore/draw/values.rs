//! Values of settings and stimuli, and times.

use std::time::Duration;

use canopen::Mux;
use canopen::eds::Term;

use super::{Draw, LONGEST_ON_BUS};
use crate::explore::shift::CYCLE;
use crate::surface::{PROCESS, Setting, Unit, Values};

/// The sorts of values. Each of a few codes is a sort of its own, from 16 on.
const LOW: u8 = 0;
const HIGH: u8 = 1;
const NEAR_LOW: u8 = 2;
const NEAR_HIGH: u8 = 3;
const NOTHING: u8 = 4;
const NEGATIVE: u8 = 5;
pub(super) const POSITIVE: u8 = 6;
pub(super) const USUAL_VALUE: u8 = 7;
const OUTSIDE: u8 = 8;
/// What marks a state in a pair.
pub(super) const STATES: u16 = 0x8000;
/// What marks a known session in a pair.
pub(super) const KNOWN: u16 = 0x4000;

impl Draw<'_> {
    /// A value of a stimulus.
    pub(super) fn level(&mut self, source: usize) -> String {
        let (low, high, process) = match &self.surface.stimuli[source].values {
            Values::Words(words) => return words[self.below(words.len())].to_owned(),
            Values::Whole(low, high) if *high <= 255 => {
                let (low, high) = (*low, *high);
                return self.within(low, high).to_string();
            }
            Values::Whole(low, high) => (*low as f64, *high as f64, None),
            Values::Real { low, high, process } => (*low, *high, *process),
        };
        let is_whole = matches!(self.surface.stimuli[source].values, Values::Whole(..));
        let number = match self.below(20) {
            0 => low,
            1 => high,
            2 if process.is_some() => return PROCESS.to_owned(),
            2 => 0.0,
            3..=10 => self.around_settings(),
            11..=15 => {
                let magnitude = self.magnitude(low.abs().max(high.abs()));
                if low < 0.0 && self.chance(1, 4) { -magnitude } else { magnitude }
            }
            _ => {
                let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
                low + share * (high - low)
            }
        };
        let number = number.clamp(low, high);
        let digits = if self.chance(1, 3) { 100.0 } else { 10.0 };
        let number = (number * digits).round() / digits;
        // What rounding has moved out of the range.
        let number = number.clamp(low, high);
        if is_whole { format!("{}", number as i64) } else { format!("{number}") }
    }

    /// A number as the settings have it: what one of them is, or the sum or difference of up to
    /// three that were written, as thresholds with a hysteresis around a set point are.
    fn around_settings(&mut self) -> f64 {
        let first = self.around_a_setting();
        if self.written.len() < 2 || self.chance(2, 3) {
            return first;
        }
        let mut sum = first;
        for _ in 0..1 + self.below(2) {
            let place = self.below(self.written.len());
            let Some((place, value)) = self.written.iter().nth(place) else { break };
            let part = *value as f64 * self.surface.settings[*place].scale;
            sum += if self.chance(1, 2) { part } else { -part };
        }
        sum
    }

    /// A number as one of the settings has it, in some unit, or one beside it.
    fn around_a_setting(&mut self) -> f64 {
        let written = self.written.len();
        let place = match written > 0 && self.chance(4, 5) {
            true => {
                let place = self.below(written);
                self.written.keys().nth(place).copied().unwrap_or(0)
            }
            false => self.below(self.surface.settings.len()),
        };
        let setting = &self.surface.settings[place];
        let value = self.written.get(&place).copied().or_else(|| self.default_of(place));
        let value = value.unwrap_or(0) as f64 * setting.scale;
        let factors = [1.0, 1.0, 1.0, 1.0, 0.1, 0.01, 10.0, 100.0, 1000.0];
        let factor = factors[self.below(factors.len())];
        let besides = [0.0, 0.0, 0.1, -0.1, 1.0, -1.0, 5.0, -5.0, 0.5];
        value * factor + besides[self.below(besides.len())]
    }

    /// A number up to `most`, of each order of magnitude as often.
    fn magnitude(&mut self, most: f64) -> f64 {
        let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
        (most.max(1.0) * 10.0).powf(share) / 10.0
    }

    /// A time that is short, and long enough for what a device must see.
    pub(super) fn brief(&mut self) -> Duration {
        let times = [2, 5, 20, 20, 100, 100, 300, 1000];
        let time = Duration::from_millis(times[self.below(times.len())]);
        time.max(self.shortest())
    }

    /// How long a stimulus lasts at least: nobody knows whether a device in its own time has seen
    /// what was there for less than a cycle of control. Half a cycle more is for the way to it.
    pub(super) fn shortest(&self) -> Duration {
        if self.longest == LONGEST_ON_BUS { CYCLE * 3 / 2 } else { Duration::ZERO }
    }

    /// A time to wait, and whether one of the settings is about it.
    pub(super) fn time(&mut self) -> (Duration, bool) {
        let share = f64::from(self.bytes.arbitrary::<u16>().unwrap_or(0)) / 65535.0;
        let between = |low: f64, high: f64| low * (high / low).powf(share);
        let mut is_known = false;
        let seconds = match self.below(20) {
            0..=4 => between(0.001, 0.1),
            5..=9 => between(0.1, 5.0),
            10..=15 => match self.known_time() {
                Some(seconds) => {
                    is_known = true;
                    let factors = [0.5, 0.97, 1.0, 1.03, 1.2, 2.1];
                    seconds * factors[self.below(factors.len())]
                }
                None => between(0.5, 20.0),
            },
            16 | 17 => between(5.0, 120.0),
            18 => between(60.0, 900.0),
            _ => between(300.0, 7200.0),
        };
        let time = Duration::from_micros((seconds * 1e6) as u64);
        (time.max(Duration::from_micros(100)), is_known)
    }

    /// The time that one of the settings is: one that was written, or one beside those, which has
    /// its default.
    pub(super) fn known_time(&mut self) -> Option<f64> {
        let settings = &self.surface.settings;
        let time = |place: usize, value: i64| {
            let setting = &settings[place];
            let is_time = setting.unit == Unit::Seconds && value != 0;
            is_time.then(|| value.unsigned_abs() as f64 * setting.scale)
        };
        let written = self.written.iter();
        let mut times: Vec<f64> =
            written.filter_map(|(place, value)| time(*place, *value)).collect();
        if times.is_empty() || self.chance(1, 4) {
            let settings = &self.surface.settings;
            let beside = |place: usize| place.saturating_sub(BESIDE)..=place + BESIDE;
            let beside = self.written.keys().flat_map(|place| beside(*place));
            let beside = beside.filter(|place| *place < settings.len());
            times.extend(beside.filter_map(|place| time(place, self.default_of(place)?)));
        }
        (!times.is_empty()).then(|| times[self.below(times.len())])
    }

    /// A value for a setting, and its sort.
    pub(super) fn value(&mut self, place: usize) -> (i64, u8) {
        let setting = &self.surface.settings[place];
        if let Some(value) = self.of_communication(setting) {
            return value;
        }
        if !setting.entry.data_type.is_integer() && setting.entry.data_type.size() == Some(4) {
            return self.real(place);
        }
        let bound =
            |term: &Option<Term>| i64::try_from(term.as_ref()?.resolve(self.node).as_int()?).ok();
        let limits = setting.entry.data_type.limits().unwrap_or((0, 1));
        let bounds = (bound(&setting.entry.low), bound(&setting.entry.high));
        let is_free = bounds == (None, None);
        let low = bounds.0.unwrap_or(limits.0 as i64);
        let high = bounds.1.unwrap_or(limits.1 as i64);
        if high - low <= FEW {
            return self.one_of_few(low, high, limits);
        }
        let value = match self.below(if is_free { 23 } else { 20 }) {
            0 => low,
            1 => high,
            2 => low + 1,
            3 => high - 1,
            4 if (low..=high).contains(&0) => 0,
            5 => self.default_of(place).unwrap_or(low),
            6 => {
                let outside = if self.chance(1, 2) { low - 1 } else { high + 1 };
                let fits = (limits.0..=limits.1).contains(&i128::from(outside));
                if fits { outside } else { low }
            }
            7..=9 => self.like_another(low, high),
            10 | 11 => self.within(low, high),
            12..=19 => self.sized(low, high),
            20 => 1_i64.checked_shl(self.below(32) as u32).unwrap_or(1),
            21 if setting.entry.data_type.size() == Some(1) => self.within(0, 255),
            21 => self.within(0, 31),
            _ => self.link(place),
        };
        (value, sort(value, low, high, self.default_of(place)))
    }

    fn one_of_few(&mut self, low: i64, high: i64, limits: (i128, i128)) -> (i64, u8) {
        if self.chance(1, 25) {
            let outside = if self.chance(1, 3) { low - 1 } else { high + 1 };
            if (limits.0..=limits.1).contains(&i128::from(outside)) {
                return (outside, OUTSIDE);
            }
        }
        let value = self.within(low, high);
        // Each of a few codes is a sort of its own.
        (value, 16 + (value - low) as u8)
    }

    /// A value of each order of magnitude as often.
    fn sized(&mut self, low: i64, high: i64) -> i64 {
        let most = low.unsigned_abs().max(high.unsigned_abs());
        let magnitude = self.magnitude(most as f64) as i64;
        let negative = low < 0 && self.chance(2, 5);
        (if negative { -magnitude } else { magnitude }).clamp(low, high)
    }

    /// A value a little beside the present one; `None` where it is not known.
    pub(super) fn nudged(&mut self, place: usize) -> Option<i64> {
        let present = *self.written.get(&place)?;
        let steps = [1, -1, 2, -2, 5, -5, 10, -10, 50, -50];
        Some(present.saturating_add(steps[self.below(steps.len())]))
    }

    /// The value of another setting, or one beside it.
    fn like_another(&mut self, low: i64, high: i64) -> i64 {
        if self.written.is_empty() {
            return self.sized(low, high);
        }
        let place = self.below(self.written.len());
        let value = self.written.values().nth(place).copied().unwrap_or(0);
        let besides = [0, 0, 1, -1, 5, -5, 50, -50];
        value.saturating_add(besides[self.below(besides.len())]).clamp(low, high)
    }

    /// An object of the application, as a mapping entry names it.
    fn link(&mut self, place: usize) -> i64 {
        let is_wide = self.surface.settings[place].entry.data_type.size() == Some(4);
        if !is_wide || self.surface.moving.is_empty() {
            return self.within(0, 255);
        }
        let mux = match self.chance(1, 3) {
            true => self.surface.settings[self.below(self.surface.settings.len())].entry.mux,
            false => self.surface.moving[self.below(self.surface.moving.len())],
        };
        let bits = self.surface.bits(mux);
        i64::from(mux.index) << 16 | i64::from(mux.sub) << 8 | bits
    }

    fn real(&mut self, place: usize) -> (i64, u8) {
        let default = self.surface.settings[place].entry.default.as_ref();
        let default = default.and_then(|it| it.resolve(self.node).as_real()).unwrap_or(1.0);
        let factors = [0.0, 0.5, 1.0, 2.0, 10.0, 0.1, -1.0, 1000.0];
        let number = match self.chance(2, 3) {
            true => default * factors[self.below(factors.len())],
            false => self.magnitude(1000.0),
        };
        let sort = if number < 0.0 { NEGATIVE } else { POSITIVE };
        (i64::from((number as f32).to_bits()), sort)
    }

    /// A value of what belongs to the communication.
    fn of_communication(&mut self, setting: &Setting) -> Option<(i64, u8)> {
        let Mux { index, sub } = setting.entry.mux;
        let drawn: &[i64] = match (index, sub) {
            (0x1006, _) => &[0, 10_000, 100_000],
            (0x100C, _) => &[0, 100, 500, 1000],
            (0x100D, _) => &[0, 1, 2, 3],
            (0x1015, _) => &[0, 0, 10, 1000],
            (0x1017, _) => &[0, 100, 1000, 5000],
            (0x1016, _) => &[0, 0x7D_0064, 0x7D_01F4, 0x7D_07D0, 0x7C_0064, 0x7C_01F4],
            (0x1029, _) => &[0, 1, 2],
            (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => &[0, 1, 2, 10, 252, 253, 254, 255, 255],
            (0x1400..=0x15FF | 0x1800..=0x19FF, _) => &[0, 0, 100, 500, 1000],
            _ => return None,
        };
        let place = self.below(drawn.len());
        Some((drawn[place], 16 + place as u8))
    }
}

/// How many codes are each of a sort of its own.
const FEW: i64 = 32;
/// How near the settings are that may belong to one.
const BESIDE: usize = 6;

fn sort(value: i64, low: i64, high: i64, default: Option<i64>) -> u8 {
    match value {
        _ if value < low || value > high => OUTSIDE,
        _ if value == low => LOW,
        _ if value == high => HIGH,
        _ if Some(value) == default => USUAL_VALUE,
        0 => NOTHING,
        _ if value == low + 1 => NEAR_LOW,
        _ if value == high - 1 => NEAR_HIGH,
        _ if value < 0 => NEGATIVE,
        _ => POSITIVE,
    }
}
