//! The objects with the data of the function blocks (chapters 2.3 and 2.4).

use std::time::Duration;

use canopen::{Dictionary, Mux};

use super::rules::Ax021211Rules;
use super::signal::Link;

/// Digital outputs.
pub(super) const WRITE_STATES: Mux = Mux::new(0x6200, 1);
pub(super) const POLARITIES: Mux = Mux::new(0x6202, 1);
pub(super) const DIGITAL_FAULT_MODE: u16 = 0x6250;
pub(super) const DIGITAL_FAULT_STATE: u16 = 0x6260;
pub(super) const HOTSHOT_CURRENT: u16 = 0x2220;
pub(super) const HOLD_CURRENT: u16 = 0x2221;
pub(super) const HOTSHOT_TIME: u16 = 0x2222;
pub(super) const DELAY_TIME: u16 = 0x2224;
pub(super) const BLINK_RATE: u16 = 0x2223;
pub(super) const DELAY_POLARITY: u16 = 0x2225;

/// Analogue outputs.
pub(super) const PROCESS_VALUE: u16 = 0x7300;
pub(super) const DIGITS_PV: u16 = 0x6302;
pub(super) const OUTPUT_TYPE: u16 = 0x6310;
pub(super) const SCALING_1_PV: u16 = 0x7320;
pub(super) const SCALING_1_FV: u16 = 0x7321;
pub(super) const SCALING_2_PV: u16 = 0x7322;
pub(super) const SCALING_2_FV: u16 = 0x7323;
pub(super) const FIELD_VALUE: u16 = 0x7330;
pub(super) const DIGITS_FV: u16 = 0x6332;
pub(super) const FAULT_MODE: u16 = 0x6340;
pub(super) const FAULT_FV: u16 = 0x7341;
pub(super) const OVERRIDE_FV: u16 = 0x2300;
pub(super) const DETECTION: u16 = 0x2310;
pub(super) const HYSTERESIS: u16 = 0x2311;
pub(super) const REACTION_DELAY: u16 = 0x2312;
pub(super) const DITHER_FREQUENCY: u16 = 0x2320;
pub(super) const DITHER_AMPLITUDE: u16 = 0x2321;
pub(super) const RAMP_UP: u16 = 0x2330;
pub(super) const RAMP_DOWN: u16 = 0x2331;
pub(super) const CONTROL_SOURCE: u16 = 0x2340;
pub(super) const CONTROL_NUMBER: u16 = 0x2341;
pub(super) const CONTROL_RESPONSE: u16 = 0x2342;
pub(super) const ENABLE_SOURCE: u16 = 0x2350;
pub(super) const ENABLE_NUMBER: u16 = 0x2351;
pub(super) const ENABLE_RESPONSE: u16 = 0x2352;
pub(super) const OVERRIDE_SOURCE: u16 = 0x2360;
pub(super) const OVERRIDE_NUMBER: u16 = 0x2361;
pub(super) const OVERRIDE_RESPONSE: u16 = 0x2362;
pub(super) const FEEDBACK: u16 = 0x2370;
pub(super) const OUTPUT_FREQUENCY: u16 = 0x2380;
pub(super) const STATIC_BIAS: u16 = 0x2390;

/// Received process values that wait for their validation (2.3.16, 2.3.17).
pub(super) const RECEIVED: u16 = 0x7F50;
pub(super) const RECEIVED_STATUS: u16 = 0x6F52;

/// Extra received process values.
pub(super) const EXTRA: u16 = 0x2500;
pub(super) const EXTRA_DIGITS: u16 = 0x2502;
pub(super) const EXTRA_SCALING_1: u16 = 0x2520;
pub(super) const EXTRA_SCALING_2: u16 = 0x2522;

