//! The controllers that take a parameter for another one.

use canopen::Mux;

use super::super::objects::{logic, math, table_of};
use super::{Ax021211Rules, DigitalRules, Layer};
use crate::devices::deviating::{self, Lay};

/// The names of the devices that break one decision.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    let taken = TAKEN_FOR.iter().map(|(name, ..)| *name);
    fixed.chain(taken).chain(MISPLACED.iter().map(|(name, ..)| *name))
}

/// The deviation of that name; `None` when there is none.
pub(super) fn named(name: &str) -> Option<Lay<dyn Ax021211Rules>> {
    let parameter = |item, from, to| -> Option<Lay<dyn Ax021211Rules>> {
        Some(deviating::unmutable(move |beneath| Box::new(TakenFor { beneath, item, from, to })))
    };
    if let Some((_, item, value)) = FIXED.iter().find(|(fixed, ..)| *fixed == name) {
        return parameter(*item, None, *value);
    }
    if let Some((_, item, from, to)) = TAKEN_FOR.iter().find(|(taken, ..)| *taken == name) {
        return parameter(*item, Some(*from), *to);
    }
    let (_, item, from, to) = *MISPLACED.iter().find(|(misplaced, ..)| *misplaced == name)?;
    Some(deviating::unmutable(move |beneath| Box::new(Misplaced { beneath, item, from, to })))
}

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

/// A controller that takes one code of a parameter, or any, for another one.
struct TakenFor {
    beneath: Box<dyn Ax021211Rules>,
    item: Item,
    from: Option<i64>,
    to: i64,
}

impl Layer for TakenFor {
    fn beneath(&self) -> Option<&dyn Ax021211Rules> {
        Some(&*self.beneath)
    }
}

impl DigitalRules for TakenFor {}

impl Ax021211Rules for TakenFor {
    fn parameter(&self, mux: Mux, configured: i64) -> i64 {
        let configured = self.beneath.parameter(mux, configured);
        let is_it = self.from.is_none_or(|from| configured == from) && self.item.is(mux);
        if is_it { self.to } else { configured }
    }
}

/// A controller whose block at one place has a parameter of the block at another place.
struct Misplaced {
    beneath: Box<dyn Ax021211Rules>,
    item: Item,
    from: usize,
    to: usize,
}

impl Layer for Misplaced {
    fn beneath(&self) -> Option<&dyn Ax021211Rules> {
        Some(&*self.beneath)
    }
}

impl DigitalRules for Misplaced {}

impl Ax021211Rules for Misplaced {
    fn place(&self, index: u16, place: usize) -> usize {
        let is_it = place == self.from && self.item.is(Mux::new(index, 0));
        if is_it { self.to } else { self.beneath.place(index, place) }
    }
}

