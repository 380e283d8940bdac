//! Numbers as CiA 306 and as vendors write them.

/// A whole number and what is unusual about its spelling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Number {
    pub(super) value: i128,
    /// How many digits it has after `0x`; 0 when it is not written so.
    pub(super) hex_digits: usize,
    pub(super) remark: Option<Remark>,
}

/// An unusual property of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Remark {
    /// Octal because of a leading zero; the value that it would have as a decimal number.
    Octal(i128),
    /// A leading zero and a digit that octal numbers do not have.
    LeadingZero,
    /// `10h`, `0x10L`, `10u`.
    Spelling,
    /// A decimal point and only zeros after it.
    Point,
}

impl Number {
    /// The number that `text` is, all of it.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (negative, digits) = match text.as_bytes() {
            [b'-', ..] => (true, &text[1..]),
            [b'+', ..] => (false, &text[1..]),
            _ => (false, text),
        };
        let number = unsigned(digits)?;
        let sign = if negative { -1 } else { 1 };
        let remark = match number.remark {
            Some(Remark::Octal(decimal)) => Some(Remark::Octal(sign * decimal)),
            remark => remark,
        };
        Some(Self { value: sign * number.value, remark, ..number })
    }
}

fn unsigned(digits: &str) -> Option<Number> {
    let plain = |value| Number { value, hex_digits: 0, remark: None };
    if let Some(hex) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        let bare = hex.trim_end_matches(C_SUFFIX);
        let remark = (bare.len() < hex.len()).then_some(Remark::Spelling);
        return Some(Number { hex_digits: bare.len(), remark, ..plain(radix(bare, 16)?) });
    }
    if let Some(hex) = digits.strip_suffix(['h', 'H']) {
        return Some(Number { remark: Some(Remark::Spelling), ..plain(radix(hex, 16)?) });
    }
    if let Some((whole, zeros)) = digits.split_once('.') {
        let point = zeros.bytes().all(|digit| digit == b'0') && !digits.starts_with('.');
        let value = if point { radix(whole, 10)? } else { return None };
        return Some(Number { remark: Some(Remark::Point), ..plain(value) });
    }
    let bare = digits.trim_end_matches(C_SUFFIX);
    let decimal = radix(bare, 10)?;
    let spelling = (bare.len() < digits.len()).then_some(Remark::Spelling);
    if !bare.starts_with('0') || bare.len() == 1 {
        return Some(Number { remark: spelling, ..plain(decimal) });
    }
    Some(match radix(bare, 8) {
        Some(octal) if octal == decimal => Number { remark: spelling, ..plain(octal) },
        Some(octal) => Number { remark: Some(Remark::Octal(decimal)), ..plain(octal) },
        None => Number { remark: Some(Remark::LeadingZero), ..plain(decimal) },
    })
}

/// The value of digits without a sign; `None` for anything else and for what is absurdly long.
fn radix(digits: &str, radix: u32) -> Option<i128> {
    if digits.is_empty() || digits.len() > MANY_DIGITS {
        return None;
    }
    // 64 bits hold most numbers and are much faster.
    if digits.len() <= 15 {
        let mut value: u64 = 0;
        for digit in digits.bytes() {
            value = value * u64::from(radix) + u64::from(char::from(digit).to_digit(radix)?);
        }
        return Some(value.into());
    }
    let clean = digits.bytes().all(|digit| char::from(digit).is_digit(radix));
    clean.then(|| i128::from_str_radix(digits, radix).ok()).flatten()
}

/// A number that may be added to the node id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sum {
    /// The number, or what is added.
    pub(super) number: Number,
    /// Whether the node id is added.
    pub(super) plus_node: bool,
    /// Whether order, case and spaces are those of CiA 306.
    pub(super) usual: bool,
}

impl Sum {
    /// The sum that `text` is, all of it.
    pub(super) fn parse(text: &str) -> Option<Self> {
        if !text.contains('$') {
            let number = Number::parse(text)?;
            return Some(Self { number, plus_node: false, usual: true });
        }
        let zero = Number { value: 0, hex_digits: 0, remark: None };
        let is_node = |text: &str| text.eq_ignore_ascii_case(NODE_ID);
        let number = match text.split_once('+') {
            None => is_node(text).then_some(zero),
            Some((left, right)) => match (left.trim_end(), right.trim_start()) {
                (node, number) if is_node(node) => Number::parse(number),
                (number, node) if is_node(node) => Number::parse(number),
                _ => None,
            },
        }?;
        let usual = text.starts_with(NODE_ID) && !text.contains(char::is_whitespace);
        Some(Self { number, plus_node: true, usual })
    }
}

