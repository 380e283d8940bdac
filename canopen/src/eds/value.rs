//! Default values and limits: text to typed values and back.

use crate::value::{DataType, Value};

use super::codes::{self, Code};
use super::diagnostic::Findings;
use super::ini::Key;
use super::model::Term;
use super::number::{Number, Remark, Sum, without_comment};
use crate::source::Place;

/// The value of `key` in that type. `None` when it has none, or one that was reported and is
/// better kept as text.
pub(super) fn term(key: &Key<'_>, data_type: DataType, findings: &mut Findings) -> Option<Term> {
    let value = match data_type {
        DataType::VISIBLE_STRING => Some(Value::Text(key.value.to_owned())),
        DataType::UNICODE_STRING => Some(Value::Bytes(utf16(key.value))),
        DataType::OCTET_STRING | DataType::DOMAIN => {
            // A value without an octet would be written as no value.
            let octets = octets(typed(key, findings)).filter(|octets| !octets.is_empty());
            octets.map(Value::Bytes)
        }
        DataType::TIME_OF_DAY | DataType::TIME_DIFFERENCE => {
            time(typed(key, findings)).map(Value::Bytes)
        }
        DataType::REAL32 | DataType::REAL64 => real(key, data_type, findings),
        DataType::BOOLEAN => boolean(key, findings),
        _ if data_type.is_integer() => return integer(key, data_type, findings),
        _ => {
            let message = format!("values of {data_type} are kept and not interpreted");
            findings.habit(&codes::OPAQUE, key.at, message);
            return None;
        }
    };
    if value.is_none() {
        not_of_type(&codes::DEFAULT, key, data_type, findings);
    }
    value.map(Term::fixed)
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
            let message = format!("{}: {text} is outside 0 to {high}", key.name);
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
    let message =
        format!("{}: {text:?} is neither 0 nor 1; it is read as {}", key.name, u8::from(value));
    findings.add(&codes::FLAG, key.at, message);
    value
}

/// The value of `key` without a comment after it.
pub(super) fn typed<'a>(key: &Key<'a>, findings: &mut Findings) -> &'a str {
    let text = without_comment(key.value);
    if text.len() < key.value.len() {
        findings.habit(&codes::COMMENT, key.at, "the comment after the value is ignored");
    }
    text
}

