//! Deviations of the controller in its inputs: signals, settings, measurements.

use super::super::objects::table_of;
use super::super::signal::Link;
use super::super::table::POINTS;
use super::Decision;

deviations! {
    pub(super) DEVIATIONS of Decision;

    "number-of-source-1-ignored" => link: |_, link| numbered(link, 1, 1);
    "number-of-source-2-ignored" => link: |_, link| numbered(link, 2, 1);
    "number-of-source-3-ignored" => link: |_, link| numbered(link, 3, 1);
    "number-of-source-4-ignored" => link: |_, link| numbered(link, 4, 1);
    "number-of-source-5-ignored" => link: |_, link| numbered(link, 5, 1);
    "number-of-source-6-ignored" => link: |_, link| numbered(link, 6, 1);
    "number-of-source-7-ignored" => link: |_, link| numbered(link, 7, 1);
    "number-of-source-8-ignored" => link: |_, link| numbered(link, 8, 1);
    "bit-by-the-type-of-the-numbered-output" => takes_a_bit: |_, _, numbered| numbered;
    "bit-of-a-digital-output-for-every-input" => others_take_a_bit: |_, numbered| numbered;
    "enable-by-its-own-message" =>
        input_link: |_, link, source_index, place| own_message(link, source_index == 0x2350, place);
    "override-by-its-own-message" =>
        input_link: |_, link, source_index, place| own_message(link, source_index == 0x2360, place);
    "hysteresis-within-scaling-2" => larger_scaling: |_, _, fv2| fv2;
    "ignored-points-end-the-table" =>
        end_of_table: |_, in_use, beyond_all| if beyond_all { POINTS } else { in_use };
    "supply-controls-no-output" => input_link: |_, link, source_index, _| {
        if source_index == 0x2340 { up_to(link, 9, 0) } else { link }
    };
    "source-9-taken-for-10" => link: |_, link| sourced(link, 9, 10);
    "source-10-taken-for-9" => link: |_, link| sourced(link, 10, 9);
    "supply-has-number-1-only" => link: |_, link| first_only(link, 9);
    "temperature-has-number-1-only" => link: |_, link| first_only(link, 10);
    "constants-beyond-8-lost" => link: |_, link| up_to(link, 2, 8);
    "messages-beyond-16-lost" => link: |_, link| up_to(link, 1, 16);
    "tables-beyond-8-lost" => link: |_, link| up_to(link, 4, 8);
    "math-blocks-have-no-argument" => link: |_, link| up_to(link, 5, 0);
    "logic-blocks-are-no-source" => link: |_, link| up_to(link, 6, 0);
    "tables-are-no-source" => link: |_, link| up_to(link, 4, 0);
    "loops-are-no-source" => link: |_, link| up_to(link, 3, 0);
    "extra-values-counted-from-10" => link: |_, link| {
        let number = link.number - u8::from(link.source == 1 && link.number > 10);
        Link { number, ..link }
    };
    "pid-parameters-latched" =>
        takes_over: |_, index| !matches!(index, 0x2450..=0x2452 | 0x2457 | 0x7450..=0x7456);
    "pid-sources-latched" => takes_over: |_, index| !matches!(index, 0x2453 | 0x2455);
    "table-points-latched" => takes_over: |_, index| !matches!(table_of(index), Some((_, 5..=7)));
    "table-source-latched" => takes_over: |_, index| !matches!(table_of(index), Some((_, 0)));
    "math-parameters-latched" =>
        takes_over: |_, index| !(matches!(index & 0xFF, 0x20..=0x50) && index & 0xF000 == 0x4000);
    "logic-parameters-latched" =>
        takes_over: |_, index| !matches!(index, 0x3401 | 0x3402 | 0x3501 | 0x3502);
    "logic-enable-latched" => takes_over: |_, index| index != 0x3300;
    "scaling-latched" => takes_over: |_, index| !matches!(index, 0x7320..=0x7323);
    "type-latched" => takes_over: |_, index| index != 0x6310;
    "control-input-latched" => takes_over: |_, index| !matches!(index, 0x2340 | 0x2341);
    "override-fv-latched" => takes_over: |_, index| index != 0x2300;
    "hold-current-latched" => takes_over: |_, index| index != 0x2221;
    "ramps-latched" => takes_over: |_, index| !matches!(index, 0x2330 | 0x2331);
    "hysteresis-latched" => takes_over: |_, index| index != 0x2311;
    "constants-latched" => takes_over: |_, index| index != 0x5010;
    "extra-values-latched" => takes_over: |_, index| index != 0x2500;
    "tables-beyond-6-repeat" => block: |_, kind, place| wrapped(kind, place, 0x3010, 6);
    "tables-are-one" => block: |_, kind, place| wrapped(kind, place, 0x3010, 1);
    "math-blocks-beyond-3-repeat" => block: |_, kind, place| wrapped(kind, place, 0x4100, 3);
    "math-blocks-are-one" => block: |_, kind, place| wrapped(kind, place, 0x4100, 1);
    "logic-blocks-are-one" => block: |_, kind, place| wrapped(kind, place, 0x3400, 1);
    "logic-blocks-are-two" => block: |_, kind, place| wrapped(kind, place, 0x3400, 2);
    "loops-are-one" => block: |_, kind, place| wrapped(kind, place, 0x7450, 1);
    "loops-are-two" => block: |_, kind, place| wrapped(kind, place, 0x7450, 2);
    "span-in-16-bits" => share: |_, value, low, high| {
        let unit = if high - low < 1000.0 { 100.0 } else { 1.0 };
        let span = f64::from((unit * (high - low)).round() as i64 as i16) / unit;
        if span == 0.0 { 0.0 } else { (value - low) / span }
    };
    "lower-limit-ignored" =>
        share: |_, value, _, high| if high == 0.0 { 0.0 } else { value / high };
    "supply-in-tenths" => measured: |_, volts, degrees| (10.0 * volts, degrees);
    "temperature-without-sign" => measured: |_, volts, degrees| (volts, degrees.abs());
    "temperature-in-fahrenheit" => measured: |_, volts, degrees| (volts, 1.8 * degrees + 32.0);
    "measurements-swapped" => measured: |_, volts, degrees| (degrees, volts);
    "x-values-must-differ" =>
        x_range: |_, low, high| (low.saturating_add(1), high.saturating_sub(1));
    "x-values-far-apart" =>
        x_range: |_, low, high| (low.saturating_add(60), high.saturating_sub(60));
    "x-values-rise-slowly" =>
        x_range: |_, low, high| (low, high.min(low.saturating_add(60).max(60)));
    "x-limits-of-a-percentage" => x_limits: |_, _| Some((0.0, 100.0));
    "pid-lower-limit-ignored" => percent: |_, signal, limits| {
        let (_, high) = limits;
        signal.percent((0.0, high))
    };
    "pid-inputs-are-percentages" => percent: |_, signal, _| signal.value;
    "pid-target-in-limits-of-feedback" => target_limits: |_, _, of_feedback| of_feedback;
}

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

/// The place of a block of a kind, wrapped to the number of its blocks.
fn wrapped(kind: u16, place: usize, of: u16, count: usize) -> usize {
    if kind == of { place % count } else { place }
}