/// `text` without a comment after the value, for values that hold neither `#` nor `;`.
pub(super) fn without_comment(text: &str) -> &str {
    let comment = text.bytes().position(|byte| matches!(byte, b'#' | b';'));
    comment.map_or(text, |at| text[..at].trim_ascii_end())
}

/// The bit rate that `text` is, in kbit/s, which CiA 306 writes as `125` and CiA 311 as `125 Kbps`.
pub(super) fn bit_rate(text: &str) -> Option<u32> {
    let unit = text.trim_start_matches(|c: char| c.is_ascii_digit());
    let number = text[..text.len() - unit.len()].parse::<u32>().ok()?;
    match unit.trim_start().as_bytes() {
        [] | [b'k' | b'K', ..] => Some(number),
        [b'M', ..] => number.checked_mul(1000),
        _ => None,
    }
}

/// No type has a number of more digits.
const MANY_DIGITS: usize = 30;

const C_SUFFIX: [char; 4] = ['u', 'U', 'l', 'L'];

const NODE_ID: &str = "$NODEID";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        let table = [
            ("0", 0, None),
            ("42", 42, None),
            ("-128", -128, None),
            ("+5", 5, None),
            ("0x1F", 31, None),
            ("0X1f", 31, None),
            ("-0x7f", -127, None),
            ("0x10L", 16, Some(Remark::Spelling)),
            ("10UL", 10, Some(Remark::Spelling)),
            ("1234h", 0x1234, Some(Remark::Spelling)),
            ("0FFh", 0xFF, Some(Remark::Spelling)),
            ("00", 0, None),
            ("07", 7, None),
            ("010", 8, Some(Remark::Octal(10))),
            ("-010", -8, Some(Remark::Octal(-10))),
            ("08", 8, Some(Remark::LeadingZero)),
            ("0.0", 0, Some(Remark::Point)),
            ("50.", 50, Some(Remark::Point)),
            ("18446744073709551615", u64::MAX.into(), None),
        ];
        for (text, value, remark) in table {
            let number = Number::parse(text).unwrap();
            assert_eq!((number.value, number.remark), (value, remark), "{text}");
        }
        let not = ["", "-", "x", "0x", "0xG", "1.5", ".0", "--1", "1 2", "0x-1", "h", "é", "1e3"];
        for text in not {
            assert_eq!(Number::parse(text), None, "{text}");
        }
        assert_eq!(Number::parse(&"9".repeat(50)), None);
        assert_eq!(Number::parse("0x00FF").unwrap().hex_digits, 4);
    }

    #[test]
    fn sums() {
        let table = [
            ("$NODEID", 0, true),
            ("$NODEID+0x180", 0x180, true),
            ("0x180+$NODEID", 0x180, false),
            ("$NodeId + 384", 384, false),
            ("$nodeid", 0, false),
        ];
        for (text, number, usual) in table {
            let sum = Sum::parse(text).unwrap();
            assert_eq!(
                (sum.number.value, sum.plus_node, sum.usual),
                (number, true, usual),
                "{text}"
            );
        }
        for text in ["$NODE", "$NODEID+", "$NODEID-1", "2*$NODEID", "$NODEID+$NODEID", "$"] {
            assert_eq!(Sum::parse(text), None, "{text}");
        }
    }

    #[test]
    fn bit_rates() {
        for (text, rate) in [
            ("125", Some(125)),
            ("0800 Kbps", Some(800)),
            ("250kbit/s", Some(250)),
            ("1 Mbps", Some(1000)),
            ("5000000 Mbps", None),
            ("auto-baudRate", None),
            ("125 bananas", None),
            ("", None),
        ] {
            assert_eq!(bit_rate(text), rate, "{text}");
        }
    }

    #[test]
    fn comments() {
        assert_eq!(without_comment("0x10 # why"), "0x10");
        assert_eq!(without_comment("1;2"), "1");
    }
}