const FIXED: &[(&str, Item, i64)] = &[
    ("digits-of-pv-ignored", Item::At(0x6302), 0),
    ("digits-of-fv-ignored", Item::At(0x6332), 0),
    ("digits-of-extra-values-ignored", Item::At(0x2502), 0),
    ("digits-of-x-axis-ignored", Item::OfTables(3), 0),
    ("digits-of-y-axis-ignored", Item::OfTables(4), 0),
    ("digits-of-math-output-ignored", Item::At(0x4032), 0),
    ("digits-of-math-inputs-ignored", Item::OfMaths(0x03), 0),
    ("digits-of-pid-times-ignored", Item::At(0x6459), 3),
    ("scaling-1-pv-ignored", Item::At(0x7320), 0),
    ("scaling-1-fv-ignored", Item::At(0x7321), 0),
    ("scaling-2-fv-ignored", Item::At(0x7323), 1500),
    ("static-bias-ignored", Item::At(0x2390), 0),
    ("ramp-up-ignored", Item::At(0x2330), 0),
    ("ramp-down-ignored", Item::At(0x2331), 0),
    ("fault-mode-ignored", Item::At(0x6340), 1),
    ("fault-fv-ignored", Item::At(0x7341), 0),
    ("digital-fault-mode-ignored", Item::At(0x6250), 1),
    ("control-response-ignored", Item::At(0x2342), 0),
    ("enable-response-ignored", Item::At(0x2352), 3),
    ("override-response-ignored", Item::At(0x2362), 0),
    ("detection-always-on", Item::At(0x2310), 1),
    ("hysteresis-ignored", Item::At(0x2311), 100),
    ("reaction-delay-ignored", Item::At(0x2312), 0),
    ("dither-frequency-ignored", Item::At(0x2320), 250),
    ("delay-polarity-ignored", Item::At(0x2225), 1),
    ("delay-ignored", Item::At(0x2224), 0),
    ("hotshot-current-ignored", Item::At(0x2220), 2000),
    ("hold-current-ignored", Item::At(0x2221), 500),
    ("pid-cycle-ignored", Item::At(0x7456), 10),
    ("pid-gain-ignored", Item::At(0x7450), 5),
    ("pid-tolerance-ignored", Item::At(0x2450), 10),
    ("pid-response-ignored", Item::At(0x2457), 0),
    ("pid-integral-gain-ignored", Item::At(0x2451), 10),
    ("pid-derivative-gain-ignored", Item::At(0x2452), 10),
    ("math-gain-ignored", Item::OfMaths(0x40), 100),
    ("math-function-number-ignored", Item::OfMaths(0x02), 0),
    ("math-scaling-1-ignored", Item::OfMaths(0x20), 0),
    ("digits-of-extra-values-always-2", Item::At(0x2502), 2),
    ("digits-of-math-inputs-always-1", Item::OfMaths(0x03), 1),
    ("pid-target-number-ignored", Item::At(0x2454), 11),
    ("pid-feedback-number-ignored", Item::At(0x2456), 12),
    ("table-number-ignored", Item::OfTables(1), 11),
    ("control-number-ignored", Item::At(0x2341), 1),
    ("override-fv-ignored", Item::At(0x2300), 750),
    ("hotshot-time-ignored", Item::At(0x2222), 1000),
    ("dither-amplitude-ignored", Item::At(0x2321), 100),
    ("math-scaling-2-ignored", Item::OfMaths(0x22), 10_000),
    ("math-output-scaling-1-ignored", Item::At(0x4021), 0),
];

