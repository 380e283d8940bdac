//! Every decision of the module that a test can observe, and the modules that take one of them
//! otherwise.

use canopen::emcy::EmcyCode;

use super::encoder;
use super::parameters::{DEFAULT_BIT_RATE, Item};
use crate::stack::Attachment;

/// A module that keeps to its manual; clauses are those of the manual.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Manual;

impl Mcm260xRules for Manual {}

/// What an emergency message says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Diagnosis {
    pub(super) code: EmcyCode,
    pub(super) register: u8,
    pub(super) vendor: [u8; 5],
}

/// The decisions. The default methods are a summary of what the manual says.
pub(crate) trait Mcm260xRules: Send {
    /// A parameter is in force as it is written (chapters 6 to 8).
    fn parameter(&self, _item: Item, configured: i64) -> i64 {
        configured
    }

    /// Each channel has parameters of its own.
    fn channel(&self, _item: Item, place: usize) -> usize {
        place
    }

    /// Parameters 1 to 3, which a start takes over, put the module on the bus: with its address, or
    /// not at all when it works with Modbus or at another bit rate.
    fn attachment(&self, interface: i64, address: i64, bit_rate: i64) -> Attachment {
        match u8::try_from(address) {
            _ if interface != 0 || bit_rate != DEFAULT_BIT_RATE => Attachment::Off,
            Ok(address @ 1..=127) => Attachment::Node(address),
            _ => Attachment::AsIs,
        }
    }

    /// Edges from one place of a shaft to another are counted as the setup of the encoder says.
    fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
        encoder::counts(mode, from, to)
    }

    /// The count goes round at its ends, and what it is after `counts` more.
    fn count(&self, count: i32, counts: i64) -> i32 {
        count.wrapping_add(counts as i32)
    }

    /// The count begins at 0 after power-on and reset node.
    fn count_at_start(&self, _last: i32) -> i32 {
        0
    }

    /// A new setup leaves the count as it is.
    fn count_in_new_setup(&self, count: i32) -> i32 {
        count
    }

    /// Phase Z does nothing unless a load is pending; what it makes of the count.
    fn count_at_index(&self, count: i32) -> i32 {
        count
    }

    /// What is loaded was not counted in an interval.
    fn load_is_counted(&self) -> bool {
        false
    }

    /// The preset is one value, in 3002h and in its two words.
    fn preset_is_one_value(&self) -> bool {
        true
    }

    /// 6200h and 6411h keep what was written while an error sets the outputs (11.4.6).
    fn output_objects_stay(&self) -> bool {
        true
    }

    /// The state after the boot-up is one of the list (11.3.1).
    fn takes_boot_state(&self, state: u16) -> bool {
        matches!(state, 0 | 4 | 5 | 127)
    }

    /// The off-line time goes to 60000 ms (6.a), whatever its sign.
    fn longest_offline_time(&self) -> u16 {
        60_000
    }

    /// A value beyond the limits of an analogue output is taken, and the output gives the end of
    /// its range.
    fn takes_beyond_limits(&self) -> bool {
        true
    }

    /// 3003h bit 0 loads the preset (9.2, 11.3.5).
    fn loads_now(&self, command: i64) -> bool {
        command & 1 != 0
    }

    /// 3003h bit 1 loads the preset at the next pulse of phase Z (9.2, 11.3.5).
    fn loads_at_index(&self, command: i64) -> bool {
        command & 2 != 0
    }

    /// Phase Z belongs to the setups A-B-Z.
    fn sees_index(&self, mode: i64) -> bool {
        matches!(mode, 3 | 4)
    }

    /// A command falls back to 0 when it has been carried out.
    fn command_left(&self, _command: i64, waits: bool) -> i64 {
        if waits { 2 } else { 0 }
    }

    /// 3004h has the counts of a second, 3005h those of 100 ms (11.3.6, 11.3.7).
    fn windows(&self, second: i64, tenth: i64) -> (i64, i64) {
        (second, tenth)
    }

    /// The preset has 32 bits, in 3002h or in two parameters (chapters 6 and 8, 11.3.4).
    fn preset(&self, high: i64, low: i64) -> i64 {
        high << 16 | low & 0xFFFF
    }

    /// An input out of range has a bit in 4007h (11.3.8).
    fn channel_flag(&self, place: usize) -> i64 {
        1 << (12 + place)
    }

    /// An input out of range is a diagnostic message (11.9): the channel and the number of
    /// chapter 12.
    fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
        let (channel, number) = (place as u8 + 1, place as u8 + 13);
        let vendor = [0x00, 0x07, 0x00, 0x80 | channel, number];
        Some(Diagnosis { code: EmcyCode(0xFF00), register: 0x81, vendor })
    }

    /// A supply below 12 V less 15 % is too low (3.2, 11.3.8).
    fn supply_is_low(&self, volts: f64) -> bool {
        volts < 12.0 * 0.85
    }

    /// An analogue output of 0 to 10 V or 4 to 20 mA between its limits.
    fn share(&self, digits: i64, lower: i64, upper: i64) -> f64 {
        if upper == lower { 0.0 } else { (digits - lower) as f64 / (upper - lower) as f64 }
    }

    /// Static outputs need the supply of their group (4.1).
    fn energised(&self, levels: i64, supplied: bool) -> i64 {
        if supplied { levels } else { 0 }
    }

    /// A terminal that is input and output shows the network what it drives (3.2.f).
    fn output_is_seen(&self) -> bool {
        true
    }

    /// The RUN LED shows whether there is an error (chapter 10).
    fn led_shows(&self, error: bool) -> bool {
        error
    }
}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    fixed.chain(MUTANTS.iter().map(|(name, _)| *name))
}

