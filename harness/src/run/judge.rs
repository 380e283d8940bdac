//! Differences between what was expected and what came.

use canopen::eds::Entry;
use canopen::sdo::Failure;
use canopen::{BusError, DataType, Frame};
use reports::Excerpt;

use crate::plan::show_bytes;
use crate::source::{Place, Source};
use crate::suite::refusal::Refusal;

/// What was expected, and what came instead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Difference {
    /// What a conformant device does.
    pub expected: String,
    /// What this one did.
    pub actual: String,
    /// The frame in question.
    pub raw: Option<Frame>,
    /// The line of the data sheet in question.
    pub sheet: Option<Box<Excerpt>>,
}

impl Difference {
    /// A difference without a frame of its own.
    pub(super) fn new(expected: impl Into<String>, actual: impl Into<String>) -> Self {
        Self { expected: expected.into(), actual: actual.into(), raw: None, sheet: None }
    }

    /// The same, about a frame.
    pub(super) fn about(self, frame: Frame) -> Self {
        Self { raw: Some(frame), ..self }
    }
}

/// Why a step did not succeed.
#[derive(Clone, Debug)]
pub(super) enum Trouble {
    /// The device did something else.
    Device(Difference),
    /// The step could not be made; no statement about the device.
    Impossible(String),
    /// The bus failed.
    Bus(BusError),
    /// The device refused, as it may, so that there is nothing left to judge: what it refused.
    Declined(String),
}

impl From<BusError> for Trouble {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// How a step succeeded: as a conformant device does, or in a way that is accepted, too.
pub(super) type Judgement = Result<Option<Difference>, Trouble>;

/// The device did something else.
///
/// # Errors
/// Always.
pub(crate) fn device(difference: Difference) -> Judgement {
    Err(Trouble::Device(difference))
}

/// Judges the end of a transfer that was to be refused.
pub(super) fn refusal(
    result: &Result<Vec<u8>, Failure>,
    refusal: &Refusal,
    raw: Option<Frame>,
) -> Judgement {
    let expected = refusal.to_string();
    let difference =
        |actual: String| Difference { raw, ..Difference::new(expected.clone(), actual) };
    match result {
        Err(Failure::Aborted(code)) if refusal.codes.contains(&code.0) => Ok(None),
        Err(Failure::Aborted(code)) if refusal.lenient.iter().any(|may| may.fits(code.0)) => {
            Ok(Some(difference(format!("refused with {code}"))))
        }
        Err(failure) => Err(Trouble::Device(difference(failure.to_string()))),
        Ok(_) if refusal.or_taken => Ok(Some(difference("accepted".to_owned()))),
        Ok(data) if data.is_empty() => Err(Trouble::Device(difference("accepted".to_owned()))),
        Ok(data) => Err(Trouble::Device(difference(format!("answered {}", show_bytes(data))))),
    }
}

/// A value for people: `100 (64h)`.
pub(super) fn show(entry: Option<&Entry>, bytes: &[u8]) -> String {
    let data_type = entry.map_or(DataType::OCTET_STRING, |entry| entry.data_type);
    data_type
        .decode(bytes)
        .map_or_else(|error| format!("{} ({error})", show_bytes(bytes)), |value| value.to_string())
}

/// What a value must be, in bytes of the entry's type.
#[derive(Clone, Debug, Default)]
pub(super) struct Condition {
    /// The value.
    pub value: Option<Vec<u8>>,
    /// What is accepted instead of it.
    pub tolerated: Vec<Vec<u8>>,
    /// The bits of it that count.
    pub mask: Option<Vec<u8>>,
    /// The smallest.
    pub min: Option<Vec<u8>>,
    /// The largest.
    pub max: Option<Vec<u8>>,
    /// The length in bytes.
    pub length: Option<usize>,
    /// It is readable ASCII, one character at least and so many at most.
    pub characters: Option<usize>,
}

impl Condition {
    /// Judges a value; the difference of one that is accepted, too.
    ///
    /// # Errors
    /// The first difference.
    pub(super) fn judge(
        &self,
        entry: Option<&Entry>,
        got: &[u8],
    ) -> Result<Option<Difference>, Difference> {
        let actual = show(entry, got);
        let fail =
            |expected: String| Err::<Option<_>, _>(Difference::new(expected, actual.clone()));
        if let Some(length) = self.length
            && length != got.len()
        {
            return Err(Difference::new(format!("{length} bytes"), format!("{} bytes", got.len())));
        }
        if let Some(size) = entry.and_then(|entry| entry.data_type.size())
            && size != got.len()
        {
            let data_type = entry.map_or(DataType::DOMAIN, |entry| entry.data_type);
            return fail(format!("{size} bytes of {data_type}"));
        }
        if let Some(most) = self.characters
            && !is_text(got, most)
        {
            return fail(format!("1 to {most} readable characters of ASCII"));
        }
        let mut lenient = None;
        if let Some(value) = self.value.as_ref().filter(|value| !self.same(value, got)) {
            let shown = show(entry, value);
            let expected = match &self.mask {
                None => shown,
                Some(mask) => format!("{shown} in the bits {}", show(entry, mask)),
            };
            if !self.tolerated.iter().any(|value| self.same(value, got)) {
                return fail(expected);
            }
            lenient = fail(expected).err();
        }
        let number = |bytes: &[u8]| entry?.data_type.decode(bytes).ok()?.as_real();
        for (bound, word) in [(&self.min, "at least"), (&self.max, "at most")] {
            let Some(bound) = bound else { continue };
            let order = number(got).zip(number(bound)).map(|(got, bound)| got.total_cmp(&bound));
            let wrong = match word {
                "at least" => order.is_none_or(std::cmp::Ordering::is_lt),
                _ => order.is_none_or(std::cmp::Ordering::is_gt),
            };
            if wrong {
                return fail(format!("{word} {}", show(entry, bound)));
            }
        }
        Ok(lenient)
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
pub(super) fn excerpt(source: &Source, place: Place) -> Excerpt {
    let line = source.line(place.line);
    let code = line.split(" #").next().unwrap_or(line).trim_end().chars().count();
    Excerpt {
        file: source.name.clone(),
        line: place.line as u32,
        column: place.column as u32,
        length: (code + 1).saturating_sub(place.column).max(1) as u32,
        source: line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_readable_and_not_too_long() {
        let condition = Condition { characters: Some(4), ..Condition::default() };
        for (text, fits) in [("H/C ", true), ("x", true), ("", false), ("heats", false)] {
            assert_eq!(condition.judge(None, text.as_bytes()).is_ok(), fits, "{text:?}");
        }
        for bytes in [&b"a\n"[..], &[0x4B, 0xFC], &[0x4B, 0]] {
            let wrong = condition.judge(None, bytes).unwrap_err();
            assert_eq!(wrong.expected, "1 to 4 readable characters of ASCII");
        }
    }
}
