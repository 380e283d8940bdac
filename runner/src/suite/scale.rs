//! Values of a document in the unit in which it prints them: `50.0 °C` of an object that counts
//! tenths of a degree.

use canopen::source::{Decimal, Node};

/// Units of time: how many microseconds each has, and what a microsecond is in it. A minute has no
/// decimal part of which that can be said.
const TIMES: [(&str, i128, &str); 4] =
    [("us", 1, "1"), ("ms", 1_000, "0.001"), ("s", 1_000_000, "0.000001"), ("min", 60_000_000, "")];

/// The value of one count of an object, and its unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Scale {
    /// The value of one count.
    pub count: Decimal,
    /// The unit; empty when it has none.
    pub unit: String,
}

impl Scale {
    /// The number in front of the unit, or alone.
    pub(super) fn number(&self, node: &Node) -> Option<Decimal> {
        match node {
            Node::Text(text) if !self.unit.is_empty() => {
                let alone = |number: &str| Decimal::of(&Node::from(number.trim_end()));
                text.strip_suffix(self.unit.as_str()).and_then(alone).or_else(|| self.time(text))
            }
            other => Decimal::of(other),
        }
    }

    /// A time that is written in another unit than that of the object: `1500 ms` where it is in
    /// seconds.
    fn time(&self, text: &str) -> Option<Decimal> {
        let of = |unit: &str| TIMES.iter().find(|(known, ..)| *known == unit.trim());
        let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic())?);
        let ((_, micros, _), (_, _, inverse)) = (of(unit)?, of(&self.unit)?);
        let number = Decimal::of(&Node::from(number.trim_end()))?;
        number.times(Decimal::from(*micros))?.times(inverse.parse().ok()?)
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

    /// The value of this many counts, without its unit.
    pub(super) fn value(&self, counts: i128) -> Option<Decimal> {
        self.count.times(Decimal::from(counts))
    }

    /// The value of this many counts, with its unit.
    pub(super) fn show(&self, counts: i128) -> Option<String> {
        let value = self.value(counts)?;
        Some(match self.unit.as_str() {
            "" => value.to_string(),
            unit => format!("{value} {unit}"),
        })
    }

    /// The value of one count.
    pub(super) fn one(&self) -> String {
        self.show(1).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let seconds = Scale { count: "0.1".parse().unwrap(), unit: "s".to_owned() };
        let counts_of = |text: &str| match seconds.counts(&Node::from(text)) {
            Some(Ok(Node::Int(counts, _))) => Some(counts),
            _ => None,
        };
        let times = [("1.5 s", Some(15)), ("1500 ms", Some(15)), ("2 min", Some(1200))];
        for (text, expected) in times.into_iter().chain([("1550 ms", None), ("3 K", None)]) {
            assert_eq!(counts_of(text), expected, "{text}");
        }
        let tens = Scale { count: "10".parse().unwrap(), unit: String::new() };
        assert_eq!(tens.show(3).unwrap(), "30");
        assert!(tens.counts(&Node::from("5")).unwrap().is_err());
    }
}