/// The rules of the device that breaks the decision of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Box<dyn Mcm260xRules>> {
    if let Some((_, item, value)) = FIXED.iter().find(|(fixed, ..)| *fixed == name) {
        return Some(Box::new(Fixed { item: *item, value: *value }));
    }
    MUTANTS.iter().find(|(mutant, _)| *mutant == name).map(|(_, build)| build())
}

/// A module for which a parameter has always the same value.
struct Fixed {
    item: Item,
    value: i64,
}

impl Mcm260xRules for Fixed {
    fn parameter(&self, item: Item, configured: i64) -> i64 {
        if item == self.item { self.value } else { configured }
    }
}

const FIXED: &[(&str, Item, i64)] = &[
    ("interface-ignored", Item::Interface, 0),
    ("address-ignored", Item::Address, 0),
    ("bit-rate-ignored", Item::BitRate, DEFAULT_BIT_RATE),
    ("offline-time-ignored", Item::OfflineTime, 0),
    ("offline-outputs-ignored", Item::OfflineOutputs, 0),
    ("encoder-setup-always-x4", Item::EncoderSetup, 2),
    ("sensor-type-always-volts", Item::SensorType, 17),
    ("degree-ignored", Item::Degree, 0),
    ("lower-limit-of-input-ignored", Item::LowerLimit, 0),
    ("upper-limit-of-input-ignored", Item::UpperLimit, 1000),
    ("potentiometer-always-10-kilohms", Item::Potentiometer, 10),
    ("limits-may-be-left", Item::BeyondLimits, 1),
    ("limits-always-hold", Item::BeyondLimits, 0),
    ("input-offset-ignored", Item::Offset, 0),
    ("input-gain-ignored", Item::Gain, 0),
    ("average-of-one-sample", Item::Filter, 1),
    ("average-of-fifty-samples", Item::Filter, 50),
    ("frequency-ignored", Item::Frequency, 5),
    ("every-sample-accepted", Item::MaximumDifference, i64::MAX),
    ("no-sample-accepted-late", Item::MaximumRejection, 1_000_000),
    ("output-always-volts", Item::OutputType, 0),
    ("lower-limit-of-output-ignored", Item::OutputLower, 0),
    ("upper-limit-of-output-ignored", Item::OutputUpper, 1000),
];

