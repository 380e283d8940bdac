//! Typed values (CiA 301, 7.1): the meaning of the bytes of an object.

use std::fmt;

use crate::mux::Mux;

/// A data type by its index in the dictionary. Unknown ones are kept.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DataType(pub u16);

macro_rules! types {
    ($($name:ident = $code:literal, $text:literal, $kind:expr;)*) => {
        impl DataType {
            $(#[doc = concat!("`", $text, "`, index ", stringify!($code), ".")]
            pub const $name: Self = Self($code);)*

            /// Every basic data type of CiA 301.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The name in snake case, such as `unsigned16`; `None` for types we do not know.
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($text),)*
                    _ => None,
                }
            }

            const fn kind(self) -> Kind {
                match self.0 {
                    $($code => $kind,)*
                    _ => Kind::Bytes,
                }
            }
        }
    };
}

types! {
    BOOLEAN = 0x01, "boolean", Kind::Bool;
    INTEGER8 = 0x02, "integer8", Kind::Signed(1);
    INTEGER16 = 0x03, "integer16", Kind::Signed(2);
    INTEGER32 = 0x04, "integer32", Kind::Signed(4);
    UNSIGNED8 = 0x05, "unsigned8", Kind::Unsigned(1);
    UNSIGNED16 = 0x06, "unsigned16", Kind::Unsigned(2);
    UNSIGNED32 = 0x07, "unsigned32", Kind::Unsigned(4);
    REAL32 = 0x08, "real32", Kind::Real(4);
    VISIBLE_STRING = 0x09, "visible_string", Kind::Text;
    OCTET_STRING = 0x0A, "octet_string", Kind::Bytes;
    UNICODE_STRING = 0x0B, "unicode_string", Kind::Bytes;
    TIME_OF_DAY = 0x0C, "time_of_day", Kind::Fixed(6);
    TIME_DIFFERENCE = 0x0D, "time_difference", Kind::Fixed(6);
    DOMAIN = 0x0F, "domain", Kind::Bytes;
    INTEGER24 = 0x10, "integer24", Kind::Signed(3);
    REAL64 = 0x11, "real64", Kind::Real(8);
    INTEGER40 = 0x12, "integer40", Kind::Signed(5);
    INTEGER48 = 0x13, "integer48", Kind::Signed(6);
    INTEGER56 = 0x14, "integer56", Kind::Signed(7);
    INTEGER64 = 0x15, "integer64", Kind::Signed(8);
    UNSIGNED24 = 0x16, "unsigned24", Kind::Unsigned(3);
    UNSIGNED40 = 0x18, "unsigned40", Kind::Unsigned(5);
    UNSIGNED48 = 0x19, "unsigned48", Kind::Unsigned(6);
    UNSIGNED56 = 0x1A, "unsigned56", Kind::Unsigned(7);
    UNSIGNED64 = 0x1B, "unsigned64", Kind::Unsigned(8);
}

#[derive(Clone, Copy)]
enum Kind {
    Bool,
    Signed(usize),
    Unsigned(usize),
    Real(usize),
    Fixed(usize),
    Text,
    Bytes,
}

