//! Differences between the expected and the actual behaviour.

use std::cmp::Ordering;

use canopen::eds::Entry;
use canopen::sdo::Failure;
use canopen::{BusError, DataType, Frame};
use reports::Excerpt;

use super::apart;
use crate::plan::show_bytes;
use crate::source::{Place, Source};
use crate::suite::Words;
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::literal::ObjectRef;
use crate::suite::refusal::Refusal;

/// The expected and the actual behaviour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::run) struct Difference {
    /// The behaviour of a conformant device.
    pub expected: String,
    /// The actual behaviour of this device.
    pub actual: String,
    /// The frame in question.
    pub raw: Option<Frame>,
    /// How far both are apart.
    pub apart: Option<String>,
    /// The line of the data sheet in question.
    pub sheet: Option<Box<Excerpt>>,
}

impl Difference {
    /// A difference without a frame of its own.
    pub(in crate::run) fn new(expected: impl Into<String>, actual: impl Into<String>) -> Self {
        let (expected, actual) = (expected.into(), actual.into());
        Self { expected, actual, raw: None, apart: None, sheet: None }
    }

    /// The same, about a frame.
    pub(super) fn about(self, frame: Frame) -> Self {
        Self { raw: Some(frame), ..self }
    }
}

/// Why a step did not succeed.
#[derive(Clone, Debug)]
pub(in crate::run) enum Trouble {
    /// The device did something else.
    Device(Difference),
    /// The step could not be made; no statement about the device.
    Impossible(String),
    /// The step says nothing on this bus, or about this device, which is protected from it.
    Unjudged(String),
    /// The bus failed.
    Bus(BusError),
    /// The device did what it may do instead, after which nothing is left to judge.
    Declined(String),
}

impl Trouble {
    /// The device's difference from the expected behaviour.
    pub(in crate::run) const fn of_device(&self) -> Option<&Difference> {
        match self {
            Self::Device(difference) => Some(difference),
            Self::Bus(_) | Self::Impossible(_) | Self::Unjudged(_) | Self::Declined(_) => None,
        }
    }
}

impl From<BusError> for Trouble {
    fn from(error: BusError) -> Self {
        match error {
            BusError::Withheld(why) => Self::Unjudged(why),
            error => Self::Bus(error),
        }
    }
}

/// How a step succeeded: as a conformant device does, or in a way that is accepted, too.
pub(in crate::run) type Judgement = Result<Option<Difference>, Trouble>;

/// How the end of a transfer fits the expected refusal.
pub(super) enum Answer {
    /// As demanded.
    Demanded,
    /// In a way that is accepted, too.
    Allowed(Allowance, Difference),
    /// Otherwise: the broken parts of the demand; none means the whole demand.
    Wrong(Vec<Constraint>, Difference),
}

/// Judges the end of a transfer that must be refused.
pub(super) fn refusal(
    result: &Result<Vec<u8>, Failure>,
    refusal: &Refusal,
    raw: Option<Frame>,
) -> Answer {
    let expected = refusal.to_string();
    let difference =
        |actual: String| Difference { raw, ..Difference::new(expected.clone(), actual) };
    match result {
        Err(Failure::Aborted(code)) if refusal.codes.contains(&code.0) => Answer::Demanded,
        Err(Failure::Aborted(code)) => {
            match refusal.lenient.iter().position(|may| may.fits(code.0)) {
                Some(place) => Answer::Allowed(
                    Allowance::Lenient(place + 1),
                    difference(format!("refused with {code}")),
                ),
                None => {
                    let wrong = difference(Failure::Aborted(*code).to_string());
                    Answer::Wrong(vec![Constraint::AbortCode], wrong)
                }
            }
        }
        Err(failure) => Answer::Wrong(Vec::new(), difference(failure.to_string())),
        Ok(_) if refusal.or_taken => {
            Answer::Allowed(Allowance::Taken, difference("accepted".to_owned()))
        }
        Ok(data) if data.is_empty() => {
            Answer::Wrong(vec![Constraint::Refused], difference("accepted".to_owned()))
        }
        Ok(data) => {
            let answered = difference(format!("answered {}", show_bytes(data)));
            Answer::Wrong(vec![Constraint::Refused], answered)
        }
    }
}