type Mutant = (&'static str, fn() -> Box<dyn Mcm260xRules>);

/// Each mutant is its name and the one method that differs.
macro_rules! mutants {
    ($($name:literal { $($method:tt)* })*) => {
        const MUTANTS: &[Mutant] = &[$(($name, || {
            struct Mutant;
            impl Mcm260xRules for Mutant { $($method)* }
            Box::new(Mutant)
        })),*];
    };
}

mutants! {
    "parameters-of-the-first-channel" {
        fn channel(&self, _item: Item, _place: usize) -> usize { 0 }
    }
    "counts-every-second-edge" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode % 2 == 0 { mode - 1 } else { mode }, from, to)
        }
    }
    "counts-without-direction" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(mode, from, to).abs()
        }
    }
    "b-before-a-is-forward" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            let counts = encoder::counts(mode, from, to);
            if mode < 5 { -counts } else { counts }
        }
    }
    "count-ends-at-its-limits" {
        fn count(&self, count: i32, counts: i64) -> i32 {
            (i64::from(count) + counts).clamp(i32::MIN.into(), i32::MAX.into()) as i32
        }
    }
    "count-outlives-power-off" {
        fn count_at_start(&self, last: i32) -> i32 { last }
    }
    "new-setup-clears-the-count" {
        fn count_in_new_setup(&self, _count: i32) -> i32 { 0 }
    }
    "z-clears-the-count" {
        fn count_at_index(&self, _count: i32) -> i32 { 0 }
    }
    "load-is-counted" {
        fn load_is_counted(&self) -> bool { true }
    }
    "preset-apart-from-its-words" {
        fn preset_is_one_value(&self) -> bool { false }
    }
    "error-values-are-written" {
        fn output_objects_stay(&self) -> bool { false }
    }
    "boot-up-is-no-state" {
        fn takes_boot_state(&self, state: u16) -> bool { matches!(state, 4 | 5 | 127) }
    }
    "any-boot-state" {
        fn takes_boot_state(&self, _state: u16) -> bool { true }
    }
    "offline-time-to-32767" {
        fn longest_offline_time(&self) -> u16 { 32_767 }
    }
    "beyond-the-limits-refused" {
        fn takes_beyond_limits(&self) -> bool { false }
    }
    "counts-backwards" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 { -encoder::counts(mode, from, to) }
    }
    "counts-while-off" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode == 0 { 2 } else { mode }, from, to)
        }
    }
    "counter-counts-up-only" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            encoder::counts(if mode == 6 { 5 } else { mode }, from, to)
        }
    }
    "counter-counts-both-edges" {
        fn counts(&self, mode: i64, from: i64, to: i64) -> i64 {
            match mode {
                5 | 6 => 2 * encoder::counts(mode, from, to),
                _ => encoder::counts(mode, from, to),
            }
        }
    }
    "preset-never-loaded" {
        fn loads_now(&self, _command: i64) -> bool { false }
    }
    "preset-loaded-by-any-command" {
        fn loads_now(&self, command: i64) -> bool { command != 0 }
    }
    "preset-never-loaded-at-z" {
        fn loads_at_index(&self, _command: i64) -> bool { false }
    }
    "z-in-every-setup" {
        fn sees_index(&self, _mode: i64) -> bool { true }
    }
    "command-stays" {
        fn command_left(&self, command: i64, _waits: bool) -> i64 { command }
    }
    "command-for-z-falls-back-at-once" {
        fn command_left(&self, _command: i64, _waits: bool) -> i64 { 0 }
    }
    "windows-swapped" {
        fn windows(&self, second: i64, tenth: i64) -> (i64, i64) { (tenth, second) }
    }
    "second-is-ten-tenths-of-now" {
        fn windows(&self, _second: i64, tenth: i64) -> (i64, i64) { (10 * tenth, tenth) }
    }
    "preset-of-16-bits" {
        fn preset(&self, _high: i64, low: i64) -> i64 { low as i16 as i64 }
    }
    "preset-words-swapped" {
        fn preset(&self, high: i64, low: i64) -> i64 { low << 16 | high & 0xFFFF }
    }
    "channel-flags-from-bit-11" {
        fn channel_flag(&self, place: usize) -> i64 { 1 << (11 + place) }
    }
    "channel-flag-of-the-first" {
        fn channel_flag(&self, _place: usize) -> i64 { 1 << 12 }
    }
    "out-of-range-without-message" {
        fn diagnosis(&self, _place: usize) -> Option<Diagnosis> { None }
    }
    "diagnosis-without-channel" {
        fn diagnosis(&self, place: usize) -> Option<Diagnosis> {
            let vendor = [0x00, 0x07, 0x00, 0x00, place as u8 + 13];
            Some(Diagnosis { code: EmcyCode(0xFF00), register: 0x81, vendor })
        }
    }
    "low-supply-ignored" {
        fn supply_is_low(&self, _volts: f64) -> bool { false }
    }
    "outputs-without-supply" {
        fn energised(&self, levels: i64, _supplied: bool) -> i64 { levels }
    }
    "own-output-is-no-input" {
        fn output_is_seen(&self) -> bool { false }
    }
    "led-without-errors" {
        fn led_shows(&self, _error: bool) -> bool { false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_used_once() {
        let mut all: Vec<&str> = names().collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
        assert!(all.iter().all(|name| named(name).is_some()));
        assert!(named("none-of-these").is_none());
    }
}