/// The text of a value, as [`term`] reads it.
pub(super) fn text(term: &Term, data_type: DataType, hex: bool) -> String {
    match &term.value {
        // Alone, $NODEID is read as no value by some tools, python-canopen among them.
        Value::Int(0) if term.plus_node => "$NODEID+0".to_owned(),
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

fn not_of_type(code: &Code, key: &Key<'_>, data_type: DataType, findings: &mut Findings) {
    let message = format!("{}: {:?} is not a value of type {data_type}", key.name, key.value);
    findings.add(code, key.at, message);
}

fn check_spelling(number: &Number, text: &str, at: Place, findings: &mut Findings) {
    let value = number.value;
    match number.remark {
        None => {}
        Some(Remark::Octal(decimal)) => {
            let message = format!(
                "{text} is octal and means {value}; {decimal} is written without the leading zero"
            );
            findings.add(&codes::OCTAL, at, message);
        }
        Some(Remark::LeadingZero) => {
            let message = "the number starts with 0, as octal numbers do; it is read as decimal";
            findings.habit(&codes::LEADING_ZERO, at, message);
        }
        Some(Remark::Spelling) => {
            let message = "the number is not written like 16 or 0x10";
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
        not_of_type(code, key, data_type, findings);
        return None;
    };
    check_spelling(&number, text, key.at, findings);
    if !usual {
        let message = "the sum with the node id is not written like $NODEID+0x180";
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
        let message = "the negative number has no sign";
        findings.habit(&codes::TWOS_COMPLEMENT, key.at, message);
    }
    if !(low..=high).contains(&value) {
        let message =
            format!("{}: {text} is outside {low} to {high}, the range of {data_type}", key.name);
        findings.add(&codes::DEFAULT_RANGE, key.at, message);
        return None;
    }
    Some(Term::fixed(Value::Int(value)))
}

fn boolean(key: &Key<'_>, findings: &mut Findings) -> Option<Value> {
    let text = typed(key, findings);
    let known = Number::parse(text).is_some()
        || ["true", "false"].iter().any(|word| word.eq_ignore_ascii_case(text));
    known.then(|| Value::Bool(flag(key, findings)))
}

fn real(key: &Key<'_>, data_type: DataType, findings: &mut Findings) -> Option<Value> {
    let text = typed(key, findings);
    let single = data_type == DataType::REAL32;
    let number = match Number::parse(text) {
        Some(Number { value, hex_digits: digits, .. }) if digits > 0 => {
            let full = 2 * data_type.size().unwrap_or_default();
            let message = match digits == full {
                true => "the real number is in hex; it is read as its bits",
                false => "the real number is in hex; it is read as a whole number",
            };
            findings.habit(&codes::REAL_BITS, key.at, message);
            match (digits == full, single) {
                (false, _) => value as f64,
                (true, true) => f32::from_bits(value as u32).into(),
                (true, false) => f64::from_bits(value as u64),
            }
        }
        _ => decimal(text)?,
    };
    // The device holds the nearest number of four bytes.
    let nearest = if single { f64::from(number as f32) } else { number };
    // A number that is too large for four bytes is none.
    (nearest.is_finite() || !number.is_finite()).then_some(Value::Real(nearest))
}

fn decimal(text: &str) -> Option<f64> {
    // `parse` takes names such as `inf` as well.
    let clean =
        text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    text.parse().ok().filter(|number: &f64| clean && number.is_finite())
}

/// Hex digits in pairs, with or without spaces and `0x`.
fn octets(text: &str) -> Option<Vec<u8>> {
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
fn utf16(text: &str) -> Vec<u8> {
    let unit = |word: &str| (word.len() == 4).then(|| u16::from_str_radix(word, 16).ok()).flatten();
    let units: Option<Vec<u16>> = text.split_ascii_whitespace().map(unit).collect();
    let bytes = |units: Vec<u16>| units.into_iter().flat_map(u16::to_le_bytes).collect();
    match units {
        Some(units) => bytes(units),
        None => octets(text).unwrap_or_else(|| bytes(text.encode_utf16().collect())),
    }
}

/// Six octets, or a number.
fn time(text: &str) -> Option<Vec<u8>> {
    match Number::parse(text) {
        Some(Number { value, .. }) => {
            (0..1 << 48).contains(&value).then(|| value.to_le_bytes()[..6].to_vec())
        }
        None => octets(text).filter(|bytes| bytes.len() == 6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, data_type: DataType) -> Option<Term> {
        let place = Place::new(1, 1);
        let key = Key { name: "DefaultValue", value: text, name_at: place, at: place };
        term(&key, data_type, &mut Findings::default())
    }

    #[test]
    fn values_of_every_type() {
        let bytes = |bytes: &[u8]| Value::Bytes(bytes.to_vec());
        let table = [
            (DataType::BOOLEAN, "1", Value::Bool(true)),
            (DataType::BOOLEAN, "FALSE", Value::Bool(false)),
            (DataType::INTEGER8, "-0x80", Value::Int(-128)),
            (DataType::INTEGER8, "0x80", Value::Int(-128)),
            (DataType::INTEGER64, "0xFFFFFFFFFFFFFFFF", Value::Int(-1)),
            (DataType::UNSIGNED64, "0xFFFFFFFFFFFFFFFF", Value::Int(u64::MAX.into())),
            (DataType::UNSIGNED32, "10 # ten", Value::Int(10)),
            (DataType::REAL32, "0.1", Value::Real(0.1f32.into())),
            (DataType::REAL64, "-1e-3", Value::Real(-0.001)),
            (DataType::REAL64, "0x3FF0000000000000", Value::Real(1.0)),
            (DataType::VISIBLE_STRING, "010 # ten", Value::Text("010 # ten".into())),
            (DataType::OCTET_STRING, "01 0xAB 2", bytes(&[1, 0xAB, 2])),
            (DataType::DOMAIN, "01AB", bytes(&[1, 0xAB])),
            (DataType::UNICODE_STRING, "0061 20AC", bytes(&[0x61, 0, 0xAC, 0x20])),
            (DataType::UNICODE_STRING, "61 00", bytes(&[0x61, 0])),
            (DataType::UNICODE_STRING, "xy", bytes(&[b'x', 0, b'y', 0])),
            (DataType::TIME_OF_DAY, "01 02 03 04 05 06", bytes(&[1, 2, 3, 4, 5, 6])),
            (DataType::TIME_DIFFERENCE, "0", bytes(&[0; 6])),
        ];
        for (data_type, text, value) in table {
            let term = Some(Term::fixed(value));
            assert_eq!(read(text, data_type), term, "{text} as {data_type}");
        }
    }

    #[test]
    fn what_is_no_value() {
        for (data_type, text) in [
            (DataType::BOOLEAN, "perhaps"),
            (DataType::INTEGER8, "0x100"),
            (DataType::INTEGER8, "128"),
            (DataType::UNSIGNED8, "-1"),
            (DataType::UNSIGNED8, "$NODEID+0x81"),
            (DataType::UNSIGNED32, "1.5"),
            (DataType::REAL32, "1e40"),
            (DataType::REAL32, "inf"),
            (DataType::REAL64, "1e400"),
            (DataType::OCTET_STRING, "012"),
            (DataType::TIME_OF_DAY, "01 02"),
            (DataType(0x40), "1"),
        ] {
            assert_eq!(read(text, data_type), None, "{text} as {data_type}");
        }
    }
}