/// A value for people: `100 (64h)`, `80000082h` of a COB-ID. Of a long one the beginning.
pub(super) fn show(entry: Option<&Entry>, bytes: &[u8]) -> String {
    let data_type = entry.map_or(DataType::OCTET_STRING, |entry| entry.data_type);
    match data_type.decode(bytes) {
        Ok(_) if bytes.len() > LONG => format!("[{}]", show_bytes(bytes)),
        Ok(value) => entry.map_or_else(|| value.to_string(), |entry| value.of(entry.mux)),
        Err(error) => format!("{} ({error})", show_bytes(bytes)),
    }
}

/// More bytes than a person compares.
const LONG: usize = 64;

/// The required value, in bytes of the entry's type.
#[derive(Clone, Debug, Default)]
pub(super) struct Condition<'w> {
    /// The value.
    pub value: Option<Vec<u8>>,
    /// The values accepted instead of it.
    pub tolerated: Vec<Vec<u8>>,
    /// The bits of it that count.
    pub mask: Option<Vec<u8>>,
    /// The smallest.
    pub min: Option<Vec<u8>>,
    /// The largest.
    pub max: Option<Vec<u8>>,
    /// The length in bytes.
    pub length: Option<usize>,
    /// It is readable ASCII, with at least one character and at most this many.
    pub characters: Option<usize>,
    /// The suite's words for its values, and the object as the step has it.
    pub words: Option<(&'w Words, &'w ObjectRef)>,
}

/// How a value is.
#[derive(Debug)]
pub(super) enum Judged {
    /// As it must be.
    Right,
    /// The value in that place of those that are tolerated, counted from 1.
    Tolerated(usize, Difference),
    /// Otherwise: the broken parts of the condition, and the first difference. No parts when the
    /// value does not even have the length of its type.
    Wrong(Vec<Constraint>, Difference),
}