/// PID control.
pub(super) const PID_GAIN: u16 = 0x7450;
pub(super) const PID_INTEGRAL_TIME: u16 = 0x7452;
pub(super) const PID_DERIVATIVE_TIME: u16 = 0x7454;
pub(super) const PID_CYCLE: u16 = 0x7456;
pub(super) const PID_DIGITS: u16 = 0x6459;
pub(super) const PID_TOLERANCE: u16 = 0x2450;
pub(super) const PID_INTEGRAL_GAIN: u16 = 0x2451;
pub(super) const PID_DERIVATIVE_GAIN: u16 = 0x2452;
pub(super) const PID_TARGET_SOURCE: u16 = 0x2453;
pub(super) const PID_TARGET_NUMBER: u16 = 0x2454;
pub(super) const PID_FEEDBACK_SOURCE: u16 = 0x2455;
pub(super) const PID_FEEDBACK_NUMBER: u16 = 0x2456;
pub(super) const PID_RESPONSE: u16 = 0x2457;
pub(super) const PID_OUTPUT: u16 = 0x2460;

/// Logic.
pub(super) const LOGIC_ENABLE: u16 = 0x3300;
pub(super) const SELECTED_TABLE: u16 = 0x3310;
pub(super) const LOGIC_OUTPUT: u16 = 0x3320;

/// Math.
pub(super) const MATH_ENABLE: u16 = 0x4000;
pub(super) const MATH_SCALING_1: u16 = 0x4021;
pub(super) const MATH_SCALING_2: u16 = 0x4023;
pub(super) const MATH_OUTPUT: u16 = 0x4030;
pub(super) const MATH_DIGITS: u16 = 0x4032;

/// The rest.
pub(super) const CONSTANTS: u16 = 0x5010;
pub(super) const SUPPLY: Mux = Mux::new(0x5020, 0);
pub(super) const TEMPERATURE: Mux = Mux::new(0x5030, 0);
pub(super) const AUTOMATIC_UPDATES: Mux = Mux::new(0x5550, 0);

/// The objects of a lookup table, 3yz0h to 3yz8h, by its place from 0 on: the last digit of its
/// number is a digit of the index.
pub(super) const fn table(place: usize, item: u16) -> u16 {
    let number = place as u16 + 1;
    0x3000 + (number / 10) * 0x100 + (number % 10) * 0x10 + item
}

/// The place of the lookup table that an index belongs to, and which of its objects it is.
pub(super) fn table_of(index: u16) -> Option<(usize, u16)> {
    let [tens, ones, item] = [index >> 8, index >> 4 & 0x0F, index & 0x0F];
    let number = 10 * tens.checked_sub(0x30)? + ones;
    let exists = ones <= 9 && matches!(number, 1..=12) && item <= 8;
    exists.then(|| (usize::from(number) - 1, item))
}

/// The objects of a logic block, 3x01h to 3x33h with x from 4 on, by its place from 0 on.
pub(super) const fn logic(place: usize, item: u16) -> u16 {
    0x3400 + place as u16 * 0x100 + item
}

/// The objects of the inputs of a math block, 4y00h to 4y50h, by its place from 0 on.
pub(super) const fn math(place: usize, item: u16) -> u16 {
    0x4100 + place as u16 * 0x100 + item
}

/// The parameters of the function blocks.
#[derive(Clone, Copy)]
pub(super) struct Parameters<'a> {
    pub(super) od: &'a Dictionary,
    pub(super) rules: &'a Ax021211Rules,
}

