//! SDO abort codes (CiA 301, 7.2.4.3.17).

use std::fmt;

/// Why an SDO transfer was aborted. Every 32-bit value is representable.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Abort(pub u32);

macro_rules! aborts {
    ($($name:ident = $code:literal, $meaning:literal;)*) => {
        impl Abort {
            $(#[doc = concat!(stringify!($code), ": ", $meaning, ".")]
            pub const $name: Self = Self($code);)*

            /// Every code that the specification names.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The meaning of the code; `None` when the specification does not define it.
            pub const fn meaning(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($meaning),)*
                    _ => None,
                }
            }
        }
    };
}

aborts! {
    TOGGLE = 0x0503_0000, "toggle bit not alternated";
    TIMEOUT = 0x0504_0000, "SDO protocol timed out";
    COMMAND = 0x0504_0001, "command specifier not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "block size not valid";
    SEQUENCE = 0x0504_0003, "sequence number not valid";
    CRC = 0x0504_0004, "CRC error";
    MEMORY = 0x0504_0005, "out of memory";
    ACCESS = 0x0601_0000, "access to the object not supported";
    WRITE_ONLY = 0x0601_0001, "a write-only object cannot be read";
    READ_ONLY = 0x0601_0002, "a read-only object cannot be written";
    NO_OBJECT = 0x0602_0000, "object does not exist";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "mapped objects would exceed the PDO length";
    INCOMPATIBLE = 0x0604_0043, "general parameter incompatibility";
    INTERNAL_INCOMPATIBLE = 0x0604_0047, "general internal incompatibility in the device";
    HARDWARE = 0x0606_0000, "access failed because of a hardware error";
    LENGTH = 0x0607_0010, "data type or length does not match";
    TOO_LONG = 0x0607_0012, "data too long for the object";
    TOO_SHORT = 0x0607_0013, "data too short for the object";
    NO_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    VALUE = 0x0609_0030, "value not valid for the object";
    TOO_HIGH = 0x0609_0031, "value too high";
    TOO_LOW = 0x0609_0032, "value too low";
    MAX_BELOW_MIN = 0x0609_0036, "maximum is below minimum";
    NO_CONNECTION = 0x060A_0023, "resource not available";
    GENERAL = 0x0800_0000, "general error";
    STORE = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be transferred or stored in this device state";
    NO_DICTIONARY = 0x0800_0023, "object dictionary not present or not generated";
    NO_DATA = 0x0800_0024, "no data available";
}

impl fmt::Display for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X} {:04X}h", self.0 >> 16, self.0 & 0xFFFF)?;
        self.meaning().map_or(Ok(()), |meaning| write!(f, " ({meaning})"))
    }
}

impl fmt::Debug for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Abort {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_its_meaning_or_at_least_the_number() {
        assert_eq!(Abort::TOGGLE.to_string(), "0503 0000h (toggle bit not alternated)");
        assert_eq!(Abort(0x0800_0099).to_string(), "0800 0099h");
    }
}
