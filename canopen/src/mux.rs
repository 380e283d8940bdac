//! The address of a value in an object dictionary.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Index and sub-index. Written `1017:00`, hexadecimal both.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Mux {
    /// Index of the object.
    pub index: u16,
    /// Sub-index within the object.
    pub sub: u8,
}

impl Mux {
    /// The address `index:sub`.
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }

    /// The three bytes an SDO carries: index with the low byte first, sub-index.
    pub const fn bytes(self) -> [u8; 3] {
        let [low, high] = self.index.to_le_bytes();
        [low, high, self.sub]
    }

    /// Whether the value is put together of identifiers, node ids, addresses and bits, which people
    /// read in hexadecimal: COB-IDs, monitored nodes and mappings.
    pub const fn is_composed(self) -> bool {
        matches!(
            (self.index, self.sub),
            (0x1005 | 0x1012 | 0x1014, 0)
                | (0x1016 | 0x1028 | 0x1600..=0x17FF | 0x1A00..=0x1BFF, 1..)
                | (0x1200..=0x12FF, 1 | 2)
                | (0x1400..=0x15FF | 0x1800..=0x19FF, 1)
        )
    }

    /// The address in three SDO bytes.
    pub const fn from_bytes(bytes: [u8; 3]) -> Self {
        Self { index: u16::from_le_bytes([bytes[0], bytes[1]]), sub: bytes[2] }
    }
}

impl fmt::Display for Mux {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}:{:02X}", self.index, self.sub)
    }
}

impl fmt::Debug for Mux {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A text is not an address of the form `1017:00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoMux;

impl fmt::Display for NoMux {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object is written \"1017:00\": four and two hex digits")
    }
}

impl std::error::Error for NoMux {}

impl FromStr for Mux {
    type Err = NoMux;

    fn from_str(text: &str) -> Result<Self, NoMux> {
        let (index, sub) = text.split_once(':').ok_or(NoMux)?;
        let digits = |text: &str, len| {
            text.len() == len && text.bytes().all(|digit| digit.is_ascii_hexdigit())
        };
        if !digits(index, 4) || !digits(sub, 2) {
            return Err(NoMux);
        }
        let index = u16::from_str_radix(index, 16).map_err(|_| NoMux)?;
        let sub = u8::from_str_radix(sub, 16).map_err(|_| NoMux)?;
        Ok(Self { index, sub })
    }
}

impl Serialize for Mux {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Mux {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

impl JsonSchema for Mux {
    fn schema_name() -> Cow<'static, str> {
        "Address".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Index and sub-index, hexadecimal: `\"1017:00\"`.",
            "type": "string",
            "pattern": "^[0-9A-Fa-f]{4}:[0-9A-Fa-f]{2}$",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_bytes() {
        let mux = Mux::new(0x1017, 0xA);
        assert_eq!(mux.to_string(), "1017:0A");
        assert_eq!("1017:0a".parse(), Ok(mux));
        assert_eq!(Mux::from_bytes(mux.bytes()), mux);
        for wrong in ["1017", "1017:", "1017:1", "+017:00", "1017:000", "x"] {
            assert_eq!(wrong.parse::<Mux>(), Err(NoMux), "{wrong}");
        }
    }
}
