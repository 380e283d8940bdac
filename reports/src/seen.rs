//! Observations: a problem without the requirement, the case and the circumstances in which it came
//! up.

use canopen::{emcy, heartbeat};

use crate::cause::{alike, is_code, object, of_its_kind};
use crate::verdict::{Phase, Problem};

/// An observation. Two problems with an equal one have one reason.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Seen {
    /// This bit of an object of the communication is set, or clear, and should not be.
    Bit(String, u8, bool),
    /// No error control message comes, or too late.
    NoErrorControl,
    /// An object cannot be accessed in this way, whatever the value.
    Refused(String, String),
    /// What is to be refused in one way is refused in another way, whatever the object.
    Otherwise(String, String),
    /// What is to be refused in this way, whatever the object, is accepted.
    Accepted(String),
    /// A value has another length than its transfer announced.
    Length,
    /// Transfers have something else in place of this, whatever is read.
    Transfer(String),
    /// An object of the communication is expected to have this value, and differs in this way.
    Value(String, String),
}

/// What a problem says about the device, as far as that does not depend on the case.
pub(crate) fn seen(problem: &Problem) -> Vec<Seen> {
    let (expected, actual) = (first_line(&problem.expected), first_line(&problem.actual));
    let mut all: Vec<Seen> = bits(problem).collect();
    if error_control(expected) && (is_missing(actual) || is_late(expected, actual)) {
        all.push(Seen::NoErrorControl);
    }
    if problem.phase == Phase::Monitor {
        return all;
    }
    let due = actual.split_once(" instead of ").filter(|_| expected.starts_with("the value of "));
    match due.map_or(expected, |(_, due)| due) {
        length if length.contains(" bytes in all, as announced") => all.push(Seen::Length),
        other if due.is_some() => all.push(Seen::Transfer(alike(other))),
        _ => {}
    }
    let refusal = expected.strip_prefix("refused with ").and_then(code);
    if let Some(code) = refusal.filter(|code| is_of_any_object(code) && actual == "accepted") {
        all.push(Seen::Accepted(code.to_owned()));
    }
    if expected.starts_with("refused with ") && actual.starts_with("refused with ") {
        all.push(Seen::Otherwise(expected.to_owned(), actual.to_owned()));
    }
    let Some(mux) = object(problem) else { return all };
    let object = of_its_kind(mux);
    let code = actual.strip_prefix("refused with ").and_then(code);
    match code.filter(|code| OF_ACCESS.contains(code)) {
        Some(code) if !expected.starts_with("refused") => {
            all.push(Seen::Refused(object, code.to_owned()));
        }
        _ if COMMUNICATION.contains(&mux.index) && expected.starts_with(&mux.to_string()) => {
            let apart = problem.apart.as_deref().unwrap_or_default();
            let way = ["too large", "too small"].into_iter().find(|way| apart.starts_with(way));
            let way = way.map_or_else(|| alike(actual), str::to_owned);
            all.push(Seen::Value(expected.to_owned(), way));
        }
        _ => {}
    }
    all
}

/// The bits in which an object of the communication differs: by SDO, or of the error register in
/// an emergency message.
fn bits(problem: &Problem) -> impl Iterator<Item = Seen> {
    let apart = problem.apart.as_deref().unwrap_or_default();
    let expected = first_line(&problem.expected);
    let read = || {
        let mux = object(problem).filter(|mux| COMMUNICATION.contains(&mux.index))?;
        let is_field = mux.index == ERROR_REGISTER || expected.contains(" in the bits ");
        let value = first_line(&problem.actual).split(' ').next()?.parse().ok()?;
        is_field.then(|| (of_its_kind(mux), value, apart))
    };
    let told = || {
        let id =
            identifier(expected).filter(|id| (emcy::COB_ID + 1..=emcy::COB_ID + 0x7F).contains(id));
        let (_, byte) = apart.split_once("byte 2 is ").filter(|_| id.is_some())?;
        let (value, bits) = byte.split_once(": ")?;
        let bits = bits.split(';').next()?;
        Some((format!("{ERROR_REGISTER:04X}:00"), u64::from_str_radix(value, 16).ok()?, bits))
    };
    let found = read().or_else(told);
    found.into_iter().flat_map(|(object, value, bits)| {
        let listed = bits.strip_prefix("bits ").or_else(|| bits.strip_prefix("bit "));
        let numbers = listed.unwrap_or_default().split(" differ").next().unwrap_or_default();
        let numbers = numbers.split(", ").filter_map(|number| number.parse::<u8>().ok());
        let numbers: Vec<u8> = numbers.filter(|bit| *bit < 64).collect();
        numbers.into_iter().map(move |bit| Seen::Bit(object.clone(), bit, value >> bit & 1 == 1))
    })
}