const TAKEN_FOR: &[(&str, Item, i64, i64)] = &[
    ("type-voltage-taken-for-pwm", Item::At(0x6310), 10, 40),
    ("type-pwm-taken-for-voltage", Item::At(0x6310), 40, 10),
    ("type-hotshot-taken-for-on-off", Item::At(0x6310), 1020, 1000),
    ("type-on-off-taken-for-hotshot", Item::At(0x6310), 1000, 1020),
    ("type-disabled-taken-for-current", Item::At(0x6310), 0, 20),
    ("off-below-taken-for-off-above", Item::At(0x2342), 1, 2),
    ("off-above-taken-for-off-below", Item::At(0x2342), 2, 1),
    ("enable-response-0-taken-for-3", Item::At(0x2352), 0, 3),
    ("enable-response-1-taken-for-0", Item::At(0x2352), 1, 0),
    ("enable-response-2-taken-for-0", Item::At(0x2352), 2, 0),
    ("enable-response-3-taken-for-0", Item::At(0x2352), 3, 0),
    ("enable-response-4-taken-for-3", Item::At(0x2352), 4, 3),
    ("enable-response-5-taken-for-4", Item::At(0x2352), 5, 4),
    ("override-when-on-taken-for-when-off", Item::At(0x2362), 0, 1),
    ("pid-response-1-taken-for-2", Item::At(0x2457), 1, 2),
    ("pid-response-2-taken-for-1", Item::At(0x2457), 2, 1),
    ("control-constant-taken-for-message", Item::At(0x2340), 2, 1),
    ("control-pid-taken-for-table", Item::At(0x2340), 3, 4),
    ("control-table-taken-for-math", Item::At(0x2340), 4, 5),
    ("control-math-taken-for-logic", Item::At(0x2340), 5, 6),
    ("control-logic-taken-for-table", Item::At(0x2340), 6, 4),
    ("control-commanded-taken-for-feedback", Item::At(0x2340), 7, 8),
    ("control-feedback-taken-for-commanded", Item::At(0x2340), 8, 7),
    ("control-supply-taken-for-temperature", Item::At(0x2340), 9, 10),
    ("control-temperature-taken-for-supply", Item::At(0x2340), 10, 9),
    ("math-operator-0-taken-for-3", Item::OfMaths(0x50), 0, 3),
    ("math-operator-1-taken-for-2", Item::OfMaths(0x50), 1, 2),
    ("math-operator-2-taken-for-3", Item::OfMaths(0x50), 2, 3),
    ("math-operator-3-taken-for-2", Item::OfMaths(0x50), 3, 2),
    ("math-operator-4-taken-for-5", Item::OfMaths(0x50), 4, 5),
    ("math-operator-5-taken-for-4", Item::OfMaths(0x50), 5, 4),
    ("math-operator-6-taken-for-10", Item::OfMaths(0x50), 6, 10),
    ("math-operator-7-taken-for-9", Item::OfMaths(0x50), 7, 9),
    ("math-operator-8-taken-for-6", Item::OfMaths(0x50), 8, 6),
    ("math-operator-9-taken-for-7", Item::OfMaths(0x50), 9, 7),
    ("math-operator-10-taken-for-6", Item::OfMaths(0x50), 10, 6),
    ("math-operator-11-taken-for-8", Item::OfMaths(0x50), 11, 8),
    ("math-operator-12-taken-for-17", Item::OfMaths(0x50), 12, 17),
    ("math-operator-13-taken-for-12", Item::OfMaths(0x50), 13, 12),
    ("math-operator-14-taken-for-16", Item::OfMaths(0x50), 14, 16),
    ("math-operator-15-taken-for-14", Item::OfMaths(0x50), 15, 14),
    ("math-operator-16-taken-for-17", Item::OfMaths(0x50), 16, 17),
    ("math-operator-17-taken-for-16", Item::OfMaths(0x50), 17, 16),
    ("condition-operator-0-taken-for-3", Item::Operator, 0, 3),
    ("condition-operator-1-taken-for-2", Item::Operator, 1, 2),
    ("condition-operator-2-taken-for-3", Item::Operator, 2, 3),
    ("condition-operator-3-taken-for-2", Item::Operator, 3, 2),
    ("condition-operator-4-taken-for-5", Item::Operator, 4, 5),
    ("condition-operator-5-taken-for-4", Item::Operator, 5, 4),
    ("logic-operator-0-taken-for-1", Item::OfLogics(0x02), 0, 1),
    ("logic-operator-1-taken-for-2", Item::OfLogics(0x02), 1, 2),
    ("logic-operator-2-taken-for-1", Item::OfLogics(0x02), 2, 1),
    ("logic-operator-3-taken-for-2", Item::OfLogics(0x02), 3, 2),
    ("enable-response-1-taken-for-2", Item::At(0x2352), 1, 2),
    ("enable-response-3-taken-for-5", Item::At(0x2352), 3, 5),
    ("enable-response-4-taken-for-5", Item::At(0x2352), 4, 5),
    ("enable-response-4-taken-for-1", Item::At(0x2352), 4, 1),
    ("enable-response-5-taken-for-2", Item::At(0x2352), 5, 2),
    ("enable-response-2-taken-for-5", Item::At(0x2352), 2, 5),
    ("override-when-off-taken-for-when-on", Item::At(0x2362), 1, 0),
    ("control-response-0-taken-for-1", Item::At(0x2342), 0, 1),
    ("ramp-up-of-0-taken-for-default", Item::At(0x2330), 0, 1000),
    ("ramp-down-of-0-taken-for-default", Item::At(0x2331), 0, 1000),
    ("bias-of-0-taken-for-100", Item::At(0x2390), 0, 100),
    ("hotshot-time-of-0-taken-for-default", Item::At(0x2222), 0, 1000),
    ("largest-hysteresis-taken-for-default", Item::At(0x2311), 150, 100),
    ("logic-operator-4-taken-for-3", Item::OfLogics(0x02), 4, 3),
];

