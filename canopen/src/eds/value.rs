//! Default values and limits: text to typed values and back.

use crate::value::{DataType, Value};

use super::codes::{self, Code};
use super::diagnostic::{Findings, Place};
use super::ini::Key;
use super::model::Term;
use super::number::{Number, Remark, Sum, without_comment};

/// The value of `key` in that type. `None` when it has none, or one that was reported and is
/// better kept as text.
pub(super) fn term(key: &Key<'_>, data_type: DataType, findings: &mut Findings) -> Option<Term> {
    let text = key.value;
    let bytes = |bytes: Option<Vec<u8>>, findings: &mut Findings| match bytes {
        Some(bytes) => Some(Term::fixed(Value::Bytes(bytes))),
        None => {
            refuse(&codes::DEFAULT, key, data_type, findings);
            None
        }
    };
    match data_type {
        DataType::VISIBLE_STRING => Some(Term::fixed(Value::Text(text.to_owned()))),
        DataType::OCTET_STRING | DataType::DOMAIN => bytes(octets(text), findings),
        DataType::UNICODE_STRING => bytes(utf16(text), findings),
        DataType::TIME_OF_DAY | DataType::TIME_DIFFERENCE => bytes(time(text), findings),
        DataType::REAL32 | DataType::REAL64 => real(key, data_type, findings),
        DataType::BOOLEAN => boolean(key, findings),
        _ if data_type.is_integer() => integer(key, data_type, findings),
        _ => {
            let message = format!("values of {data_type} are kept and not understood");
            findings.habit(&codes::OPAQUE, key.at, message);
            None
        }
    }
}

/// A number of `key` from 0 to `high`; reports what is none.
pub(super) fn unsigned(key: &Key<'_>, high: u64, findings: &mut Findings) -> Option<u64> {
    let text = typed(key, findings);
    let Some(number) = Number::parse(text) else {
        let message = format!("{}: {text:?} is not a number", key.name);
        findings.add(&codes::NUMBER, key.at, message);
        return None;
    };
    check_spelling(&number, text, key.at, findings);
    match u64::try_from(number.value) {
        Ok(value) if value <= high => Some(value),
        _ => {
            let message = format!("{}: {text} is not in 0 to {high}", key.name);
            findings.add(&codes::RANGE, key.at, message);
            None
        }
    }
}

/// The truth value of `key`; no value is false.
pub(super) fn flag(key: &Key<'_>, findings: &mut Findings) -> bool {
    let text = typed(key, findings);
    if matches!(text, "0" | "") {
        return false;
    }
    let value = match Number::parse(text) {
        Some(number) if matches!(number.value, 0 | 1) => return number.value == 1,
        Some(_) => true,
        None => ["true", "yes", "on"].iter().any(|word| word.eq_ignore_ascii_case(text)),
    };
    let message = format!("{}: {text:?} is neither 0 nor 1, read as {}", key.name, u8::from(value));
    findings.add(&codes::FLAG, key.at, message);
    value
}

/// The value of `key` without a comment behind it.
pub(super) fn typed<'a>(key: &Key<'a>, findings: &mut Findings) -> &'a str {
    let text = without_comment(key.value);
    if text.len() < key.value.len() {
        findings.habit(&codes::COMMENT, key.at, "a comment behind a value is cut off");
    }
    text
}

/// The text of a value, as [`term`] reads it.
pub(super) fn text(term: &Term, data_type: DataType, hex: bool) -> String {
    match &term.value {
        Value::Int(0) if term.plus_node => "$NODEID".to_owned(),
        Value::Int(number) if term.plus_node && *number < 0 => format!("$NODEID+{number}"),
        Value::Int(number) if term.plus_node => format!("$NODEID+0x{number:X}"),
        Value::Int(number) if hex && *number >= 0 => format!("0x{number:X}"),
        Value::Int(number) => number.to_string(),
        Value::Bool(on) => u8::from(*on).to_string(),
        Value::Real(number) if data_type == DataType::REAL32 => {
            let number = *number as f32;
            if number.is_finite() {
                format!("{number:?}")
            } else {
                format!("0x{:08X}", number.to_bits())
            }
        }
        Value::Real(number) if number.is_finite() => format!("{number:?}"),
        Value::Real(number) => format!("0x{:016X}", number.to_bits()),
        Value::Text(text) => text.clone(),
        Value::Bytes(bytes) => {
            let octets: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
            octets.join(" ")
        }
    }
}

fn refuse(code: &Code, key: &Key<'_>, data_type: DataType, findings: &mut Findings) {
    let message = match (code.name, data_type.limits()) {
        (name, Some((low, high))) if name == codes::DEFAULT_RANGE.name => {
            format!("{}: {} is not in {low} to {high} of {data_type}", key.name, key.value)
        }
        _ => format!("{}: {:?} is not a value of type {data_type}", key.name, key.value),
    };
    findings.add(code, key.at, message);
}