/// Whether a message of error control is expected other than that of the boot-up.
fn error_control(expected: &str) -> bool {
    let range = heartbeat::COB_ID + 1..=heartbeat::COB_ID + 0x7F;
    let named = || identifier(expected).is_some_and(|id| range.contains(&id));
    (named() || expected.starts_with("a heartbeat ")) && !expected.ends_with("#00")
}

/// The identifier of the frames that are expected: `702#05`, `4 frames 702#7F`, `interval of 702:`.
fn identifier(expected: &str) -> Option<u16> {
    expected.split(' ').find_map(|word| {
        let id = word.split_once('#').map_or_else(|| word.strip_suffix(':'), |(id, _)| Some(id))?;
        (id.len() == 3).then(|| u16::from_str_radix(id, 16).ok())?
    })
}

/// Whether no frame with the identifier came, or too few.
fn is_missing(actual: &str) -> bool {
    let nothing = ["no matching frame within ", "no frame ", "none for "];
    let none = nothing.iter().any(|begin| actual.starts_with(begin));
    none && !actual.contains("other frame") || actual.contains(", then none for ")
}

/// Whether a time is longer than the last one of those that are expected.
fn is_late(expected: &str, actual: &str) -> bool {
    let bounds = expected.split_once("interval of ").map(|(_, bounds)| bounds);
    let longest =
        bounds.and_then(|bounds| bounds.rsplit_once(" to ")).and_then(|(_, end)| time(end));
    longest.zip(time(actual)).is_some_and(|(longest, took)| took > longest)
}

/// A time in milliseconds.
fn time(text: &str) -> Option<f64> {
    let (number, unit) = text.split_once(' ')?;
    let factor = match unit {
        "us" => 0.001,
        "ms" => 1.0,
        "s" => 1000.0,
        _ => return None,
    };
    Some(number.parse::<f64>().ok()? * factor)
}

/// The abort code at the beginning, `0601 0002h`.
fn code(text: &str) -> Option<&str> {
    let mut words = text.split(' ');
    is_code(words.next()?, words.next().as_ref()).then(|| text.get(..10))?
}

