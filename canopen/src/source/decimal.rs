//! Numbers with a point, as they are written: `0.1` is a tenth.

use std::fmt;
use std::str::FromStr;

use super::Node;

/// A number with a point, exactly as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decimal {
    /// The digits.
    digits: i128,
    /// How many of them stand behind the point.
    places: u32,
}

/// The largest number of digits after the point.
const MOST_PLACES: usize = 12;

impl Decimal {
    /// A number of the notation; `None` when it is none, or not a decimal one.
    pub fn of(node: &Node) -> Option<Self> {
        match node {
            Node::Int(number, _) => Some(Self { digits: *number, places: 0 }),
            Node::Real(_, text) => text.parse().ok(),
            _ => None,
        }
    }

    /// The nearest number that a computer calculates with.
    pub fn real(self) -> f64 {
        self.to_string().parse().unwrap_or(f64::NAN)
    }

    /// Whether it is 0.
    pub fn is_zero(self) -> bool {
        self.digits == 0
    }

    /// The number as a node.
    pub fn node(self) -> Node {
        match self.places {
            0 => Node::Int(self.digits, self.digits.to_string()),
            _ => Node::Real(self.to_string().parse().unwrap_or(f64::NAN), self.to_string()),
        }
    }

    fn digits_at(self, places: u32) -> Option<i128> {
        self.digits.checked_mul(10_i128.checked_pow(places.checked_sub(self.places)?)?)
    }

    fn both(self, other: Self, of: fn(i128, i128) -> Option<i128>) -> Option<Self> {
        let places = self.places.max(other.places);
        let digits = of(self.digits_at(places)?, other.digits_at(places)?)?;
        Some(Self { digits, places })
    }

    /// The sum; `None` when it is too large.
    pub fn plus(self, other: Self) -> Option<Self> {
        self.both(other, i128::checked_add)
    }

    /// The difference; `None` when it is too large.
    pub fn minus(self, other: Self) -> Option<Self> {
        self.both(other, i128::checked_sub)
    }

    /// The product; `None` when it is too large.
    pub fn times(self, other: Self) -> Option<Self> {
        let digits = self.digits.checked_mul(other.digits)?;
        Some(Self { digits, places: self.places.checked_add(other.places)? })
    }

    /// How often `other` is in it; `None` when that is no whole number.
    pub fn contains(self, other: Self) -> Option<i128> {
        let places = self.places.max(other.places);
        let (digits, unit) = (self.digits_at(places)?, other.digits_at(places)?);
        (digits.checked_rem(unit)? == 0).then(|| digits / unit)
    }
}

/// A whole number.
impl From<i128> for Decimal {
    fn from(digits: i128) -> Self {
        Self { digits, places: 0 }
    }
}

impl FromStr for Decimal {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (whole, part) = text.split_once('.').unwrap_or((text, ""));
        let is_plain = part.len() <= MOST_PLACES && part.bytes().all(|byte| byte.is_ascii_digit());
        let digits = format!("{whole}{part}").replace('_', "");
        match (is_plain, digits.parse()) {
            (true, Ok(digits)) => Ok(Self { digits, places: part.len() as u32 }),
            _ => Err(()),
        }
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = self.places as usize;
        if places == 0 {
            return write!(f, "{}", self.digits);
        }
        let sign = if self.digits < 0 { "-" } else { "" };
        let digits = format!("{:0>1$}", self.digits.unsigned_abs(), places + 1);
        let (whole, part) = digits.split_at(digits.len() - places);
        write!(f, "{sign}{whole}.{part}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_exact() {
        let decimal = |text: &str| text.parse::<Decimal>().unwrap();
        for (text, expected) in
            [("50.0", "50.0"), ("-0.5", "-0.5"), ("7", "7"), ("-12.25", "-12.25")]
        {
            assert_eq!(decimal(text).to_string(), expected);
        }
        assert_eq!(decimal("0.1").plus(decimal("0.2")).unwrap().to_string(), "0.3");
        assert_eq!(decimal("1").minus(decimal("1.25")).unwrap().to_string(), "-0.25");
        assert_eq!(decimal("1.5").times(decimal("3")).unwrap().to_string(), "4.5");
        for text in ["", "1.x", "above", "1.-5", "."] {
            assert!(text.parse::<Decimal>().is_err(), "{text}");
        }
    }
}
