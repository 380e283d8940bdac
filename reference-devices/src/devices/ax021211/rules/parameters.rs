//! Deviations of the controller that confuse one parameter with another.

use canopen::Mux;

use super::super::objects::{logic, math, table_of};
use super::{Ax021211Rules, Decision};

/// The objects that hold one parameter of the blocks of a kind.
#[derive(Clone, Copy)]
enum Item {
    /// One object, with a block at each sub-index.
    At(u16),
    /// Objects one after the other, such as source, number and response of an input.
    Span(u16, u16),
    /// 3yz0h to 3yz8h, by the last digit.
    OfTables(u16),
    /// 4y00h to 4y50h, by the last two digits.
    OfMaths(u16),
    /// 3x01h to 3x33h, by the last two digits.
    OfLogics(u16),
    /// Sub-index 5 of every condition.
    Operator,
}

impl Item {
    fn is(self, mux: Mux) -> bool {
        match self {
            Self::At(index) => mux.index == index,
            Self::Span(first, last) => (first..=last).contains(&mux.index),
            Self::OfTables(item) => table_of(mux.index).is_some_and(|(_, known)| known == item),
            Self::OfMaths(item) => (0..6).any(|place| mux.index == math(place, item)),
            Self::OfLogics(item) => (0..4).any(|place| mux.index == logic(place, item)),
            Self::Operator => {
                let is_condition = (0x3411..=0x3733).contains(&mux.index);
                is_condition && mux.sub == 5 && mux.index & 0xFF >= 0x11
            }
        }
    }
}

/// A controller that takes one code of a parameter for another one.
fn taken_for(item: Item, from: i64, to: i64) -> impl Fn(&Ax021211Rules, Mux, i64) -> i64 {
    move |rules, mux, configured| {
        let configured = rules.parameter(mux, configured);
        if configured == from && item.is(mux) { to } else { configured }
    }
}

/// A controller of which a parameter has always the same value.
fn fixed(item: Item, value: i64) -> impl Fn(&Ax021211Rules, Mux, i64) -> i64 {
    move |rules, mux, configured| {
        if item.is(mux) { value } else { rules.parameter(mux, configured) }
    }
}

/// A controller whose block at one place, from 0 on, has a parameter of the block at another place.
fn misplaced(item: Item, from: usize, to: usize) -> impl Fn(&Ax021211Rules, u16, usize) -> usize {
    move |rules, index, place| {
        let is_it = place == from && item.is(Mux::new(index, 0));
        if is_it { to } else { rules.place(index, place) }
    }
}