/// Whether the code is about an access or a length, which a server checks alike for all objects.
fn is_of_any_object(code: &str) -> bool {
    OF_ACCESS.contains(&code) || code.starts_with("0607 ")
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// The objects whose meaning CiA 301 fixes. An object of an application shows many functions.
const COMMUNICATION: std::ops::Range<u16> = 0x1000..0x2000;
const ERROR_REGISTER: u16 = 0x1001;
/// The refusals of an access as such: unsupported, write only, read only, no object, no sub-index.
const OF_ACCESS: [&str; 5] = ["0601 0000h", "0601 0001h", "0601 0002h", "0602 0000h", "0609 0011h"];

#[cfg(test)]
mod tests {
    use super::*;

    fn of(expected: &str, actual: &str, apart: Option<&str>, raw: Option<&str>) -> Vec<Seen> {
        let apart = apart.map(str::to_owned);
        seen(&Problem { apart, ..Problem::of_step(expected, actual, raw) })
    }

    #[test]
    fn a_bit_is_the_same_in_the_object_and_in_an_emergency_message() {
        let missing = Seen::Bit("1001:00".into(), 0, false);
        for (expected, actual, apart) in [
            ("1001:00 = 1 in the bits 1", "16 (10h)", "bit 0 differs"),
            ("1001:00 = 17 (11h) in the bits 17 (11h) within 400 ms", "0", "bits 0, 4 differ"),
            ("1001:00 = 5", "4", "bit 0 differs"),
            (
                "082#40 81 11 ...",
                "no matching frame within 100 ms; 1 other frame with identifier 082: EMCY",
                "byte 2 is 10: bit 0 differs (bytes and bits are counted from 0)",
            ),
        ] {
            assert!(of(expected, actual, Some(apart), None).contains(&missing), "{expected}");
        }
        let set = of("1001:00 = 0 in the bits 1", "1", Some("bit 0 differs"), None);
        assert!(!set.contains(&missing), "a bit that is never cleared is another fact");
        assert_eq!(of("6000:01 = 1 in the bits 1", "0", Some("bit 0 differs"), None), []);
    }

    #[test]
    fn a_refusal_by_another_code_is_the_same_whatever_the_object() {
        let (code, other) = ("refused with 0601 0002h (read-only)", "refused with 0800 0020h");
        let raw = |frame| of(code, other, None, Some(frame));
        let first = raw("582#8000100020000008");
        assert_eq!(first, raw("582#8008100020000008"));
        assert!(first.contains(&Seen::Otherwise(code.into(), other.into())));
        assert!(!of(code, "accepted", None, None).iter().any(|seen| first.contains(seen)));
    }

    #[test]
    fn a_wrong_length_that_is_accepted_is_the_same_whatever_the_object() {
        let raw = |frame| of("refused with 0607 0012h (too long)", "accepted", None, Some(frame));
        assert_eq!(raw("582#6017100000000000"), [Seen::Accepted("0607 0012h".into())]);
        assert_eq!(raw("582#6017100000000000"), raw("582#6000180200000000"));
        // A value out of a range is a matter of its object.
        assert_eq!(of("refused with 0609 0030h", "accepted", None, None), []);
    }

    #[test]
    fn a_transfer_of_another_length_than_announced_is_the_same_whatever_is_tested() {
        let came = "1B 37 00 00 00 00 00 00";
        assert_eq!(of("22 bytes in all, as announced", came, None, None), [Seen::Length]);
        let read = format!("{came} instead of 22 bytes in all, as announced");
        assert_eq!(of("the value of 1008:00", &read, None, None), [Seen::Length]);
    }

    #[test]
    fn a_wrong_frame_of_a_transfer_is_the_same_whatever_is_read() {
        let toggle = "01 32 00 00 00 00 00 00 instead of toggle 1";
        let of_name = of("the value of 1008:00", toggle, None, None);
        assert_eq!(of_name, of("the value of 1009:00", toggle, None, None));
        assert!(matches!(of_name[..], [Seen::Transfer(_)]), "{of_name:?}");
    }

    #[test]
    fn a_heartbeat_is_late_or_missing_whatever_state_it_would_tell() {
        for (expected, actual) in [
            ("702#05", "no matching frame within 200 ms"),
            ("702#7F", "no frame 702 within 200 ms"),
            ("4 frames 702#7F", "0, then none for 132.27 ms"),
            ("a heartbeat every 10 ms", "none for 30 ms"),
            ("interval of 702: 53.865 ms to 66.135 ms", "120 ms"),
            ("median interval of 702: 990 ms to 1.01 s", "2 s"),
        ] {
            assert_eq!(of(expected, actual, None, None), [Seen::NoErrorControl], "{expected}");
        }
        for (expected, actual) in [
            ("702#00", "no matching frame within 2 s"),
            ("182#05", "no matching frame within 200 ms"),
            ("interval of 702: 53.865 ms to 66.135 ms", "20 ms"),
            ("702#04", "no matching frame within 200 ms; 1 other frame with identifier 702: ..."),
        ] {
            assert_eq!(of(expected, actual, None, None), [], "{expected}");
        }
    }

    #[test]
    fn an_access_that_is_refused_as_such_is_one_observation() {
        let refused = "refused with 0601 0002h (a read-only object cannot be written)";
        let raw = Some("582#8014100002000106");
        let setup = of("1014:00 takes 130 (82h)", refused, None, raw);
        assert_eq!(setup, of("accepted", refused, None, raw));
        let value = "refused with 0609 0030h (invalid value for parameter)";
        let raw = Some("582#8014100030000906");
        assert_eq!(
            of("1014:00 takes 130 (82h)", value, None, raw),
            [Seen::Value("1014:00 takes 130 (82h)".into(), value.into(),)]
        );
    }
}