impl DataType {
    /// The type of that name in snake case.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|data_type| data_type.name() == Some(name))
    }

    /// The names that [`named`](Self::named) knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::ALL.iter().filter_map(|data_type| data_type.name())
    }

    /// The length in bytes of every value of this type; `None` when values differ in length.
    pub const fn size(self) -> Option<usize> {
        match self.kind() {
            Kind::Bool => Some(1),
            Kind::Signed(size) | Kind::Unsigned(size) | Kind::Real(size) | Kind::Fixed(size) => {
                Some(size)
            }
            Kind::Text | Kind::Bytes => None,
        }
    }

    /// Whether values are whole numbers, `BOOLEAN` not among them.
    pub const fn is_integer(self) -> bool {
        matches!(self.kind(), Kind::Signed(_) | Kind::Unsigned(_))
    }

    /// The type of the same length with a sign, of a whole-number type that has none.
    pub fn with_sign(self) -> Option<Self> {
        let Kind::Unsigned(size) = self.kind() else { return None };
        let signed = |of: &Self| matches!(of.kind(), Kind::Signed(length) if length == size);
        Self::ALL.iter().copied().find(signed)
    }

    /// The smallest and the largest value of a whole-number type.
    pub const fn limits(self) -> Option<(i128, i128)> {
        match self.kind() {
            Kind::Unsigned(size) => Some((0, (1 << (8 * size)) - 1)),
            Kind::Signed(size) => Some((-(1 << (8 * size - 1)), (1 << (8 * size - 1)) - 1)),
            _ => None,
        }
    }

    /// Decodes `bytes` as this type.
    ///
    /// # Errors
    /// [`ValueError::Length`] when the type has a fixed length and `bytes` another.
    pub fn decode(self, bytes: &[u8]) -> Result<Value, ValueError> {
        if let Some(size) = self.size()
            && size != bytes.len()
        {
            return Err(ValueError::Length { expected: size, got: bytes.len() });
        }
        let mut wide = [0; 8];
        let number = |wide: &mut [u8; 8]| {
            wide[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(*wide)
        };
        Ok(match self.kind() {
            Kind::Bool => Value::Bool(bytes[0] != 0),
            Kind::Unsigned(_) => Value::Int(i128::from(number(&mut wide))),
            Kind::Signed(size) => {
                let shift = 64 - 8 * size as u32;
                Value::Int(i128::from((number(&mut wide) << shift) as i64 >> shift))
            }
            Kind::Real(4) => Value::Real(f64::from(f32::from_bits(number(&mut wide) as u32))),
            Kind::Real(_) => Value::Real(f64::from_bits(number(&mut wide))),
            Kind::Text => match std::str::from_utf8(bytes) {
                Ok(text) => Value::Text(text.trim_end_matches('\0').to_owned()),
                Err(_) => Value::Bytes(bytes.to_vec()),
            },
            Kind::Fixed(_) | Kind::Bytes => Value::Bytes(bytes.to_vec()),
        })
    }

    /// The whole number that `bytes` are in this type; `None` when they are none, or too large.
    pub fn decode_int(self, bytes: &[u8]) -> Option<i64> {
        let number = || unsigned(bytes);
        match self.kind() {
            Kind::Unsigned(size) if size == bytes.len() => number().try_into().ok(),
            Kind::Signed(size) if size == bytes.len() => {
                let shift = 64 - 8 * size as u32;
                Some((number() << shift) as i64 >> shift)
            }
            _ => self.decode(bytes).ok()?.as_int()?.try_into().ok(),
        }
    }

    /// The bytes of `value` in this type, low byte first.
    ///
    /// # Errors
    /// [`ValueError::Range`] when the number does not fit, [`ValueError::Kind`] when the value is
    /// of another sort altogether.
    pub fn encode(self, value: &Value) -> Result<Vec<u8>, ValueError> {
        match (self.kind(), value) {
            (Kind::Bool, Value::Bool(on)) => Ok(vec![u8::from(*on)]),
            (Kind::Bool, Value::Int(number @ 0..=1)) => Ok(vec![*number as u8]),
            (Kind::Signed(size) | Kind::Unsigned(size), Value::Int(number)) => {
                let (low, high) = self.limits().unwrap_or_default();
                if (low..=high).contains(number) {
                    Ok(number.to_le_bytes()[..size].to_vec())
                } else {
                    Err(ValueError::Range { data_type: self, low, high })
                }
            }
            (Kind::Signed(size) | Kind::Unsigned(size), Value::Bool(on)) => {
                Ok(i128::from(*on).to_le_bytes()[..size].to_vec())
            }
            (Kind::Real(size), number) => {
                let real = number.as_real().ok_or(ValueError::Kind { data_type: self })?;
                Ok(match size {
                    4 => (real as f32).to_le_bytes().to_vec(),
                    _ => real.to_le_bytes().to_vec(),
                })
            }
            (Kind::Text | Kind::Bytes, Value::Text(text)) => Ok(text.as_bytes().to_vec()),
            (Kind::Text | Kind::Bytes, Value::Bytes(bytes)) => Ok(bytes.clone()),
            (Kind::Fixed(size), Value::Bytes(bytes)) if bytes.len() == size => Ok(bytes.clone()),
            _ => Err(ValueError::Kind { data_type: self }),
        }
    }
}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "data type {:04X}h", self.0),
        }
    }
}

impl fmt::Debug for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A value of a dictionary entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A truth value.
    Bool(bool),
    /// Any whole number; wide enough for 64 bits of either sign.
    Int(i128),
    /// A floating point number.
    Real(f64),
    /// A visible string.
    Text(String),
    /// Anything else, as it is on the wire.
    Bytes(Vec<u8>),
}

impl Value {
    /// The number, when it is a whole one.
    pub const fn as_int(&self) -> Option<i128> {
        match self {
            Self::Int(number) => Some(*number),
            Self::Bool(on) => Some(*on as i128),
            _ => None,
        }
    }

    /// The value for people, as that of the object: `007D00C8h` of 1016:01, else `100 (64h)`.
    pub fn of(&self, mux: Mux) -> String {
        match self {
            Self::Int(number) if mux.is_composed() => format!("{number:08X}h"),
            other => other.to_string(),
        }
    }

    /// The number, when it is one.
    pub const fn as_real(&self) -> Option<f64> {
        match self {
            Self::Int(number) => Some(*number as f64),
            Self::Real(number) => Some(*number),
            _ => None,
        }
    }
}

