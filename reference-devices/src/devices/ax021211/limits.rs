//! Refusals beyond the data sheet: ranges that depend on other objects.

use canopen::{Abort, Dictionary, Mux};

use super::network::Network;
use super::objects::{
    CONTROL_NUMBER, DIGITS_FV, ENABLE_NUMBER, FAULT_FV, OVERRIDE_FV, OVERRIDE_NUMBER,
    PID_FEEDBACK_NUMBER, PID_TARGET_NUMBER, power,
};
use super::objects::{
    EXTRA_SCALING_1, EXTRA_SCALING_2, HOLD_CURRENT, HOTSHOT_CURRENT, HYSTERESIS, OUTPUT_TYPE,
    PID_CYCLE, PID_DERIVATIVE_TIME, PID_DIGITS, PID_INTEGRAL_TIME, SCALING_1_FV, SCALING_1_PV,
    SCALING_2_FV, SCALING_2_PV, STATIC_BIAS, table, table_of,
};
use super::output::Kind;
use super::rules::Ax021211Rules;
use super::signal::{Link, SUPPLY};

/// Whether a value may be written.
///
/// # Errors
/// [`Abort::VALUE`] for a value between those of a list, [`Abort::TOO_LOW`] and
/// [`Abort::TOO_HIGH`] beyond a range.
pub(super) fn check(
    mux: Mux,
    bytes: &[u8],
    od: &Dictionary,
    (network, rules): (&Network, &Ax021211Rules),
) -> Result<(), Abort> {
    let is_var = mux.index == HEARTBEAT || matches!(table_of(mux.index), Some((_, 1)));
    let Some(value) = number(bytes).filter(|_| mux.sub > 0 || is_var) else {
        return Ok(());
    };
    let other = |index| od.int(Mux::new(index, mux.sub)).unwrap_or(0);
    match mux.index {
        HEARTBEAT if (1..10).contains(&(value & 0xFFFF)) => Err(Abort::VALUE),
        OUTPUT_TYPE if Kind::of(value & 0xFFFF).is_none() => Err(Abort::VALUE),
        SCALING_1_PV => below(value, other(SCALING_2_PV)),
        SCALING_2_PV => above(value, other(SCALING_1_PV)),
        EXTRA_SCALING_1 => below(value, other(EXTRA_SCALING_2)),
        EXTRA_SCALING_2 => above(value, other(EXTRA_SCALING_1)),
        SCALING_1_FV | SCALING_2_FV | FAULT_FV | OVERRIDE_FV | STATIC_BIAS => {
            within(value, 0, largest_fv(mux.sub, od))
        }
        HYSTERESIS => {
            let largest = rules.larger_scaling(other(SCALING_1_FV), other(SCALING_2_FV));
            within(value, 0, largest / 10)
        }
        HOTSHOT_CURRENT => {
            let digits = od.int(Mux::new(DIGITS_FV, mux.sub)).unwrap_or(0) as u8;
            within(value, other(HOLD_CURRENT), (2500.0 * power(digits)) as i64)
        }
        HOLD_CURRENT => within(value, 0, other(HOTSHOT_CURRENT)),
        PID_INTEGRAL_TIME | PID_DERIVATIVE_TIME | PID_CYCLE => {
            let unit = power(other(PID_DIGITS) as u8);
            let lowest = (0.001 * unit).ceil().max(1.0);
            within(value, lowest as i64, (1000.0 * unit) as i64)
        }
        index => match (source_of(mux), table_of(index)) {
            (Some(source), _) => within(value, 0, largest_number(od.int(source).unwrap_or(0))),
            (None, Some((place, 6))) => check_x(place, mux.sub, value, od, (network, rules)),
            _ => Ok(()),
        },
    }
}