impl Condition<'_> {
    /// A value for people: `greater (2)` if the suite has a word for it.
    fn show(&self, entry: Option<&Entry>, bytes: &[u8]) -> String {
        let number = || entry?.data_type.decode(bytes).ok()?.as_int();
        let worded = self.words.and_then(|(words, object)| {
            let number = number()?;
            Some(format!("{} ({number})", words.value(object, number)?))
        });
        worded.unwrap_or_else(|| show(entry, bytes))
    }

    /// Two values that differ, for people: long ones from the first difference on.
    fn show_both(&self, entry: Option<&Entry>, expected: &[u8], got: &[u8]) -> (String, String) {
        const SHOWN: usize = 16;
        if expected.len().max(got.len()) <= LONG {
            return (self.show(entry, expected), self.show(entry, got));
        }
        let equal = expected.iter().zip(got).take_while(|(one, other)| one == other).count();
        let from_there = |bytes: &[u8]| {
            let rest = &bytes[equal..];
            let shown = match rest.len() {
                0 => "no more".to_owned(),
                1..=SHOWN => show_bytes(rest),
                _ => format!("{} ...", show_bytes(&rest[..SHOWN])),
            };
            format!("from byte {} of {}: {shown}", equal + 1, bytes.len())
        };
        (from_there(expected), from_there(got))
    }

    /// Judges a value.
    pub(super) fn judge(&self, entry: Option<&Entry>, got: &[u8]) -> Judged {
        let actual = self.show(entry, got);
        let differs = |expected: String| Difference::new(expected, actual.clone());
        let mut wrong: Vec<(Constraint, Difference)> = Vec::new();
        if let Some(length) = self.length
            && length != got.len()
        {
            let lengths = (format!("{length} bytes"), format!("{} bytes", got.len()));
            wrong.push((Constraint::Length, Difference::new(lengths.0, lengths.1)));
        }
        // Where the step demands a length, the length of the type is not judged.
        if let Some(size) = entry.and_then(|entry| entry.data_type.size())
            && size != got.len()
            && self.length.is_none()
        {
            let data_type = entry.map_or(DataType::DOMAIN, |entry| entry.data_type);
            return Judged::Wrong(Vec::new(), differs(format!("{size} bytes of {data_type}")));
        }
        // With another length than demanded, it may still be the same value.
        let mut sized = got.to_vec();
        if !wrong.is_empty()
            && let Some(length) = self.length
        {
            sized.resize(length, 0);
        }
        let got = sized.as_slice();
        if let Some(most) = self.characters
            && !is_text(got, most)
        {
            let expected = format!("1 to {most} readable characters of ASCII");
            wrong.push((Constraint::Characters, differs(expected)));
        }
        let mut tolerated = None;
        if let Some(value) = self.value.as_ref().filter(|value| !self.same(value, got)) {
            let (shown, actual) = self.show_both(entry, value, got);
            let expected = match &self.mask {
                None => shown,
                Some(mask) => format!("{shown} in the bits {}", self.show(entry, mask)),
            };
            let apart =
                apart::values(entry, self.words, self.mask.as_deref(), [value.as_slice(), got]);
            let difference = Difference { apart, ..Difference::new(expected, actual) };
            match self.tolerated.iter().position(|value| self.same(value, got)) {
                Some(place) => tolerated = Some((place + 1, difference)),
                None => wrong.push((Constraint::Value, difference)),
            }
        }
        wrong.extend(self.bounds_broken(entry, got, &differs));
        let constraints = wrong.iter().map(|(constraint, _)| constraint.clone()).collect();
        match (wrong.into_iter().next(), tolerated) {
            (Some((_, first)), _) => Judged::Wrong(constraints, first),
            (None, Some((place, difference))) => Judged::Tolerated(place, difference),
            (None, None) => Judged::Right,
        }
    }

    /// Which of `min` and `max` the value breaks.
    fn bounds_broken(
        &self,
        entry: Option<&Entry>,
        got: &[u8],
        differs: &dyn Fn(String) -> Difference,
    ) -> Vec<(Constraint, Difference)> {
        let number = |bytes: &[u8]| entry?.data_type.decode(bytes).ok()?.as_real();
        let order = |bound: &Vec<u8>| {
            number(got).zip(number(bound)).map(|(got, bound)| got.total_cmp(&bound))
        };
        let broken = |what: &str, bound: &Vec<u8>| Difference {
            apart: apart::values(entry, self.words, None, [bound.as_slice(), got]),
            ..differs(format!("{what} {}", self.show(entry, bound)))
        };
        let mut wrong = Vec::new();
        if let Some(min) = &self.min
            && order(min).is_none_or(Ordering::is_lt)
        {
            wrong.push((Constraint::Min, broken("at least", min)));
        }
        if let Some(max) = &self.max
            && order(max).is_none_or(Ordering::is_gt)
        {
            wrong.push((Constraint::Max, broken("at most", max)));
        }
        wrong
    }

    /// Whether two values are equal in the bits that count.
    fn same(&self, value: &[u8], got: &[u8]) -> bool {
        match &self.mask {
            None => value == got,
            Some(mask) => masked(value, mask) == masked(got, mask),
        }
    }
}

/// Whether it is readable ASCII of that length at most, and not nothing.
fn is_text(data: &[u8], most: usize) -> bool {
    (1..=most).contains(&data.len()) && data.iter().all(|byte| matches!(byte, b' '..=b'~'))
}

fn masked(value: &[u8], mask: &[u8]) -> Vec<u8> {
    value.iter().zip(mask).map(|(value, mask)| value & mask).collect()
}

/// A place as reports show it: the stretch is the rest of the line, without its comment.
pub(in crate::run) fn excerpt(source: &Source, place: Place) -> Excerpt {
    let line = source.line(place.line);
    let code = line.split(" #").next().unwrap_or(line).trim_end();
    let from = code.char_indices().nth(place.column.saturating_sub(1));
    let marked = from.map_or("", |(from, _)| in_brackets(&code[from..]));
    Excerpt {
        file: source.name.clone(),
        line: place.line as u32,
        column: place.column as u32,
        length: marked.chars().count().max(1) as u32,
        source: line.to_owned(),
        before: before(source, place.line),
        after: after(source, place.line),
    }
}

