//! Causes: the common part of the cases that did not pass.
//!
//! One fault of a device shows in many instances. Two of them have one cause when they check the
//! same requirements, are about the same object, and differ in the same way from the expected
//! result. No other code attributes: terminal, JUnit, journal and waivers all use the causes found
//! here.

use std::fmt;

use canopen::sdo::block::{BlockRequest, BlockResponse};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Mux};
use serde::{Deserialize, Serialize};

use crate::verdict::{Outcome, Phase, Problem};

/// Why an instance did not pass, in the words that it shares with all others of the same cause.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cause {
    /// The ids of the requirements that are checked, separated by blanks. Empty for a monitor,
    /// which watches in every case, and for an ERROR, which says nothing about a requirement.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub requirement: String,
    /// The object, such as `1017:00`; of one that each PDO has, `18xx:01`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// The expected and the actual result, with `*` for the parts that differ from instance to
    /// instance: values, times and the data of frames. For a monitor, its rule.
    pub difference: String,
}

impl Cause {
    /// The cause of the outcome of a case that checks the requirements with these ids, blanks
    /// between them; `None` of an outcome that needs none, and of a case that was not run.
    pub fn of(requirement: &str, outcome: &Outcome) -> Option<Self> {
        if outcome.is_not_run() {
            return None;
        }
        let of_requirement = |problem: &Problem| Self {
            requirement: requirement.to_owned(),
            ..Self::of_problem(problem)
        };
        match outcome {
            Outcome::Pass | Outcome::Skip(_) | Outcome::Blocked(_) | Outcome::Undecided(_) => None,
            Outcome::Waived { outcome, .. } => Self::of(requirement, outcome),
            Outcome::Lenient(problem) | Outcome::Fail(problem) | Outcome::Flaky { problem, .. } => {
                Some(match problem.phase == Phase::Monitor {
                    true => Self::of_problem(problem),
                    false => of_requirement(problem),
                })
            }
            Outcome::Error { problem: Some(problem), .. } => Some(Self::of_problem(problem)),
            Outcome::Error { reason, problem: None } => {
                Some(Self { requirement: String::new(), object: None, difference: alike(reason) })
            }
        }
    }

    fn of_problem(problem: &Problem) -> Self {
        let rule = alike(&problem.expected);
        let (object, difference) = match problem.phase {
            Phase::Monitor => (None, rule),
            _ => (
                object(problem).map(of_its_kind),
                format!("expected {rule}, came {}", alike(&problem.actual)),
            ),
        };
        Self { requirement: String::new(), object, difference }
    }
}

impl Cause {
    /// The same with another difference, such as the values of one instance.
    pub(crate) fn with(&self, difference: &str) -> String {
        let about = [Some(&self.requirement), self.object.as_ref()].into_iter().flatten();
        let about: Vec<&str> = about.map(String::as_str).filter(|text| !text.is_empty()).collect();
        match about.is_empty() {
            true => difference.to_owned(),
            false => format!("{}: {difference}", about.join(", ")),
        }
    }
}

/// `CIA301-PDO-01, 18xx:01: expected refused with 0609 0030h, came accepted`.
impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.with(&self.difference))
    }
}

/// The object that a problem is about: the one that it names first, or that of its SDO frame.
pub(crate) fn object(problem: &Problem) -> Option<Mux> {
    let named = |text: &str| text.split_whitespace().find_map(|word| mux(bare(word)));
    named(&problem.expected)
        .or_else(|| of_frame(problem.raw.as_ref()?))
        .or_else(|| named(&problem.actual))
}

/// The object that an SDO frame on a default identifier is about.
fn of_frame(frame: &Frame) -> Option<Mux> {
    let id = frame.data_id()?;
    let node = id & 0x7F;
    let mux = match id - node {
        RESPONSE_COB_ID => match Response::decode(&frame.data).ok()? {
            Response::Upload(mux, _) | Response::Download(mux) | Response::Abort(mux, _) => mux,
            Response::Block(
                BlockResponse::Download { mux, .. } | BlockResponse::Upload { mux, .. },
            ) => mux,
            _ => return None,
        },
        REQUEST_COB_ID => match Request::decode(&frame.data).ok()? {
            Request::Upload(mux) | Request::Download(mux, _) | Request::Abort(mux, _) => mux,
            Request::Block(
                BlockRequest::Download { mux, .. } | BlockRequest::Upload { mux, .. },
            ) => mux,
            _ => return None,
        },
        _ => return None,
    };
    (mux != Mux::new(0, 0)).then_some(mux)
}

/// An object of a PDO stands for the same object of each other PDO of that direction.
pub(crate) fn of_its_kind(mux: Mux) -> String {
    match (mux.index, mux.sub) {
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, 1..) => format!("{:02X}xx:xx", mux.index >> 8 & !1),
        (0x1400..=0x1BFF, sub) => format!("{:02X}xx:{sub:02X}", mux.index >> 8 & !1),
        _ => mux.to_string(),
    }
}