impl Parameters<'_> {
    /// The number at a sub-index that counts places from 1 on; 0 where there is none.
    pub(super) fn int(self, index: u16, place: usize) -> i64 {
        let mux = Mux::new(index, self.rules.place(index, place) as u8 + 1);
        self.rules.parameter(mux, self.od.int(mux).unwrap_or(0))
    }

    /// A number that has no negative values and fits a byte.
    pub(super) fn byte(self, index: u16, place: usize) -> u8 {
        self.int(index, place) as u8
    }

    /// A number of milliseconds.
    pub(super) fn time(self, index: u16, place: usize) -> Duration {
        Duration::from_millis(self.int(index, place).max(0).unsigned_abs())
    }

    /// Whether the first byte is not zero, which for `BOOLEAN` means true.
    pub(super) fn flag(self, index: u16, place: usize) -> bool {
        let mux = Mux::new(index, self.rules.place(index, place) as u8 + 1);
        let byte = self.od.get(mux).and_then(<[u8]>::first).copied().unwrap_or(0);
        self.rules.parameter(mux, byte.into()) != 0
    }

    /// The `REAL32` there.
    pub(super) fn real(self, index: u16, place: usize) -> f64 {
        let mux = Mux::new(index, self.rules.place(index, place) as u8 + 1);
        let bytes = self.od.get(mux).and_then(<[u8]>::first_chunk);
        bytes.map_or(0.0, |bytes| f32::from_le_bytes(*bytes).into())
    }

    /// The value of a number with digits after the decimal point.
    pub(super) fn scaled(self, index: u16, place: usize, digits: u8) -> f64 {
        self.int(index, place) as f64 / power(digits)
    }

    /// The number of an object without sub-indices.
    pub(super) fn var(self, index: u16) -> i64 {
        let mux = Mux::new(index, 0);
        self.rules.parameter(mux, self.od.int(mux).unwrap_or(0))
    }

    /// The link that a source and a number select.
    pub(super) fn link(self, source: u16, number: u16, place: usize) -> Link {
        Link::new(self.byte(source, place), self.byte(number, place))
    }
}

/// Ten to the power of a number of decimal digits.
pub(super) fn power(digits: u8) -> f64 {
    POWERS.get(usize::from(digits)).copied().unwrap_or_else(|| 10_f64.powi(digits.into()))
}

/// A value as an `INTEGER16` with that many digits: rounded, and held at the ends of the range.
pub(super) fn digits(value: f64, digits: u8) -> i64 {
    let scaled = (value * power(digits)).clamp(i16::MIN.into(), i16::MAX.into());
    // Rounded as `f64::round` does, which is a call of a library.
    let whole = scaled as i64;
    let rest = scaled - whole as f64;
    whole + i64::from(rest >= 0.5) - i64::from(rest <= -0.5)
}

/// The powers for all decimal digits that an object accepts.
const POWERS: [f64; 5] = [1.0, 10.0, 100.0, 1000.0, 10_000.0];

/// Shows a number where it is another one.
pub(super) fn show(od: &mut Dictionary, mux: Mux, number: i64) {
    if od.int(mux).is_some_and(|shown| shown != number) {
        od.set_int(mux, number);
    }
}

/// Shows a `REAL32` where it is another one.
pub(super) fn show_real(od: &mut Dictionary, mux: Mux, number: f64) {
    let bytes = (number as f32).to_le_bytes();
    if od.get(mux).is_some_and(|shown| shown != bytes) {
        od.set(mux, &bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digits_of_a_number_make_the_index() {
        assert_eq!(table(0, 0), 0x3010);
        assert_eq!(table(8, 8), 0x3098);
        assert_eq!(table(9, 0), 0x3100);
        assert_eq!(table(11, 7), 0x3127);
        assert_eq!(table_of(0x3126), Some((11, 6)));
        assert_eq!(table_of(0x30A0), None);
        assert_eq!(table_of(0x3129), None);
        assert_eq!(logic(0, 0x01), 0x3401);
        assert_eq!(logic(3, 0x33), 0x3733);
        assert_eq!(math(5, 0x50), 0x4650);
    }

    #[test]
    fn a_value_is_rounded_and_held_within_its_type() {
        assert_eq!(digits(12.345, 2), 1235);
        assert_eq!(digits(-0.06, 1), -1);
        assert_eq!(digits(1e6, 0), 32_767);
        assert_eq!(digits(-1e6, 1), -32_768);
    }
}