deviations! {
    pub(super) DEVIATIONS of Decision;

    "digits-of-pv-ignored" => parameter: fixed(Item::At(0x6302), 0);
    "digits-of-fv-ignored" => parameter: fixed(Item::At(0x6332), 0);
    "digits-of-extra-values-ignored" => parameter: fixed(Item::At(0x2502), 0);
    "digits-of-x-axis-ignored" => parameter: fixed(Item::OfTables(3), 0);
    "digits-of-math-output-ignored" => parameter: fixed(Item::At(0x4032), 0);
    "digits-of-math-inputs-ignored" => parameter: fixed(Item::OfMaths(0x03), 0);
    "digits-of-pid-times-ignored" => parameter: fixed(Item::At(0x6459), 3);
    "scaling-1-pv-ignored" => parameter: fixed(Item::At(0x7320), 0);
    "scaling-1-fv-ignored" => parameter: fixed(Item::At(0x7321), 0);
    "scaling-2-fv-ignored" => parameter: fixed(Item::At(0x7323), 1500);
    "static-bias-ignored" => parameter: fixed(Item::At(0x2390), 0);
    "ramp-up-ignored" => parameter: fixed(Item::At(0x2330), 0);
    "ramp-down-ignored" => parameter: fixed(Item::At(0x2331), 0);
    "fault-mode-ignored" => parameter: fixed(Item::At(0x6340), 1);
    "fault-fv-ignored" => parameter: fixed(Item::At(0x7341), 0);
    "digital-fault-mode-ignored" => parameter: fixed(Item::At(0x6250), 1);
    "control-response-ignored" => parameter: fixed(Item::At(0x2342), 0);
    "enable-response-ignored" => parameter: fixed(Item::At(0x2352), 3);
    "override-response-ignored" => parameter: fixed(Item::At(0x2362), 0);
    "detection-always-on" => parameter: fixed(Item::At(0x2310), 1);
    "hysteresis-ignored" => parameter: fixed(Item::At(0x2311), 100);
    "reaction-delay-ignored" => parameter: fixed(Item::At(0x2312), 0);
    "dither-frequency-ignored" => parameter: fixed(Item::At(0x2320), 250);
    "delay-polarity-ignored" => parameter: fixed(Item::At(0x2225), 1);
    "delay-ignored" => parameter: fixed(Item::At(0x2224), 0);
    "hotshot-current-ignored" => parameter: fixed(Item::At(0x2220), 2000);
    "hold-current-ignored" => parameter: fixed(Item::At(0x2221), 500);
    "pid-cycle-ignored" => parameter: fixed(Item::At(0x7456), 10);
    "pid-gain-ignored" => parameter: fixed(Item::At(0x7450), 5);
    "pid-tolerance-ignored" => parameter: fixed(Item::At(0x2450), 10);
    "pid-response-ignored" => parameter: fixed(Item::At(0x2457), 0);
    "pid-integral-gain-ignored" => parameter: fixed(Item::At(0x2451), 10);
    "pid-derivative-gain-ignored" => parameter: fixed(Item::At(0x2452), 10);
    "math-gain-ignored" => parameter: fixed(Item::OfMaths(0x40), 100);
    "math-function-number-ignored" => parameter: fixed(Item::OfMaths(0x02), 0);
    "math-scaling-1-ignored" => parameter: fixed(Item::OfMaths(0x20), 0);
    "digits-of-extra-values-always-2" => parameter: fixed(Item::At(0x2502), 2);
    "digits-of-math-inputs-always-1" => parameter: fixed(Item::OfMaths(0x03), 1);
    "pid-target-number-ignored" => parameter: fixed(Item::At(0x2454), 11);
    "pid-feedback-number-ignored" => parameter: fixed(Item::At(0x2456), 12);
    "table-number-ignored" => parameter: fixed(Item::OfTables(1), 11);
    "control-number-ignored" => parameter: fixed(Item::At(0x2341), 1);
    "override-fv-ignored" => parameter: fixed(Item::At(0x2300), 750);
    "hotshot-time-ignored" => parameter: fixed(Item::At(0x2222), 1000);
    "dither-amplitude-ignored" => parameter: fixed(Item::At(0x2321), 100);
    "math-scaling-2-ignored" => parameter: fixed(Item::OfMaths(0x22), 10_000);
    "math-output-scaling-1-ignored" => parameter: fixed(Item::At(0x4021), 0);

    "type-voltage-taken-for-pwm" => parameter: taken_for(Item::At(0x6310), 10, 40);
    "type-pwm-taken-for-voltage" => parameter: taken_for(Item::At(0x6310), 40, 10);
    "type-hotshot-taken-for-on-off" => parameter: taken_for(Item::At(0x6310), 1020, 1000);
    "type-on-off-taken-for-hotshot" => parameter: taken_for(Item::At(0x6310), 1000, 1020);
    "type-disabled-taken-for-current" => parameter: taken_for(Item::At(0x6310), 0, 20);
    "off-below-taken-for-off-above" => parameter: taken_for(Item::At(0x2342), 1, 2);
    "off-above-taken-for-off-below" => parameter: taken_for(Item::At(0x2342), 2, 1);
    "enable-response-0-taken-for-3" => parameter: taken_for(Item::At(0x2352), 0, 3);
    "enable-response-1-taken-for-0" => parameter: taken_for(Item::At(0x2352), 1, 0);
    "enable-response-2-taken-for-0" => parameter: taken_for(Item::At(0x2352), 2, 0);
    "enable-response-3-taken-for-0" => parameter: taken_for(Item::At(0x2352), 3, 0);
    "enable-response-4-taken-for-3" => parameter: taken_for(Item::At(0x2352), 4, 3);
    "enable-response-5-taken-for-4" => parameter: taken_for(Item::At(0x2352), 5, 4);
    "override-when-on-taken-for-when-off" => parameter: taken_for(Item::At(0x2362), 0, 1);
    "pid-response-1-taken-for-2" => parameter: taken_for(Item::At(0x2457), 1, 2);
    "pid-response-2-taken-for-1" => parameter: taken_for(Item::At(0x2457), 2, 1);
    "control-constant-taken-for-message" => parameter: taken_for(Item::At(0x2340), 2, 1);
    "control-pid-taken-for-table" => parameter: taken_for(Item::At(0x2340), 3, 4);
    "control-table-taken-for-math" => parameter: taken_for(Item::At(0x2340), 4, 5);
    "control-math-taken-for-logic" => parameter: taken_for(Item::At(0x2340), 5, 6);
    "control-logic-taken-for-table" => parameter: taken_for(Item::At(0x2340), 6, 4);
    "control-supply-taken-for-temperature" => parameter: taken_for(Item::At(0x2340), 9, 10);
    "control-temperature-taken-for-supply" => parameter: taken_for(Item::At(0x2340), 10, 9);
    "math-operator-0-taken-for-3" => parameter: taken_for(Item::OfMaths(0x50), 0, 3);
    "math-operator-1-taken-for-2" => parameter: taken_for(Item::OfMaths(0x50), 1, 2);
    "math-operator-2-taken-for-3" => parameter: taken_for(Item::OfMaths(0x50), 2, 3);
    "math-operator-3-taken-for-2" => parameter: taken_for(Item::OfMaths(0x50), 3, 2);
    "math-operator-4-taken-for-5" => parameter: taken_for(Item::OfMaths(0x50), 4, 5);
    "math-operator-5-taken-for-4" => parameter: taken_for(Item::OfMaths(0x50), 5, 4);
    "math-operator-6-taken-for-10" => parameter: taken_for(Item::OfMaths(0x50), 6, 10);
    "math-operator-7-taken-for-9" => parameter: taken_for(Item::OfMaths(0x50), 7, 9);
    "math-operator-8-taken-for-6" => parameter: taken_for(Item::OfMaths(0x50), 8, 6);
    "math-operator-9-taken-for-7" => parameter: taken_for(Item::OfMaths(0x50), 9, 7);
    "math-operator-10-taken-for-6" => parameter: taken_for(Item::OfMaths(0x50), 10, 6);
    "math-operator-11-taken-for-8" => parameter: taken_for(Item::OfMaths(0x50), 11, 8);
    "math-operator-12-taken-for-17" => parameter: taken_for(Item::OfMaths(0x50), 12, 17);
    "math-operator-13-taken-for-12" => parameter: taken_for(Item::OfMaths(0x50), 13, 12);
    "math-operator-14-taken-for-16" => parameter: taken_for(Item::OfMaths(0x50), 14, 16);
    "math-operator-15-taken-for-14" => parameter: taken_for(Item::OfMaths(0x50), 15, 14);
    "math-operator-16-taken-for-17" => parameter: taken_for(Item::OfMaths(0x50), 16, 17);
    "math-operator-17-taken-for-16" => parameter: taken_for(Item::OfMaths(0x50), 17, 16);
    "condition-operator-0-taken-for-3" => parameter: taken_for(Item::Operator, 0, 3);
    "condition-operator-1-taken-for-2" => parameter: taken_for(Item::Operator, 1, 2);
    "condition-operator-2-taken-for-3" => parameter: taken_for(Item::Operator, 2, 3);
    "condition-operator-3-taken-for-2" => parameter: taken_for(Item::Operator, 3, 2);
    "condition-operator-4-taken-for-5" => parameter: taken_for(Item::Operator, 4, 5);
    "condition-operator-5-taken-for-4" => parameter: taken_for(Item::Operator, 5, 4);
    "logic-operator-0-taken-for-1" => parameter: taken_for(Item::OfLogics(0x02), 0, 1);
    "logic-operator-1-taken-for-2" => parameter: taken_for(Item::OfLogics(0x02), 1, 2);
    "logic-operator-2-taken-for-1" => parameter: taken_for(Item::OfLogics(0x02), 2, 1);
    "logic-operator-3-taken-for-2" => parameter: taken_for(Item::OfLogics(0x02), 3, 2);
    "enable-response-1-taken-for-2" => parameter: taken_for(Item::At(0x2352), 1, 2);
    "enable-response-3-taken-for-5" => parameter: taken_for(Item::At(0x2352), 3, 5);
    "enable-response-4-taken-for-5" => parameter: taken_for(Item::At(0x2352), 4, 5);
    "enable-response-4-taken-for-1" => parameter: taken_for(Item::At(0x2352), 4, 1);
    "enable-response-5-taken-for-2" => parameter: taken_for(Item::At(0x2352), 5, 2);
    "enable-response-2-taken-for-5" => parameter: taken_for(Item::At(0x2352), 2, 5);
    "override-when-off-taken-for-when-on" => parameter: taken_for(Item::At(0x2362), 1, 0);
    "control-response-0-taken-for-1" => parameter: taken_for(Item::At(0x2342), 0, 1);
    "ramp-up-of-0-taken-for-default" => parameter: taken_for(Item::At(0x2330), 0, 1000);
    "ramp-down-of-0-taken-for-default" => parameter: taken_for(Item::At(0x2331), 0, 1000);
    "bias-of-0-taken-for-100" => parameter: taken_for(Item::At(0x2390), 0, 100);
    "hotshot-time-of-0-taken-for-default" => parameter: taken_for(Item::At(0x2222), 0, 1000);
    "logic-operator-4-taken-for-3" => parameter: taken_for(Item::OfLogics(0x02), 4, 3);

    "ramp-up-of-another-output" => place: misplaced(Item::At(0x2330), 9, 0);
    "scaling-of-another-output" => place: misplaced(Item::At(0x7323), 8, 0);
    "fault-fv-of-another-output" => place: misplaced(Item::At(0x7341), 4, 3);
    "override-fv-of-another-output" => place: misplaced(Item::At(0x2300), 1, 0);
    "hotshot-time-of-another-output" => place: misplaced(Item::At(0x2222), 9, 8);
    "polarity-of-another-output" => place: misplaced(Item::At(0x6202), 9, 8);
    "extra-value-of-another-number" => place: misplaced(Item::At(0x2500), 13, 12);
    "process-value-of-another-output" => place: misplaced(Item::At(0x7300), 9, 8);
    "constant-of-another-number" => place: misplaced(Item::At(0x5010), 14, 13);
    "pid-target-of-another-loop" => place: misplaced(Item::At(0x2453), 3, 2);
    "extra-scaling-of-another-number" => place: misplaced(Item::At(0x2522), 11, 10);
    "math-enable-of-another-block" => place: misplaced(Item::At(0x4000), 5, 4);
    "logic-enable-of-another-block" => place: misplaced(Item::At(0x3300), 3, 2);
    "math-input-of-another-number" => place: misplaced(Item::OfMaths(0x00), 5, 4);
    "math-operator-of-another-function" => place: misplaced(Item::OfMaths(0x50), 2, 1);
    "table-point-of-another-number" => place: misplaced(Item::OfTables(7), 10, 9);
    "enable-source-of-the-next-output" => place: misplaced(Item::Span(0x2350, 0x2352), 0, 1);
    "enable-source-of-the-output-before" => place: misplaced(Item::Span(0x2350, 0x2352), 2, 1);
    "enable-source-of-output-9" => place: misplaced(Item::Span(0x2350, 0x2352), 9, 8);
    "override-source-of-output-9" => place: misplaced(Item::Span(0x2360, 0x2362), 9, 8);
    "override-source-of-the-next-output" => place: misplaced(Item::Span(0x2360, 0x2362), 0, 1);
    "detection-of-the-output-before" => place: misplaced(Item::At(0x2310), 1, 0);
    "reaction-delay-of-the-output-before" => place: misplaced(Item::At(0x2312), 1, 0);
    "dither-amplitude-of-the-next-output" => place: misplaced(Item::At(0x2321), 0, 1);
    "ramp-up-of-the-output-before" => place: misplaced(Item::At(0x2330), 1, 0);
    "delay-of-the-output-before" => place: misplaced(Item::At(0x2224), 1, 0);
    "type-of-the-next-output" => place: misplaced(Item::At(0x6310), 0, 1);
    "type-of-output-9" => place: misplaced(Item::At(0x6310), 9, 8);
    "process-value-of-the-next-output" => place: misplaced(Item::At(0x7300), 0, 1);
    "control-response-of-the-output-before" => place: misplaced(Item::At(0x2342), 1, 0);
    "pid-gain-of-loop-1" => place: misplaced(Item::At(0x7450), 1, 0);
    "pid-integral-gain-of-loop-1" => place: misplaced(Item::At(0x2451), 2, 0);
    "pid-response-of-loop-1" => place: misplaced(Item::At(0x2457), 3, 0);
    "pid-gain-of-loop-4" => place: misplaced(Item::At(0x7450), 0, 3);
    "pid-tolerance-of-loop-1" => place: misplaced(Item::At(0x2450), 2, 0);
    "pid-target-number-of-loop-1" => place: misplaced(Item::At(0x2454), 1, 0);
    "pid-feedback-number-of-loop-1" => place: misplaced(Item::At(0x2456), 2, 0);
    "digits-of-the-extra-value-before" => place: misplaced(Item::At(0x2502), 1, 0);
    "math-limit-of-the-input-before" => place: misplaced(Item::OfMaths(0x22), 1, 0);
    "math-gain-of-the-input-before" => place: misplaced(Item::OfMaths(0x40), 1, 0);
    "math-operator-of-function-1" => place: misplaced(Item::OfMaths(0x50), 1, 0);
    "math-output-scaling-of-block-1" => place: misplaced(Item::At(0x4023), 1, 0);
    "logic-enable-of-block-1" => place: misplaced(Item::At(0x3300), 1, 0);
    "logic-operator-of-function-a" => place: misplaced(Item::OfLogics(0x02), 1, 0);
    "logic-table-of-function-a" => place: misplaced(Item::OfLogics(0x01), 1, 0);
    "table-point-counted-from-0" => place: misplaced(Item::OfTables(7), 4, 3);
    "logic-table-of-another-letter" => place: misplaced(Item::OfLogics(0x01), 2, 1);
}