/// The first line of `text`, with `*` for what differs between instances of one cause.
pub(crate) fn alike(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let words: Vec<&str> = line.split_whitespace().collect();
    let mut out: Vec<String> = Vec::new();
    let mut rest = words.as_slice();
    while let Some((word, after)) = rest.split_first() {
        rest = after;
        if is_code(word, after.first()) {
            out.extend([(*word).to_owned(), after[0].to_owned()]);
            rest = &after[1..];
            continue;
        }
        let (shown, is_data) = match word.split_once('#') {
            Some((id, data)) => (frame(id, data, after), true),
            None if is_value(bare(word)) => ("*".to_owned(), true),
            None => ((*word).to_owned(), false),
        };
        if is_data {
            // Units, the number in hexadecimal, and the bytes after the first.
            let more =
                |word: &&&str| is_byte(bare(word)) || UNITS.contains(&bare(word)) || is_aside(word);
            rest = &rest[rest.iter().take_while(more).count()..];
        }
        if shown != "*" || out.last().is_none_or(|last| last != "*") {
            out.push(shown);
        }
    }
    out.join(" ")
}

/// A frame: its identifier, and the byte that tells the service where it is one of SDO or LSS.
fn frame(id: &str, data: &str, after: &[&str]) -> String {
    let number = u16::from_str_radix(id, 16).unwrap_or(u16::MAX);
    let confirmed = matches!(number, 0x580..=0x67F | 0x7E4 | 0x7E5);
    let alone = data.len() <= 2 && after.first().is_none_or(|next| !is_byte(next));
    match data.get(..2) {
        Some(byte) if confirmed => format!("{id}#{byte} *"),
        _ if alone => format!("{id}#{data}"),
        _ => format!("{id}#*"),
    }
}

/// The two words of an SDO abort code: `0609 0030h`.
pub(crate) fn is_code(word: &str, next: Option<&&str>) -> bool {
    let hex = |text: &str| text.len() == 4 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    hex(word) && next.and_then(|next| bare(next).strip_suffix('h')).is_some_and(hex)
}

fn mux(word: &str) -> Option<Mux> {
    let (index, sub) = word.split_once(':')?;
    let sizes = index.len() == 4 && sub.len() == 2;
    let parse = |text: &str| u16::from_str_radix(text, 16).ok();
    sizes.then_some(Mux::new(parse(index)?, parse(sub)? as u8))
}

/// A word that stands for what differs from instance to instance.
fn is_value(word: &str) -> bool {
    mux(word).is_some() || is_number(word) || is_byte(word) || is_composed(word)
}

/// `007D00C8h`, the value of a COB-ID, a monitored node or a mapping.
fn is_composed(word: &str) -> bool {
    let digits = word.strip_suffix('h').unwrap_or_default();
    digits.len() == 8 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
}

fn is_number(word: &str) -> bool {
    let digits = word.trim_start_matches('-');
    digits.starts_with(|first: char| first.is_ascii_digit()) && digits.parse::<f64>().is_ok()
}

fn is_byte(word: &str) -> bool {
    let digit = |byte: u8| byte == b'.' || byte.is_ascii_digit() || (b'A'..=b'F').contains(&byte);
    word == "..." || word.len() == 2 && word.bytes().all(digit)
}

/// `(12Ch)` after a number.
fn is_aside(word: &str) -> bool {
    word.starts_with('(') && bare(word).ends_with('h') && bare(word).len() > 1
}

/// A word without the marks around it.
fn bare(word: &str) -> &str {
    let end = |mark: char| matches!(mark, ',' | ';' | ':' | ')');
    let word = word.trim_start_matches('(');
    if word == "..." { word } else { word.trim_end_matches(end) }
}

const UNITS: [&str; 6] = ["us", "ms", "s", "%", "bytes", "byte"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_from_instance_to_instance_is_left_out() {
        for (text, alike_text) in [
            ("refused with 0609 0030h (value not valid for the object)", ""),
            (
                "no matching frame within 10 ms; other frames",
                "no matching frame within * other frames",
            ),
            ("1017:00 = 100 (64h)", "* = *"),
            ("1016:01 = 007D00C8h", "* = *"),
            ("answered 00 00 00 00", "answered *"),
            ("585#80 17 10 00 12 00 07 06", "585#80 *"),
            ("no 582#... for 100 ms", "no 582#.. * for *"),
            ("182#65 00", "182#*"),
            ("705#7F", "705#7F"),
            (
                "SDO node 2: uploaded 1000:00 = 00 00 (2 bytes) after 1.295 ms",
                "SDO node * uploaded * = * after *",
            ),
            ("EMCY node 2: 8210h (PDO not processed)", "EMCY node * 8210h (PDO not processed)"),
            ("7FFh", "7FFh"),
        ] {
            let expected = if alike_text.is_empty() { text } else { alike_text };
            assert_eq!(alike(text), expected);
        }
    }

    #[test]
    fn objects_of_pdos_are_of_one_kind() {
        let of =
            |raw| Cause::of_problem(&Problem::of_step("refused", "accepted", Some(raw))).object;
        for raw in ["581#6000180100000000", "581#6001180100000000", "581#60FF190100000000"] {
            assert_eq!(of(raw).as_deref(), Some("18xx:01"), "{raw}");
        }
        assert_eq!(of("581#60011A0300000000").as_deref(), Some("1Axx:xx"));
        assert_eq!(of("581#6017100000000000").as_deref(), Some("1017:00"));
        assert_eq!(of("181#6017100000000000"), None);
    }

    #[test]
    fn a_monitor_is_its_rule() {
        let mut of_monitor =
            Problem::of_step("no emergency message without a cause", "8130h", None);
        of_monitor.phase = Phase::Monitor;
        let cause = Cause::of_problem(&of_monitor);
        assert_eq!(cause.to_string(), "no emergency message without a cause");
    }
}
