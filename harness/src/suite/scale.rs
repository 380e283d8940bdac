//! Values of a document in the unit in which it prints them: `50.0 °C` of an object that counts
//! tenths of a degree.

use std::fmt;
use std::str::FromStr;

use canopen::source::Node;

/// A number with a point, exactly as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Decimal {
    /// The digits.
    digits: i128,
    /// How many of them stand behind the point.
    places: u32,
}

/// Numbers have no more digits behind the point.
const MOST_PLACES: usize = 12;

impl Decimal {
    /// A number of the notation; `None` when it is none, or not a decimal one.
    pub(super) fn of(node: &Node) -> Option<Self> {
        match node {
            Node::Int(number, _) => Some(Self { digits: *number, places: 0 }),
            Node::Real(_, text) => text.parse().ok(),
            _ => None,
        }
    }

    fn real(self) -> f64 {
        self.to_string().parse().unwrap_or(f64::NAN)
    }

    /// Whether it is 0.
    pub(super) fn is_zero(self) -> bool {
        self.digits == 0
    }

    /// The number as a node.
    pub(super) fn node(self) -> Node {
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
    pub(super) fn plus(self, other: Self) -> Option<Self> {
        self.both(other, i128::checked_add)
    }

    /// The difference; `None` when it is too large.
    pub(super) fn minus(self, other: Self) -> Option<Self> {
        self.both(other, i128::checked_sub)
    }

    /// The product; `None` when it is too large.
    pub(super) fn times(self, other: Self) -> Option<Self> {
        let digits = self.digits.checked_mul(other.digits)?;
        Some(Self { digits, places: self.places.checked_add(other.places)? })
    }

    /// How often `other` is in it; `None` when that is no whole number.
    pub(super) fn contains(self, other: Self) -> Option<i128> {
        let places = self.places.max(other.places);
        let (digits, unit) = (self.digits_at(places)?, other.digits_at(places)?);
        (digits.checked_rem(unit)? == 0).then(|| digits / unit)
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

/// What one count of an object is worth, and in which unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Scale {
    /// What one count is worth.
    pub count: Decimal,
    /// The unit; empty when it has none.
    pub unit: String,
}

impl Scale {
    /// The number in front of the unit, or alone.
    pub(super) fn number(&self, node: &Node) -> Option<Decimal> {
        match node {
            Node::Text(text) if !self.unit.is_empty() => {
                let number = text.strip_suffix(self.unit.as_str())?;
                Decimal::of(&Node::from(number.trim_end()))
            }
            other => Decimal::of(other),
        }
    }

    /// Counts instead of a value in the unit. `None` when it is no such value.
    ///
    /// # Errors
    /// When it lies between two counts.
    pub(super) fn counts(&self, node: &Node) -> Option<Result<Node, String>> {
        let number = self.number(node)?;
        Some(match number.contains(self.count) {
            Some(counts) => Ok(Node::Int(counts, counts.to_string())),
            None => Err(format!("{number} lies between two values: one count is {}", self.one())),
        })
    }

    /// The same where a part of a count is something as well, as on a bench.
    pub(super) fn amount(&self, node: &Node) -> Option<Node> {
        let number = self.number(node)?;
        Some(match number.contains(self.count) {
            Some(counts) => Node::Int(counts, counts.to_string()),
            None => {
                let counts = number.real() / self.count.real();
                Node::Real(counts, counts.to_string())
            }
        })
    }

    /// The value of a number of counts that need not be whole, with its unit.
    pub(super) fn show_real(&self, counts: f64) -> String {
        let value = (counts * self.count.real() * 1e6).round() / 1e6;
        format!("{value} {}", self.unit).trim_end().to_owned()
    }

    /// The value of so many counts, without its unit.
    pub(super) fn value(&self, counts: i128) -> Option<Decimal> {
        self.count.times(Decimal { digits: counts, places: 0 })
    }

    /// The value of so many counts, with its unit.
    pub(super) fn show(&self, counts: i128) -> Option<String> {
        let value = self.value(counts)?;
        Some(match self.unit.as_str() {
            "" => value.to_string(),
            unit => format!("{value} {unit}"),
        })
    }

    /// What one count is worth.
    pub(super) fn one(&self) -> String {
        self.show(1).unwrap_or_default()
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

    #[test]
    fn counts_of_an_object() {
        let tenths = Scale { count: "0.1".parse().unwrap(), unit: "°C".to_owned() };
        let counts = |text: &str| {
            tenths.counts(&Node::from(text)).map(|counts| match counts {
                Ok(Node::Int(counts, _)) => Ok(counts),
                other => Err(format!("{other:?}")),
            })
        };
        for (text, expected) in [("50.0 °C", 500), ("50", 500), ("-0.1 °C", -1), ("0", 0)] {
            assert_eq!(counts(text), Some(Ok(expected)), "{text}");
        }
        assert!(counts("0.05").unwrap().is_err());
        for text in ["50 K", "$value", "above"] {
            assert_eq!(counts(text), None, "{text}");
        }
        assert_eq!(tenths.show(-5).unwrap(), "-0.5 °C");
        let tens = Scale { count: "10".parse().unwrap(), unit: String::new() };
        assert_eq!(tens.show(3).unwrap(), "30");
        assert!(tens.counts(&Node::from("5")).unwrap().is_err());
    }
}