fn check_spelling(number: &Number, text: &str, at: Place, findings: &mut Findings) {
    let value = number.value;
    match number.remark {
        None => {}
        Some(Remark::Octal(decimal)) => {
            let message =
                format!("{text} is octal for {value}; {decimal} is written without the zero");
            findings.add(&codes::OCTAL, at, message);
        }
        Some(Remark::LeadingZero) => {
            let message = "a number that starts with 0 is octal; this one is read as decimal";
            findings.habit(&codes::LEADING_ZERO, at, message);
        }
        Some(Remark::Spelling) => {
            let message = "a number is usually written 16 or 0x10";
            findings.habit(&codes::NUMBER_SPELLING, at, message);
        }
        Some(Remark::Point) => {
            let message = format!("{text} has a decimal point where a whole number belongs");
            findings.add(&codes::POINT, at, message);
        }
    }
}

fn integer(key: &Key<'_>, data_type: DataType, findings: &mut Findings) -> Option<Term> {
    let text = typed(key, findings);
    let Some(Sum { number, plus_node, usual }) = Sum::parse(text) else {
        let code = if text.contains('$') { &codes::NODE_ID } else { &codes::DEFAULT };
        refuse(code, key, data_type, findings);
        return None;
    };
    check_spelling(&number, text, key.at, findings);
    if !usual {
        let message = "a sum with the node id is usually written $NODEID+0x180";
        findings.habit(&codes::NODE_ID_SPELLING, key.at, message);
    }
    let (low, high) = data_type.limits()?;
    let mut value = number.value;
    if plus_node {
        if value + 1 < low || value + 127 > high {
            let message =
                format!("{}: {text} does not fit {data_type} for every node id", key.name);
            findings.add(&codes::NODE_ID, key.at, message);
            return None;
        }
        return Some(Term { value: Value::Int(value), plus_node });
    }
    if low < 0 && number.hex_digits > 0 && value > high && value <= 2 * high + 1 {
        value -= 2 * (high + 1);
        let message = "a negative number is usually written with a sign";
        findings.habit(&codes::TWOS_COMPLEMENT, key.at, message);
    }
    if !(low..=high).contains(&value) {
        refuse(&codes::DEFAULT_RANGE, key, data_type, findings);
        return None;
    }
    Some(Term::fixed(Value::Int(value)))
}

fn boolean(key: &Key<'_>, findings: &mut Findings) -> Option<Term> {
    let text = typed(key, findings);
    let known = Number::parse(text).is_some()
        || ["true", "false"].iter().any(|word| word.eq_ignore_ascii_case(text));
    if !known {
        refuse(&codes::DEFAULT, key, DataType::BOOLEAN, findings);
        return None;
    }
    Some(Term::fixed(Value::Bool(flag(key, findings))))
}

fn real(key: &Key<'_>, data_type: DataType, findings: &mut Findings) -> Option<Term> {
    let text = typed(key, findings);
    let single = data_type == DataType::REAL32;
    let number = match Number::parse(text) {
        Some(Number { value, hex_digits: digits, .. }) if digits > 0 => {
            let full = 2 * data_type.size().unwrap_or_default();
            let message = match digits == full {
                true => "a real number in hex, read as its bits",
                false => "a real number in hex, read as a whole number",
            };
            findings.habit(&codes::REAL_BITS, key.at, message);
            match (digits == full, single) {
                (false, _) => Some(value as f64),
                (true, true) => Some(f32::from_bits(value as u32).into()),
                (true, false) => Some(f64::from_bits(value as u64)),
            }
        }
        _ => decimal(text),
    };
    // What the device holds is the nearest number of four bytes.
    let nearest = |number: f64| if single { f64::from(number as f32) } else { number };
    match number {
        Some(number) if !number.is_finite() || nearest(number).is_finite() => {
            Some(Term::fixed(Value::Real(nearest(number))))
        }
        _ => {
            refuse(&codes::DEFAULT, key, data_type, findings);
            None
        }
    }
}

fn decimal(text: &str) -> Option<f64> {
    // `parse` takes names such as `inf` as well.
    let clean =
        text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    text.parse().ok().filter(|_| clean)
}

/// Hex digits in pairs, with or without spaces and `0x`.
fn octets(text: &str) -> Option<Vec<u8>> {
    let text = without_comment(text);
    let mut bytes = Vec::new();
    for word in text.split_ascii_whitespace() {
        let word = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X")).unwrap_or(word);
        let digits: Option<Vec<u8>> =
            word.chars().map(|digit| digit.to_digit(16).map(|digit| digit as u8)).collect();
        match digits?.as_slice() {
            [digit] => bytes.push(*digit),
            digits if digits.len() % 2 == 0 => {
                bytes.extend(digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]));
            }
            _ => return None,
        }
    }
    Some(bytes)
}

/// Code units of four hex digits, octets, or plain text.
fn utf16(text: &str) -> Option<Vec<u8>> {
    let words = || text.split_ascii_whitespace();
    if words().all(|word| word.len() == 4) && octets(text).is_some() {
        let units = words().filter_map(|word| u16::from_str_radix(word, 16).ok());
        return Some(units.flat_map(u16::to_le_bytes).collect());
    }
    octets(text).or_else(|| Some(text.encode_utf16().flat_map(u16::to_le_bytes).collect()))
}

/// Six octets, or a number.
fn time(text: &str) -> Option<Vec<u8>> {
    if let Some(number) = Number::parse(without_comment(text)) {
        let high = (1 << 48) - 1;
        return (0..=high)
            .contains(&number.value)
            .then(|| number.value.to_le_bytes()[..6].to_vec());
    }
    octets(text).filter(|bytes| bytes.len() == 6)
}
