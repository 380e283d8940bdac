//! How far the actual behaviour is from the expected one: by which amount, in which bits or bytes.

use canopen::eds::Entry;
use canopen::nmt::NmtState;
use canopen::{Frame, Pattern, Word, heartbeat};

use crate::suite::Words;
use crate::suite::literal::ObjectRef;

/// How far a value is from the expected one, or from a bound that it breaks: the amount of a
/// number, in the unit that the suite has for the object; the bits where a mask or a parameter of
/// the communication says that bits count; the first byte of anything else.
pub(super) fn values(
    entry: Option<&Entry>,
    words: Option<(&Words, &ObjectRef)>,
    mask: Option<&[u8]>,
    [expected, got]: [&[u8]; 2],
) -> Option<String> {
    let entry = entry?;
    let number = |bytes: &[u8]| entry.data_type.decode(bytes).ok()?.as_int();
    // Identifiers, mapping entries, the error register and the like are no amounts.
    let is_code = match entry.mux.index {
        0x1001 => true,
        index => matches!(index, 0x1000..0x2000) && got.len() == 4,
    };
    match (number(expected), number(got), mask) {
        (Some(_), Some(_), Some(mask)) => bits(expected, got, mask),
        (Some(_), Some(_), None) if is_code => bits(expected, got, &[0xFF; 4]),
        (Some(expected), Some(got), None) => {
            let by = got.checked_sub(expected)?;
            let amount = match words {
                Some((words, object)) => words.amount(object, by.abs())?,
                None => by.abs().to_string(),
            };
            Some(too_much(by > 0, &amount))
        }
        _ => byte(expected, got),
    }
}

/// `too large by 0.1 °C`.
pub(super) fn too_much(large: bool, amount: &str) -> String {
    format!("too {} by {amount}", if large { "large" } else { "small" })
}

/// The bytes in which a frame with the expected identifier differs.
pub(super) fn frames(expected: &Pattern, got: &Frame) -> Option<String> {
    if expected.id() != got.id || got.remote {
        return None;
    }
    if let Some(states) = states(expected, got) {
        return Some(states);
    }
    let (words, mut odd) = (expected.words(), Vec::new());
    for (place, word) in words.iter().enumerate() {
        match (word, got.data.get(place)) {
            (_, None) => {
                odd.push(format!("byte {place} is missing"));
                break;
            }
            (Word::Bits { mask, value }, Some(byte)) if byte & mask != *value => {
                let differ = (byte ^ value) & mask;
                let bits = listed((0..8).filter(|bit| differ >> bit & 1 == 1));
                odd.push(format!("byte {place} is {byte:02X}: {bits} differ{}", third(&bits)));
            }
            (Word::Bits { .. } | Word::Name | Word::Open, Some(_)) => {}
        }
    }
    let (length, sent) = (words.len(), got.data.len());
    if odd.is_empty() && !expected.matches(got) && sent > length {
        odd.push(format!("{sent} bytes where {length} are expected"));
    }
    let (count, shown) = (odd.len(), odd.len().min(MOST));
    odd.truncate(shown);
    if count > shown {
        odd.push(format!("{} more bytes differ", count - shown));
    }
    (count > 0).then(|| format!("{} (bytes and bits are counted from 0)", odd.join("; ")))
}

/// Two NMT states in messages of error control, of which the bits say nothing to anybody.
fn states(expected: &Pattern, got: &Frame) -> Option<String> {
    const TOGGLE: u8 = 0x80;
    let ids = heartbeat::COB_ID + 1..=heartbeat::COB_ID + 127;
    got.data_id().filter(|id| ids.contains(id))?;
    let words = expected.words();
    let ([Word::Bits { mask, value }], [state]) = (&words[..], &*got.data) else { return None };
    let state = state & !TOGGLE;
    // Of a state, a pattern may have one digit.
    let is_wanted = |state: &u8| (state ^ value) & mask & !TOGGLE == 0;
    let wanted = [0x00, 0x04, 0x05, 0x7F].into_iter().find(is_wanted)?;
    let (state, wanted) = (NmtState(state), NmtState(wanted));
    (state != wanted).then(|| format!("the state is {state} where {wanted} is expected"))
}