/// The lines in front of one, from the beginning of its case or section.
fn before(source: &Source, line: usize) -> Vec<String> {
    const MOST: usize = 16;
    let (mut lines, mut is_first) = (Vec::new(), begins(source.line(line)));
    for number in (1..line).rev().take(MOST) {
        let text = source.line(number);
        if is_first || text.trim().is_empty() {
            break;
        }
        is_first = begins(text);
        lines.push(text.to_owned());
    }
    lines.reverse();
    lines
}

/// The lines after one that belong to the same case or section.
fn after(source: &Source, line: usize) -> Vec<String> {
    const MOST: usize = 3;
    let lines = (line + 1..=line + MOST).map(|number| source.line(number));
    lines.take_while(|text| !text.trim().is_empty() && !begins(text)).map(str::to_owned).collect()
}

/// Whether a case or the section of a data sheet begins.
fn begins(line: &str) -> bool {
    let line = line.trim_start();
    line.starts_with('[') || line.starts_with("- id:")
}

/// A row or a map to its end, when it ends in this line: others may follow. Anything else is whole.
fn in_brackets(text: &str) -> &str {
    if !text.starts_with(['[', '{']) {
        return text;
    }
    let mut depth = 0;
    let end = text.char_indices().find(|(_, symbol)| {
        depth += match symbol {
            '[' | '{' => 1,
            ']' | '}' => -1,
            _ => 0,
        };
        depth == 0
    });
    end.map_or(text, |(end, _)| &text[..=end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_marked_to_its_end() {
        let text = "rows: [[1, { a: [2] }], [3, 4]] # and more";
        let source = Source::new("suites/demo.yaml", text);
        let marked = |column| excerpt(&source, Place::new(1, column)).length as usize;
        assert_eq!(marked(8), "[1, { a: [2] }]".len());
        assert_eq!(marked(1), text.len() - " # and more".len());
    }

    #[test]
    fn long_values_are_shown_from_the_first_difference_on() {
        let mut value = crate::plan::fill(888);
        let condition = Condition { value: Some(value.clone()), ..Condition::default() };
        value[600] = 0xFF;
        let differs = |got: &[u8]| match condition.judge(None, got) {
            Judged::Wrong(_, difference) => (difference.expected, difference.actual),
            other => panic!("{other:?}"),
        };
        let (expected, actual) = differs(&value);
        assert!(expected.starts_with("from byte 601 of 888: 40 41 "), "{expected}");
        assert!(actual.starts_with("from byte 601 of 888: FF 41 "), "{actual}");
        value[600] = 0x40;
        let (expected, actual) = differs(&value[..887]);
        assert_eq!(actual, "from byte 888 of 887: no more");
        assert_eq!(expected, "from byte 888 of 888: 3B");
        assert_eq!(show(None, &value).len(), "[] ... (888 bytes)".len() + 256 * 3 - 1);
    }

    #[test]
    fn a_length_and_a_value_are_judged_apart() {
        let (length, value) = (Some(1), Some(vec![5]));
        let condition = Condition { length, value, ..Condition::default() };
        for (got, broken) in [
            (&[5][..], None),
            (&[5, 0], Some(&[Constraint::Length][..])),
            (&[6], Some(&[Constraint::Value])),
            (&[6, 0], Some(&[Constraint::Length, Constraint::Value])),
        ] {
            let judged = match condition.judge(None, got) {
                Judged::Wrong(constraints, _) => Some(constraints),
                _ => None,
            };
            assert_eq!(judged.as_deref(), broken, "{got:?}");
        }
    }

    #[test]
    fn a_text_is_readable_and_not_too_long() {
        let condition = Condition { characters: Some(4), ..Condition::default() };
        for (text, fits) in [("H/C ", true), ("x", true), ("", false), ("heats", false)] {
            let judged = condition.judge(None, text.as_bytes());
            assert_eq!(matches!(judged, Judged::Right), fits, "{text:?}");
        }
        for bytes in [&b"a\n"[..], &[0x4B, 0xFC], &[0x4B, 0]] {
            let Judged::Wrong(constraints, wrong) = condition.judge(None, bytes) else {
                panic!("{bytes:?} is taken for a text");
            };
            assert_eq!(constraints, [Constraint::Characters]);
            assert_eq!(wrong.expected, "1 to 4 readable characters of ASCII");
        }
    }
}