/// Where the source stands whose number an address holds (table 5).
pub(super) fn source_of(mux: Mux) -> Option<Mux> {
    let index = mux.index;
    let is_table = matches!(table_of(index), Some((_, 1)));
    let [function, condition] = [index >> 4 & 0xF, index & 0xF];
    let is_argument = matches!(index, 0x3411..=0x3733)
        && matches!((function, condition, mux.sub), (1..=3, 1..=3, 2 | 4));
    let is_math = matches!(index, 0x4101 | 0x4201 | 0x4301 | 0x4401 | 0x4501 | 0x4601);
    match index {
        CONTROL_NUMBER | ENABLE_NUMBER | OVERRIDE_NUMBER => Some(Mux::new(index - 1, mux.sub)),
        PID_TARGET_NUMBER | PID_FEEDBACK_NUMBER => Some(Mux::new(index - 1, mux.sub)),
        _ if is_table || is_math => Some(Mux::new(index - 1, mux.sub)),
        _ if is_argument => Some(Mux::new(index, mux.sub - 1)),
        _ => None,
    }
}

/// The largest number of a source (table 5). A source without numbers takes any of them, as the
/// defaults have numbers for sources that are not used.
fn largest_number(source: i64) -> i64 {
    let count = (1..=LARGEST_NUMBER).rev().find(|number| {
        let named = Link::new(source as u8, *number).place();
        named.is_some_and(|place| place < SUPPLY)
    });
    count.unwrap_or(LARGEST_NUMBER).into()
}

/// The points of an X-axis (1.5.1, 1.5.4).
fn check_x(
    place: usize,
    sub: u8,
    value: i64,
    od: &Dictionary,
    (network, rules): (&Network, &Ax021211Rules),
) -> Result<(), Abort> {
    let int = |item, sub| od.int(Mux::new(table(place, item), sub));
    if int(5, 1) == Some(1) {
        return within(value, i64::from(sub > 1), LONGEST_INTERVAL);
    }
    let scaled = |value: f64| value * power(int(3, 0).unwrap_or(0) as u8);
    let limits =
        rules.x_limits(network.x_limits(place)).map(|(low, high)| (scaled(low), scaled(high)));
    let (low, high) = limits.unwrap_or(WIDEST);
    match sub {
        1 if (value as f64) < low => return Err(Abort::TOO_LOW),
        11 if value as f64 > high => return Err(Abort::TOO_HIGH),
        _ => {}
    }
    let point = |sub| od.int(Mux::new(table(rules.neighbours(place), 6), sub));
    let low = if sub > 1 { point(sub - 1) } else { None };
    let high = if sub < 11 { point(sub + 1) } else { None };
    let (low, high) = rules.x_range(low.unwrap_or(i64::MIN), high.unwrap_or(i64::MAX));
    within(value, low, high)
}

/// The largest field value of an output, in its digits (table 3).
fn largest_fv(sub: u8, od: &Dictionary) -> i64 {
    let int = |index| od.int(Mux::new(index, sub)).unwrap_or(0);
    let kind = Kind::of(int(OUTPUT_TYPE)).unwrap_or_default();
    match kind {
        // Without a type there is no range.
        Kind::Disabled => i16::MAX.into(),
        _ => (kind.largest() * power(int(DIGITS_FV) as u8)) as i64,
    }
}

fn within(value: i64, low: i64, high: i64) -> Result<(), Abort> {
    match value {
        _ if value < low => Err(Abort::TOO_LOW),
        _ if value > high => Err(Abort::TOO_HIGH),
        _ => Ok(()),
    }
}

fn below(value: i64, high: i64) -> Result<(), Abort> {
    if value < high { Ok(()) } else { Err(Abort::TOO_HIGH) }
}

fn above(value: i64, low: i64) -> Result<(), Abort> {
    if value > low { Ok(()) } else { Err(Abort::TOO_LOW) }
}

/// A whole number with a sign, of one, two or four bytes.
fn number(bytes: &[u8]) -> Option<i64> {
    Some(match *bytes {
        [byte] => byte.into(),
        [low, high] => i16::from_le_bytes([low, high]).into(),
        [a, b, c, d] => i32::from_le_bytes([a, b, c, d]).into(),
        _ => return None,
    })
}

/// The range of an X-axis whose source has no limits.
const WIDEST: (f64, f64) = (i16::MIN as f64, i16::MAX as f64);
/// CANopen messages have the most numbers (table 5).
const LARGEST_NUMBER: u8 = 24;
/// Producer heartbeat time.
const HEARTBEAT: u16 = 0x1017;
/// 24 hours in milliseconds (1.5.4).
const LONGEST_INTERVAL: i64 = 86_400_000;