/// The bits that differ within a mask.
fn bits(expected: &[u8], got: &[u8], mask: &[u8]) -> Option<String> {
    let odd = expected.iter().zip(got).zip(mask).enumerate();
    let odd = odd.flat_map(|(place, ((expected, got), mask))| {
        let odd = (expected ^ got) & mask;
        (0..8).filter(move |bit| odd >> bit & 1 == 1).map(move |bit| 8 * place + bit)
    });
    let odd: Vec<usize> = odd.collect();
    let bits = listed(odd.iter().copied());
    matches!(odd.len(), 1..=8).then(|| format!("{bits} differ{}", third(&bits)))
}

/// The first byte that differs.
fn byte(expected: &[u8], got: &[u8]) -> Option<String> {
    let odd = expected.iter().zip(got).enumerate().find(|(_, (expected, got))| expected != got);
    let (place, (expected, got)) = odd?;
    Some(format!("byte {place}, counted from 0, is {got:02X} where {expected:02X} is expected"))
}

/// `bit 0`, `bits 0, 4`.
fn listed(bits: impl Iterator<Item = usize>) -> String {
    let bits: Vec<String> = bits.map(|bit| bit.to_string()).collect();
    let many = if bits.len() == 1 { "" } else { "s" };
    format!("bit{many} {}", bits.join(", "))
}

/// The ending of a verb after these bits.
fn third(bits: &str) -> &'static str {
    if bits.starts_with("bits") { "" } else { "s" }
}

/// How many bytes of a frame are named.
const MOST: usize = 3;

#[cfg(test)]
mod tests {
    use canopen::eds::Access;
    use canopen::{DataType, Mux};

    use super::*;

    #[test]
    fn bytes_of_a_frame() {
        let apart = |pattern: &str, frame: &str| {
            frames(&pattern.parse().unwrap(), &frame.parse().unwrap())
                .map(|text| text.replace(" (bytes and bits are counted from 0)", ""))
        };
        for (pattern, frame, text) in [
            ("082#30 81 11 ...", "082#308100", Some("byte 2 is 00: bits 0, 4 differ")),
            ("701#04", "701#05", Some("the state is OPERATIONAL where STOPPED is expected")),
            (
                "701#.F",
                "701#85",
                Some("the state is OPERATIONAL where PRE-OPERATIONAL is expected"),
            ),
            ("701#85", "701#05", Some("byte 0 is 05: bit 7 differs")),
            ("7E4#01 .. 03", "7E4#01", Some("byte 1 is missing")),
            ("7E4#01", "7E4#0102", Some("2 bytes where 1 are expected")),
            ("7E4#01 .. 03", "7E4#014203", None),
            ("701#04", "702#05", None),
        ] {
            assert_eq!(apart(pattern, frame).as_deref(), text, "{pattern} {frame}");
        }
        let many = apart("7E4#00 00 00 00 00", "7E4#0101010101").unwrap();
        assert!(many.ends_with("byte 2 is 01: bit 0 differs; 2 more bytes differ"), "{many}");
    }

    #[test]
    fn amounts_of_numbers_and_bits_of_codes() {
        let apart = |index, data_type, mask: Option<&[u8]>, expected: &[u8], got: &[u8]| {
            let (mux, name) = (Mux::new(index, 0), String::new());
            let (access, default, low, high) = (Access::Rw, None, None, None);
            let (mappable, line) = (false, 0);
            let entry = Entry { mux, name, data_type, access, mappable, default, low, high, line };
            values(Some(&entry), None, mask, [expected, got])
        };
        let (short, long) = (DataType::INTEGER16, DataType::UNSIGNED32);
        let amount = apart(0x6401, short, None, &[0x98, 0], &[0x26, 2]);
        assert_eq!(amount.as_deref(), Some("too large by 398"));
        let amount = apart(0x6401, short, None, &[0, 0], &[0xFF, 0xFF]);
        assert_eq!(amount.as_deref(), Some("too small by 1"));
        let masked = apart(0x6401, short, Some(&[1, 1]), &[0, 0], &[3, 1]);
        assert_eq!(masked.as_deref(), Some("bits 0, 8 differ"));
        let code = apart(0x1014, long, None, &[0x82, 0, 0, 0], &[0x82, 0, 0, 0x80]);
        assert_eq!(code.as_deref(), Some("bit 31 differs"));
        let text = apart(0x1008, DataType::VISIBLE_STRING, None, b"abc", b"abd");
        assert!(text.is_some_and(|text| text.starts_with("byte 2, counted from 0, is 64")));
    }
}
