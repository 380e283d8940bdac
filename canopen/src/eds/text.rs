//! From bytes to text: vendors' editors write ASCII, UTF-8, Latin-1, code page 850.

use std::borrow::Cow;

use super::codes;
use super::diagnostic::Findings;
use crate::source::Place;

/// The text of a data sheet in any encoding: the lines and columns of diagnostics count in this
/// text. Lines end with LF, or CR and LF.
pub fn decode(source: &[u8]) -> Cow<'_, str> {
    decode_with(source, &mut Findings::default())
}

pub(super) fn decode_with<'a>(source: &'a [u8], findings: &mut Findings) -> Cow<'a, str> {
    let text = match source {
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes, findings),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes, findings),
        [0, ..] if is_unmarked_utf16(source) => utf16(source, u16::from_be_bytes, findings),
        _ if is_unmarked_utf16(source) => utf16(source, u16::from_le_bytes, findings),
        [0xEF, 0xBB, 0xBF, rest @ ..] => {
            findings.add(&codes::BYTE_ORDER_MARK, START, "the file starts with a byte order mark");
            bytes(rest, findings)
        }
        _ => bytes(source, findings),
    };
    with_line_feeds(text, findings)
}

/// Whether a text is UTF-16 without a byte order mark: it starts with a character of ASCII, as a
/// sheet does (XML 1.0, appendix F).
pub(super) const fn is_unmarked_utf16(source: &[u8]) -> bool {
    matches!(source, [1..0x80, 0, ..] | [0, 1..0x80, ..])
}

fn utf16<'a>(bytes: &[u8], unit: fn([u8; 2]) -> u16, findings: &mut Findings) -> Cow<'a, str> {
    findings.add(&codes::ENCODING, START, "the file is UTF-16; data sheets are ASCII");
    let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
    Cow::Owned(String::from_utf16_lossy(&units))
}

fn bytes<'a>(bytes: &'a [u8], findings: &mut Findings) -> Cow<'a, str> {
    if bytes.is_ascii() {
        return Cow::Borrowed(std::str::from_utf8(bytes).unwrap_or_default());
    }
    let (text, name) = match std::str::from_utf8(bytes) {
        Ok(text) => (Cow::Borrowed(text), "UTF-8"),
        Err(_) if is_code_page_850(bytes) => (one_to_one(bytes, code_page_850), "code page 850"),
        Err(_) => (one_to_one(bytes, latin_1), "Latin-1"),
    };
    let first = bytes.iter().position(|byte| !byte.is_ascii()).unwrap_or_default();
    let before = &bytes[..first];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let column = before.iter().rev().take_while(|&&byte| byte != b'\n').count() + 1;
    let message = format!("the file is not ASCII; it is read as {name}");
    findings.add(&codes::ENCODING, Place::new(line, column), message);
    text
}

fn one_to_one<'a>(bytes: &[u8], table: fn(u8) -> char) -> Cow<'a, str> {
    Cow::Owned(
        bytes.iter().map(|&byte| if byte < 0x80 { byte.into() } else { table(byte) }).collect(),
    )
}

/// Whether the letters make more sense in the code page of DOS than in that of Windows. Umlauts and
/// accents are below A0h in the one and above BFh in the other, and the degree sign separates them
/// apart where it stands before a unit.
fn is_code_page_850(bytes: &[u8]) -> bool {
    let mut dos = 0;
    let mut windows = 0;
    for (place, &byte) in bytes.iter().enumerate() {
        let before_unit = || matches!(bytes.get(place + 1), Some(b'C' | b'F' | b'K' | b' '));
        match byte {
            // Euro, dots, quotation marks, dashes and the trade mark of Windows.
            0x80 | 0x85 | 0x91..=0x97 if byte != 0x94 => windows += 1,
            0x99 if !bytes.get(place + 1).is_some_and(u8::is_ascii_lowercase) => windows += 1,
            0x80..=0x9F => dos += 1,
            0xF8 if before_unit() => dos += 1,
            0xB0 | 0xB5 | 0xC0..=0xFF => windows += 1,
            _ => {}
        }
    }
    dos > windows
}

fn latin_1(byte: u8) -> char {
    match byte {
        0x80..=0x9F => WINDOWS_1252[usize::from(byte - 0x80)],
        _ => byte.into(),
    }
}