/// Places count from 0 on.
const MISPLACED: &[(&str, Item, usize, usize)] = &[
    ("ramp-up-of-another-output", Item::At(0x2330), 9, 0),
    ("scaling-of-another-output", Item::At(0x7323), 8, 0),
    ("fault-fv-of-another-output", Item::At(0x7341), 4, 3),
    ("override-fv-of-another-output", Item::At(0x2300), 1, 0),
    ("enable-source-of-another-output", Item::At(0x2350), 2, 1),
    ("hotshot-time-of-another-output", Item::At(0x2222), 9, 8),
    ("polarity-of-another-output", Item::At(0x6202), 9, 8),
    ("extra-value-of-another-number", Item::At(0x2500), 13, 12),
    ("process-value-of-another-output", Item::At(0x7300), 9, 8),
    ("constant-of-another-number", Item::At(0x5010), 14, 13),
    ("pid-target-of-another-loop", Item::At(0x2453), 3, 2),
    ("extra-scaling-of-another-number", Item::At(0x2522), 11, 10),
    ("math-enable-of-another-block", Item::At(0x4000), 5, 4),
    ("logic-enable-of-another-block", Item::At(0x3300), 3, 2),
    ("math-input-of-another-number", Item::OfMaths(0x00), 5, 4),
    ("math-operator-of-another-function", Item::OfMaths(0x50), 2, 1),
    ("table-point-of-another-number", Item::OfTables(7), 10, 9),
    ("enable-source-of-the-next-output", Item::Span(0x2350, 0x2352), 0, 1),
    ("enable-source-of-the-output-before", Item::Span(0x2350, 0x2352), 2, 1),
    ("enable-source-of-output-9", Item::Span(0x2350, 0x2352), 9, 8),
    ("override-source-of-output-9", Item::Span(0x2360, 0x2362), 9, 8),
    ("override-source-of-the-next-output", Item::Span(0x2360, 0x2362), 0, 1),
    ("detection-of-the-output-before", Item::At(0x2310), 1, 0),
    ("reaction-delay-of-the-output-before", Item::At(0x2312), 1, 0),
    ("hysteresis-of-the-output-before", Item::At(0x2311), 1, 0),
    ("dither-amplitude-of-the-next-output", Item::At(0x2321), 0, 1),
    ("ramp-up-of-the-output-before", Item::At(0x2330), 1, 0),
    ("ramp-down-of-the-output-before", Item::At(0x2331), 1, 0),
    ("delay-of-the-output-before", Item::At(0x2224), 1, 0),
    ("type-of-the-next-output", Item::At(0x6310), 0, 1),
    ("type-of-output-9", Item::At(0x6310), 9, 8),
    ("process-value-of-the-next-output", Item::At(0x7300), 0, 1),
    ("control-response-of-the-output-before", Item::At(0x2342), 1, 0),
    ("pid-gain-of-loop-1", Item::At(0x7450), 1, 0),
    ("pid-integral-gain-of-loop-1", Item::At(0x2451), 2, 0),
    ("pid-response-of-loop-1", Item::At(0x2457), 3, 0),
    ("pid-gain-of-loop-4", Item::At(0x7450), 0, 3),
    ("pid-tolerance-of-loop-1", Item::At(0x2450), 2, 0),
    ("pid-target-number-of-loop-1", Item::At(0x2454), 1, 0),
    ("pid-feedback-number-of-loop-1", Item::At(0x2456), 2, 0),
    ("digits-of-the-extra-value-before", Item::At(0x2502), 1, 0),
    ("math-limit-of-the-input-before", Item::OfMaths(0x22), 1, 0),
    ("math-gain-of-the-input-before", Item::OfMaths(0x40), 1, 0),
    ("math-operator-of-function-1", Item::OfMaths(0x50), 1, 0),
    ("math-output-scaling-of-block-1", Item::At(0x4023), 1, 0),
    ("logic-enable-of-block-1", Item::At(0x3300), 1, 0),
    ("logic-operator-of-function-a", Item::OfLogics(0x02), 1, 0),
    ("logic-table-of-function-a", Item::OfLogics(0x01), 1, 0),
    ("table-point-counted-from-0", Item::OfTables(7), 4, 3),
    ("logic-table-of-another-letter", Item::OfLogics(0x01), 2, 1),
];
