//! The controllers that take what comes from elsewhere otherwise: signals, settings, measurements.

use super::super::objects::table_of;
use super::super::signal::{Link, Signal};
use super::super::table::POINTS;
use super::{Ax021211Rules, DigitalRules, Layer};
use crate::devices::deviating::{Deviation, deviating};

pub(super) const DEVIATIONS: &[Deviation<dyn Ax021211Rules>] = deviating! {
    dyn Ax021211Rules: Ax021211Rules [DigitalRules];
    "number-of-source-1-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 1, 1) }
    }
    "number-of-source-2-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 2, 1) }
    }
    "number-of-source-3-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 3, 1) }
    }
    "number-of-source-4-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 4, 1) }
    }
    "number-of-source-5-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 5, 1) }
    }
    "number-of-source-6-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 6, 1) }
    }
    "number-of-source-7-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 7, 1) }
    }
    "number-of-source-8-ignored" {
        fn link(&self, link: Link) -> Link { numbered(link, 8, 1) }
    }
    "enable-by-its-own-message" {
        fn input_link(&self, link: Link, source_index: u16, place: usize) -> Link {
            own_message(link, source_index == 0x2350, place)
        }
    }
    "override-by-its-own-message" {
        fn input_link(&self, link: Link, source_index: u16, place: usize) -> Link {
            own_message(link, source_index == 0x2360, place)
        }
    }
    "hysteresis-within-scaling-2" {
        fn larger_scaling(&self, _fv1: i64, fv2: i64) -> i64 { fv2 }
    }
    "ignored-points-end-the-table" {
        fn end_of_table(&self, in_use: usize, beyond_all: bool) -> usize {
            if beyond_all { POINTS } else { in_use }
        }
    }
    "supply-controls-no-output" {
        fn input_link(&self, link: Link, source_index: u16, _place: usize) -> Link {
            if source_index == 0x2340 { up_to(link, 9, 0) } else { link }
        }
    }
    "source-7-taken-for-8" {
        fn link(&self, link: Link) -> Link { sourced(link, 7, 8) }
    }
    "source-8-taken-for-7" {
        fn link(&self, link: Link) -> Link { sourced(link, 8, 7) }
    }
    "source-9-taken-for-10" {
        fn link(&self, link: Link) -> Link { sourced(link, 9, 10) }
    }
    "source-10-taken-for-9" {
        fn link(&self, link: Link) -> Link { sourced(link, 10, 9) }
    }
    "supply-has-number-1-only" {
        fn link(&self, link: Link) -> Link { first_only(link, 9) }
    }
    "temperature-has-number-1-only" {
        fn link(&self, link: Link) -> Link { first_only(link, 10) }
    }
    "constants-beyond-8-lost" {
        fn link(&self, link: Link) -> Link { up_to(link, 2, 8) }
    }
    "messages-beyond-16-lost" {
        fn link(&self, link: Link) -> Link { up_to(link, 1, 16) }
    }
    "tables-beyond-8-lost" {
        fn link(&self, link: Link) -> Link { up_to(link, 4, 8) }
    }
    "math-blocks-have-no-argument" {
        fn link(&self, link: Link) -> Link { up_to(link, 5, 0) }
    }
    "logic-blocks-are-no-source" {
        fn link(&self, link: Link) -> Link { up_to(link, 6, 0) }
    }
    "tables-are-no-source" {
        fn link(&self, link: Link) -> Link { up_to(link, 4, 0) }
    }
    "loops-are-no-source" {
        fn link(&self, link: Link) -> Link { up_to(link, 3, 0) }
    }
    "extra-values-counted-from-10" {
        fn link(&self, link: Link) -> Link {
            let number = link.number - u8::from(link.source == 1 && link.number > 10);
            Link { number, ..link }
        }
    }
    "pid-parameters-latched" {
        fn takes_over(&self, index: u16) -> bool {
            !matches!(index, 0x2450..=0x2452 | 0x2457 | 0x7450..=0x7456)
        }
    }
    "pid-sources-latched" {
        fn takes_over(&self, index: u16) -> bool { !matches!(index, 0x2453 | 0x2455) }
    }
    "table-points-latched" {
        fn takes_over(&self, index: u16) -> bool {
            !matches!(table_of(index), Some((_, 5..=7)))
        }
    }
    "table-source-latched" {
        fn takes_over(&self, index: u16) -> bool { !matches!(table_of(index), Some((_, 0))) }
    }
    "math-parameters-latched" {
        fn takes_over(&self, index: u16) -> bool {
            !(matches!(index & 0xFF, 0x20..=0x50) && index & 0xF000 == 0x4000)
        }
    }
    "logic-parameters-latched" {
        fn takes_over(&self, index: u16) -> bool {
            !matches!(index, 0x3401 | 0x3402 | 0x3501 | 0x3502)
        }
    }
    "logic-enable-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x3300 }
    }
    "scaling-latched" {
        fn takes_over(&self, index: u16) -> bool { !matches!(index, 0x7320..=0x7323) }
    }
    "type-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x6310 }
    }
    "control-input-latched" {
        fn takes_over(&self, index: u16) -> bool { !matches!(index, 0x2340 | 0x2341) }
    }
    "override-fv-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x2300 }
    }
    "hold-current-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x2221 }
    }
    "ramps-latched" {
        fn takes_over(&self, index: u16) -> bool { !matches!(index, 0x2330 | 0x2331) }
    }
    "hysteresis-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x2311 }
    }
    "constants-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x5010 }
    }
    "extra-values-latched" {
        fn takes_over(&self, index: u16) -> bool { index != 0x2500 }
    }
    "tables-beyond-6-repeat" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x3010, 6) }
    }
    "tables-are-one" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x3010, 1) }
    }
    "math-blocks-beyond-3-repeat" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x4100, 3) }
    }
    "math-blocks-are-one" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x4100, 1) }
    }
    "logic-blocks-are-one" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x3400, 1) }
    }
    "logic-blocks-are-two" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x3400, 2) }
    }
    "loops-are-one" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x7450, 1) }
    }
    "loops-are-two" {
        fn block(&self, kind: u16, place: usize) -> usize { wrapped(kind, place, 0x7450, 2) }
    }
    "span-in-16-bits" {
        fn share(&self, value: f64, low: f64, high: f64) -> f64 {
            let unit = if high - low < 1000.0 { 100.0 } else { 1.0 };
            let span = f64::from((unit * (high - low)).round() as i64 as i16) / unit;
            if span == 0.0 { 0.0 } else { (value - low) / span }
        }
    }
    "lower-limit-ignored" {
        fn share(&self, value: f64, _low: f64, high: f64) -> f64 {
            if high == 0.0 { 0.0 } else { value / high }
        }
    }
    "supply-without-digit" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (volts.trunc(), degrees) }
    }
    "supply-in-tenths" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (10.0 * volts, degrees) }
    }
    "temperature-without-sign" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (volts, degrees.abs()) }
    }
    "temperature-in-fahrenheit" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (volts, 1.8 * degrees + 32.0) }
    }
    "measurements-swapped" {
        fn measured(&self, volts: f64, degrees: f64) -> (f64, f64) { (degrees, volts) }
    }
    "blocks-go-on-over-a-reset" {
        fn forgets(&self) -> bool { false }
    }
    "x-values-must-differ" {
        fn x_range(&self, low: i64, high: i64) -> (i64, i64) {
            (low.saturating_add(1), high.saturating_sub(1))
        }
    }
    "x-values-far-apart" {
        fn x_range(&self, low: i64, high: i64) -> (i64, i64) {
            (low.saturating_add(60), high.saturating_sub(60))
        }
    }
    "x-values-rise-slowly" {
        fn x_range(&self, low: i64, high: i64) -> (i64, i64) {
            (low, high.min(low.saturating_add(60).max(60)))
        }
    }
    "x-neighbours-of-table-1" {
        fn neighbours(&self, _place: usize) -> usize { 0 }
    }
    "x-limits-of-a-percentage" {
        fn x_limits(&self, _limits: Option<(f64, f64)>) -> Option<(f64, f64)> {
            Some((0.0, 100.0))
        }
    }
    "pid-lower-limit-ignored" {
        fn percent(&self, signal: Signal, limits: (f64, f64)) -> f64 {
            let (_, high) = limits;
            signal.percent((0.0, high))
        }
    }
    "pid-inputs-are-percentages" {
        fn percent(&self, signal: Signal, _limits: (f64, f64)) -> f64 { signal.value }
    }
    "pid-target-in-limits-of-feedback" {
        fn target_limits(&self, _own: Option<(f64, f64)>, of_feedback: (f64, f64)) -> (f64, f64) {
            of_feedback
        }
    }
};

/// A link whose number is another one, if it has that source.
fn numbered(link: Link, source: u8, number: u8) -> Link {
    if link.source == source { Link { number, ..link } } else { link }
}

/// A link to the message of the output itself, if it is one to a process value.
fn own_message(link: Link, concerned: bool, place: usize) -> Link {
    let is_process_value = link.source == 1 && (1..=10).contains(&link.number);
    let number = place as u8 + 1;
    if concerned && is_process_value { Link { number, ..link } } else { link }
}

/// A link to another source, if it has that one.
fn sourced(link: Link, from: u8, to: u8) -> Link {
    if link.source == from { Link { source: to, number: link.number.max(1) } } else { link }
}

/// A link to nothing, if its number is not 1.
fn first_only(link: Link, source: u8) -> Link {
    if link.source == source && link.number != 1 { Link::default() } else { link }
}

/// A link to nothing, if its number is beyond a last one.
fn up_to(link: Link, source: u8, last: u8) -> Link {
    if link.source == source && link.number > last { Link::default() } else { link }
}

/// The place of a block of a kind of which there are only so many.
fn wrapped(kind: u16, place: usize, of: u16, count: usize) -> usize {
    if kind == of { place % count } else { place }
}