fn code_page_850(byte: u8) -> char {
    CODE_PAGE_850[usize::from(byte - 0x80)]
}

/// Gives LFs to a file of bare CRs, so that everyone counts the same lines.
fn with_line_feeds<'a>(text: Cow<'a, str>, findings: &mut Findings) -> Cow<'a, str> {
    if text.contains('\n') || !text.contains('\r') {
        return text;
    }
    findings.add(&codes::LINE_END, START, "lines end with CR alone");
    Cow::Owned(text.replace('\r', "\n"))
}

const START: Place = Place::new(1, 1);

const WINDOWS_1252: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8D}', 'Ž', '\u{8F}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9D}', 'ž', 'Ÿ',
];

const CODE_PAGE_850: [char; 128] = [
    'Ç', 'ü', 'é', 'â', 'ä', 'à', 'å', 'ç', 'ê', 'ë', 'è', 'ï', 'î', 'ì', 'Ä', 'Å', //
    'É', 'æ', 'Æ', 'ô', 'ö', 'ò', 'û', 'ù', 'ÿ', 'Ö', 'Ü', 'ø', '£', 'Ø', '×', 'ƒ', //
    'á', 'í', 'ó', 'ú', 'ñ', 'Ñ', 'ª', 'º', '¿', '®', '¬', '½', '¼', '¡', '«', '»', //
    '░', '▒', '▓', '│', '┤', 'Á', 'Â', 'À', '©', '╣', '║', '╗', '╝', '¢', '¥', '┐', //
    '└', '┴', '┬', '├', '─', '┼', 'ã', 'Ã', '╚', '╔', '╩', '╦', '╠', '═', '╬', '¤', //
    'ð', 'Ð', 'Ê', 'Ë', 'È', 'ı', 'Í', 'Î', 'Ï', '┘', '┌', '█', '▄', '¦', 'Ì', '▀', //
    'Ó', 'ß', 'Ô', 'Ò', 'õ', 'Õ', 'µ', 'þ', 'Þ', 'Ú', 'Û', 'Ù', 'ý', 'Ý', '¯', '´', //
    '\u{AD}', '±', '‗', '¾', '¶', '§', '÷', '¸', '°', '¨', '·', '¹', '³', '²', '■', '\u{A0}',
];

#[cfg(test)]
mod tests {
    use super::*;

    fn codes_of(source: &[u8]) -> (String, Vec<String>) {
        let mut findings = Findings::default();
        let text = decode_with(source, &mut findings).into_owned();
        (
            text,
            findings
                .finish()
                .iter()
                .map(|d| format!("{}:{} {}", d.line, d.column, d.code))
                .collect(),
        )
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "a\r\nTemperatur F\u{FC}hler 25 \u{B0}C\r\n";
        let units = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect();
        let (little, big): (Vec<u8>, Vec<u8>) = (units(u16::to_le_bytes), units(u16::to_be_bytes));
        let cases: [(&[u8], &[&str]); 7] = [
            (text.as_bytes(), &["2:13 eds-encoding"]),
            (b"a\r\nTemperatur F\xFChler 25 \xB0C\r\n", &["2:13 eds-encoding"]),
            (b"a\r\nTemperatur F\x81hler 25 \xF8C\r\n", &["2:13 eds-encoding"]),
            (
                b"\xEF\xBB\xBFa\r\nTemperatur F\xC3\xBChler 25 \xC2\xB0C\r\n",
                &["1:1 eds-byte-order-mark", "2:13 eds-encoding"],
            ),
            (&[&[0xFF, 0xFE], &*little].concat(), &["1:1 eds-encoding"]),
            (&little, &["1:1 eds-encoding"]),
            (&big, &["1:1 eds-encoding"]),
        ];
        for (bytes, expected) in cases {
            let (decoded, codes) = codes_of(bytes);
            assert_eq!(decoded, text);
            assert_eq!(codes, expected, "{bytes:02X?}");
        }
    }

    #[test]
    fn quotation_marks_of_windows_are_not_umlauts_of_dos() {
        assert_eq!(codes_of(b"\x93quoted\x94 \x96 it\x92s").0, "“quoted” – it’s");
    }

    #[test]
    fn bare_carriage_returns() {
        let (text, codes) = codes_of(b"a\rb");
        assert_eq!((text.as_str(), codes), ("a\nb", vec!["1:1 eds-line-end".to_owned()]));
    }
}
