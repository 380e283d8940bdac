//! Bytes that steps write: those of a pattern, those of a mapping entry; and bytes as text.

use canopen::eds::{Entry, Object};
use canopen::{DataType, Mux};

use super::scope::{Binding, Scope};
use crate::dut::Dut;
use crate::suite::literal::Literal;

/// Text of the given length without a period, so that no lost segment or block stays hidden.
pub(crate) fn fill(len: usize) -> Vec<u8> {
    const LETTERS: usize = 73;
    (0..len).map(|place| b'0' + (place % LETTERS) as u8).collect()
}

/// The bytes of `01 02 0A`.
pub fn parse_bytes(text: &str) -> Option<Vec<u8>> {
    let digits: String = text.split_whitespace().collect();
    if !digits.is_ascii() || !digits.len().is_multiple_of(2) {
        return None;
    }
    (0..digits.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&digits[at..at + 2], 16).ok())
        .collect()
}

/// The 32 bits that map an object: from its address with the length of its type, or as written.
pub(crate) fn mapping_word(literal: &Literal, scope: &Scope, dut: &Dut) -> Result<u32, String> {
    let mux: Mux = match literal {
        Literal::Text(text) => text.parse().map_err(|error: canopen::NoMux| error.to_string())?,
        Literal::Named(name, 0) => match scope.get(name)? {
            Binding::Mux(mux) => *mux,
            Binding::Literal(Literal::Text(text)) => {
                text.parse().map_err(|error: canopen::NoMux| error.to_string())?
            }
            _ => return word(literal, scope),
        },
        other => return word(other, scope),
    };
    let data_type = dut.eds.object(mux.index).and_then(|object: &Object| object.entry(mux.sub));
    data_type
        .and_then(|entry| entry_word(entry, dut))
        .ok_or_else(|| format!("{mux} has no fixed length that could be mapped"))
}

/// The mapping entry for a value of fixed length. A BOOLEAN takes a bit where mapping has the
/// granularity of bits, else a byte.
pub(super) fn entry_word(entry: &Entry, dut: &Dut) -> Option<u32> {
    let bits = match entry.data_type {
        DataType::BOOLEAN if dut.eds.device.granularity == 1 => 1,
        data_type => 8 * data_type.size()?,
    };
    let bits = bits.min(255) as u8;
    Some(canopen::pdo::Mapping { mux: entry.mux, bits }.encode())
}

fn word(literal: &Literal, scope: &Scope) -> Result<u32, String> {
    let word = scope.int(literal)?;
    word.try_into().map_err(|_| "a mapping entry has 32 bits".to_owned())
}

/// Bytes for people: `E8 03`, and of many the first and how many there are.
pub fn show_bytes(bytes: &[u8]) -> String {
    /// 16 lines of 16.
    const MOST: usize = 256;
    let shown = &bytes[..bytes.len().min(MOST)];
    let words: Vec<String> = shown.iter().map(|byte| format!("{byte:02X}")).collect();
    match bytes.len() {
        ..=MOST => words.join(" "),
        count => format!("{} ... ({count} bytes)", words.join(" ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_bytes_are_cut_off_with_their_number() {
        assert_eq!(show_bytes(&[0xE8, 3]), "E8 03");
        assert_eq!(show_bytes(&[0; 256]).len(), 256 * 3 - 1);
        let cut = show_bytes(&[0; 196_736]);
        assert_eq!(cut.len(), 256 * 3 - 1 + " ... (196736 bytes)".len());
        assert!(cut.ends_with(" 00 ... (196736 bytes)"), "{cut}");
    }
}