impl From<i64> for Value {
    fn from(number: i64) -> Self {
        Self::Int(i128::from(number))
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(on) => write!(f, "{on}"),
            Self::Int(number) if number.unsigned_abs() < 10 => write!(f, "{number}"),
            Self::Int(number) if *number < 0 => write!(f, "{number}"),
            Self::Int(number) => write!(f, "{number} ({number:X}h)"),
            Self::Real(number) => write!(f, "{number}"),
            Self::Text(text) => write!(f, "{text:?}"),
            Self::Bytes(bytes) => {
                f.write_str("[")?;
                for (place, byte) in bytes.iter().enumerate() {
                    write!(f, "{}{byte:02X}", if place == 0 { "" } else { " " })?;
                }
                f.write_str("]")
            }
        }
    }
}

/// Why bytes and a value do not go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueError {
    /// The type has a fixed length, and this is not it. Both in bytes.
    Length {
        /// The length of the type.
        expected: usize,
        /// The actual length.
        got: usize,
    },
    /// The number does not fit the type.
    Range {
        /// The type.
        data_type: DataType,
        /// Its smallest value.
        low: i128,
        /// Its largest value.
        high: i128,
    },
    /// The value is of another sort: a text for a number, for example.
    Kind {
        /// The type.
        data_type: DataType,
    },
}

impl fmt::Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { expected, got } => write!(f, "{got} bytes where {expected} belong"),
            Self::Range { data_type, low, high } => {
                write!(f, "{data_type} holds {low} to {high}")
            }
            Self::Kind { data_type } => write!(f, "not a value of type {data_type}"),
        }
    }
}

impl std::error::Error for ValueError {}

/// The number in little-endian bytes; bytes after the eighth are ignored.
pub(crate) fn unsigned(bytes: &[u8]) -> u64 {
    // Most are of these lengths, which need no loop.
    match *bytes {
        [a] => a.into(),
        [a, b] => u16::from_le_bytes([a, b]).into(),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
        _ => bytes.iter().take(8).rev().fold(0, |number, byte| number << 8 | u64::from(*byte)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_sign_does_not_change_the_length() {
        assert_eq!(DataType::UNSIGNED16.with_sign(), Some(DataType::INTEGER16));
        assert_eq!(DataType::UNSIGNED56.with_sign(), Some(DataType::INTEGER56));
        assert_eq!(DataType::INTEGER16.with_sign(), None);
        assert_eq!(DataType::BOOLEAN.with_sign(), None);
    }

    #[test]
    fn bytes_and_values() {
        let table = [
            (DataType::BOOLEAN, Value::Bool(true), vec![1]),
            (DataType::INTEGER8, Value::Int(-2), vec![0xFE]),
            (DataType::UNSIGNED24, Value::Int(0x01_02_03), vec![3, 2, 1]),
            (DataType::INTEGER24, Value::Int(-1), vec![0xFF, 0xFF, 0xFF]),
            (DataType::UNSIGNED64, Value::Int(u64::MAX.into()), vec![0xFF; 8]),
            (DataType::REAL32, Value::Real(1.5), vec![0, 0, 0xC0, 0x3F]),
            (DataType::VISIBLE_STRING, Value::Text("PIX".into()), b"PIX".to_vec()),
            (DataType::DOMAIN, Value::Bytes(vec![1, 2]), vec![1, 2]),
        ];
        for (data_type, value, bytes) in table {
            assert_eq!(data_type.encode(&value), Ok(bytes.clone()), "{data_type}");
            assert_eq!(data_type.decode(&bytes), Ok(value), "{data_type}");
        }
    }

    #[test]
    fn refuses_what_does_not_fit() {
        let wrong = DataType::UNSIGNED8.encode(&Value::Int(256));
        assert_eq!(
            wrong,
            Err(ValueError::Range { data_type: DataType::UNSIGNED8, low: 0, high: 255 })
        );
        assert!(DataType::UNSIGNED8.encode(&Value::Text("1".into())).is_err());
        assert!(DataType::UNSIGNED16.decode(&[1]).is_err());
    }

    proptest! {
        #[test]
        fn whole_numbers_survive(code in 0usize..DataType::ALL.len(), number: i64) {
            let data_type = DataType::ALL[code];
            let bytes = data_type.encode(&Value::Int(number.into()));
            if let Ok(bytes) = bytes && data_type.is_integer() {
                prop_assert_eq!(Some(bytes.len()), data_type.size());
                prop_assert_eq!(data_type.decode(&bytes), Ok(Value::Int(number.into())));
            }
        }

        #[test]
        fn a_whole_number_is_the_value(code: u16, all: [u8; 10], length in 0usize..10) {
            let bytes = &all[..length];
            let data_type = DataType(code % 0x20);
            let value = data_type.decode(bytes).ok();
            let number = value.and_then(|value| value.as_int()?.try_into().ok());
            prop_assert_eq!(data_type.decode_int(bytes), number);
        }

        #[test]
        fn no_bytes_panic(code: u16, bytes: Vec<u8>) {
            if let Ok(value) = DataType(code % 0x20).decode(&bytes) {
                let _ = value.to_string();
            }
        }
    }
}
