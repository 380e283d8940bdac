//! The small words of the notation: values, times, tolerances, addresses.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use canopen::sdo::{self, Transfer};
use canopen::{Mux, Pattern};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer};

/// A name that the binder supplies or a step saved; written `$name`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name(pub Box<str>);

/// A value as it is written.
// A run has hundreds of thousands, so its parts are those that take the least room.
#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    /// A whole number.
    Int(i128),
    /// A number with a point.
    Real(f64),
    /// `true` or `false`.
    Bool(bool),
    /// The value of a name, and what is added to it.
    Named(Name, i64),
    /// The values of several names added up, such as bits that are set together.
    Sum(Box<[Name]>, i64),
    /// A time, converted to the unit of the object.
    Time(Amount),
    /// Any other text.
    Text(String),
}

/// A time as it is written: `20 ms`, `$period`, `1.5 x $period`.
#[derive(Clone, Debug, PartialEq)]
pub enum Amount {
    /// A fixed time.
    Fixed(Duration),
    /// A multiple of a name's time.
    Scaled(f64, Name),
}

/// Bounds of a time as they are written.
#[derive(Clone, Debug, PartialEq)]
pub enum Tolerance {
    /// `100 ms +/- 10 %`.
    Percent(Amount, f64),
    /// `100 ms +/- 2 ms`.
    PlusMinus(Amount, Amount),
    /// `>= 100 ms`.
    AtLeast(Amount),
    /// `<= 100 ms`.
    AtMost(Amount),
    /// `90 ms .. 110 ms`.
    Between(Amount, Amount),
}

/// An address as it is written: `"1017:00"` or `$mux`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ObjectRef {
    /// This address.
    Fixed(Mux),
    /// The address bound to a name.
    Named(Name),
}

impl Default for ObjectRef {
    fn default() -> Self {
        Self::Fixed(Mux::new(0, 0))
    }
}

/// A frame as it is written: a pattern, whose identifier may be a name: `$pdo#...`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameText {
    /// The name that stands for the identifier.
    pub id: Option<Name>,
    /// The pattern; its identifier does not count when a name stands for it.
    pub pattern: Pattern,
}

/// The protocol of an SDO transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Flow {
    /// All data in one frame.
    Expedited,
    /// In segments.
    Segmented,
    /// In blocks of segments.
    Block,
}

impl From<Flow> for Transfer {
    fn from(flow: Flow) -> Self {
        match flow {
            Flow::Expedited => Self::Expedited,
            Flow::Segmented => Self::Segmented,
            Flow::Block => Self::Block,
        }
    }
}

/// What the tester does wrong in a block download.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mistake {
    /// The first segment is not sent before it is missed.
    LostSegment,
    /// The second segment of the second sub-block is not sent before it is missed, nor is that of
    /// the sub-block after it.
    LaterSegmentsLost,
    /// The first segment is sent twice.
    RepeatedSegment,
    /// The checksum at the end is not that of the data.
    WrongChecksum,
}

impl From<Mistake> for sdo::Mistake {
    fn from(mistake: Mistake) -> Self {
        match mistake {
            Mistake::LostSegment => Self::LostSegment,
            Mistake::LaterSegmentsLost => Self::LaterSegmentsLost,
            Mistake::RepeatedSegment => Self::RepeatedSegment,
            Mistake::WrongChecksum => Self::WrongChecksum,
        }
    }
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a name: names are written `$period`");
        let name = text.strip_prefix('$').ok_or_else(wrong)?;
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || !name.chars().all(fits) {
            return Err(wrong());
        }
        Ok(Self(name.into()))
    }
}

impl FromStr for Amount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some((factor, name)) = text.split_once(" x ") {
            let factor = factor.trim().parse::<f64>().ok().filter(|f| f.is_finite() && *f >= 0.0);
            let factor = factor.ok_or_else(|| format!("`{text}`: no number before the `x`"))?;
            return Ok(Self::Scaled(factor, name.trim().parse()?));
        }
        if text.starts_with('$') {
            return Ok(Self::Scaled(1.0, text.parse()?));
        }
        let unit_at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
        let (number, unit) = text.split_at(unit_at);
        let nanos = match unit {
            "us" => 1e3,
            "ms" => 1e6,
            "s" => 1e9,
            "min" => 60e9,
            _ => return Err(format!("`{text}` is not a time: write `500 us`, `20 ms`, `1 s`")),
        };
        let number = number.trim().parse::<f64>().ok().filter(|n| n.is_finite() && *n >= 0.0);
        let number = number.ok_or_else(|| format!("`{text}`: no number before the unit"))?;
        Ok(Self::Fixed(Duration::from_nanos((number * nanos).round() as u64)))
    }
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some(low) = text.strip_prefix(">=") {
            return low.parse().map(Self::AtLeast);
        }
        if let Some(high) = text.strip_prefix("<=") {
            return high.parse().map(Self::AtMost);
        }
        if let Some((low, high)) = text.split_once("..") {
            return Ok(Self::Between(low.parse()?, high.parse()?));
        }
        let Some((center, spread)) = text.split_once("+/-") else {
            return Err(format!("`{text}`: write `100 ms +/- 10 %`, `>= 5 ms` or `9 ms .. 11 ms`"));
        };
        let center = center.parse()?;
        match spread.trim().strip_suffix('%') {
            Some(percent) => percent
                .trim()
                .parse::<f64>()
                .ok()
                .filter(|percent| (0.0..=100.0).contains(percent))
                .map(|percent| Self::Percent(center, percent))
                .ok_or_else(|| format!("`{text}`: a tolerance is 0 to 100 %")),
            None => Ok(Self::PlusMinus(center, spread.parse()?)),
        }
    }
}

impl FromStr for ObjectRef {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.starts_with('$') {
            return text.parse().map(Self::Named);
        }
        text.parse().map(Self::Fixed).map_err(|error: canopen::NoMux| error.to_string())
    }
}

impl FromStr for FrameText {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = text.split_once('#').filter(|(head, _)| head.trim_start().starts_with('$'));
        let (id, pattern) = match named {
            Some((name, body)) => (Some(name.trim().parse()?), format!("000#{body}").parse()),
            None => (None, text.parse()),
        };
        // The name may be longer or shorter than the identifier in its place.
        let head = named.map_or(0, |(name, _)| name.len() as isize - 3);
        let pattern = pattern.map_err(|error: canopen::PatternError| {
            let at = usize::try_from(error.at as isize + head).unwrap_or_default();
            crate::source::at_offset(at, error.message)
        })?;
        Ok(Self { id, pattern })
    }
}

impl FromStr for Literal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.starts_with('$') {
            return sum(text);
        }
        Ok(match text.parse() {
            Ok(amount) => Self::Time(amount),
            Err(_) => Self::Text(text.to_owned()),
        })
    }
}

/// `$name`, and what is added: `$name + $other - 5`.
fn sum(text: &str) -> Result<Literal, String> {
    let blank = [' ', '\t'];
    let (first, mut rest) = text.split_once(blank).unwrap_or((text, ""));
    let (first, mut others, mut number) = (first.parse()?, Vec::new(), 0_i64);
    while !rest.trim_start().is_empty() {
        let signed = rest.trim_start();
        let sign = match signed.as_bytes().first() {
            Some(b'+') => 1,
            Some(b'-') => -1,
            _ => return Err(format!("`{text}`: write `$name + 5`, `$name - 5` or `$one + $two`")),
        };
        let term = signed[1..].trim_start();
        let (term, behind) = term.split_once(blank).unwrap_or((term, ""));
        if sign > 0 && term.starts_with('$') {
            others.push(term.parse()?);
        } else {
            let wrong = || format!("`{text}`: no whole number after the sign");
            let term = term.parse::<i64>().map_err(|_| wrong())?.checked_mul(sign);
            number = term.and_then(|term| number.checked_add(term)).ok_or_else(wrong)?;
        }
        rest = behind;
    }
    if others.is_empty() {
        return Ok(Literal::Named(first, number));
    }
    others.insert(0, first);
    Ok(Literal::Sum(others.into(), number))
}

impl fmt::Display for FrameText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.pattern.to_string();
        match (&self.id, text.split_once('#')) {
            (Some(name), Some((_, data))) => write!(f, "{name}#{data}"),
            _ => f.write_str(&text),
        }
    }
}

impl fmt::Display for ObjectRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(mux) => write!(f, "{mux}"),
            Self::Named(name) => write!(f, "{name}"),
        }
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "${}", self.0)
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(time) => f.write_str(&show_time(*time)),
            Self::Scaled(factor, name) if *factor == 1.0 => write!(f, "{name}"),
            Self::Scaled(factor, name) => write!(f, "{factor} x {name}"),
        }
    }
}

impl fmt::Display for Literal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(number) => write!(f, "{number}"),
            Self::Real(number) => write!(f, "{number}"),
            Self::Bool(on) => write!(f, "{on}"),
            Self::Named(name, 0) => write!(f, "{name}"),
            Self::Named(name, offset) => write!(f, "{name} {offset:+}"),
            Self::Sum(names, number) => {
                let names: Vec<String> = names.iter().map(Name::to_string).collect();
                f.write_str(&names.join(" + "))?;
                if *number == 0 { Ok(()) } else { write!(f, " {number:+}") }
            }
            Self::Time(amount) => write!(f, "{amount}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// A time in the largest unit that needs no more than three decimals.
pub(crate) fn show_time(time: Duration) -> String {
    let nanos = time.as_nanos() as f64;
    let (number, unit) = match nanos {
        n if n >= 1e9 => (n / 1e9, "s"),
        n if n >= 1e6 || n == 0.0 => (n / 1e6, "ms"),
        n => (n / 1e3, "us"),
    };
    let text = format!("{number:.3}");
    format!("{} {unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

macro_rules! scalar {
    ($($kind:ident: $what:literal;)*) => {$(
        impl<'de> Deserialize<'de> for $kind {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let text = Cow::<str>::deserialize(deserializer)?;
                text.parse().map_err(de::Error::custom)
            }
        }

        impl JsonSchema for $kind {
            fn inline_schema() -> bool {
                true
            }
            fn schema_name() -> Cow<'static, str> {
                stringify!($kind).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "description": $what })
            }
        }
    )*};
}

scalar! {
    Amount: "A time: `500 us`, `20 ms`, `1 s`, `$period`, `2 x $period`.";
    Tolerance: "Bounds: `9 ms +/- 10 %`, `$period +/- 2 ms`, `>= 5 ms`, `9 ms .. 11 ms`.";
    ObjectRef: "An object, quoted: `\"1017:00\"` or `$mux`.";
    FrameText: "A frame pattern: `580+n#80 $mux 02 00 01 06`.";
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Cow::<str>::deserialize(deserializer)?;
        format!("${text}").parse().map_err(de::Error::custom)
    }
}

impl JsonSchema for Name {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Name".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "description": "A name, without the `$`." })
    }
}

impl<'de> Deserialize<'de> for Literal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Scalar;
        impl Visitor<'_> for Scalar {
            type Value = Literal;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, a truth value, a time, a text or `$name`")
            }
            fn visit_i64<E>(self, number: i64) -> Result<Literal, E> {
                Ok(Literal::Int(number.into()))
            }
            fn visit_u64<E>(self, number: u64) -> Result<Literal, E> {
                Ok(Literal::Int(number.into()))
            }
            fn visit_f64<E>(self, number: f64) -> Result<Literal, E> {
                Ok(Literal::Real(number))
            }
            fn visit_bool<E>(self, on: bool) -> Result<Literal, E> {
                Ok(Literal::Bool(on))
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Literal, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_any(Scalar)
    }
}

impl JsonSchema for Literal {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Literal".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["number", "boolean", "string"],
            "description": "A value, `$name`, `$name + 5`, `$one + $two`, or a time as `20 ms`."
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_literal_takes_little_room() {
        assert_eq!(size_of::<Literal>(), 32);
    }

    #[test]
    fn times() {
        let table = [
            ("20 ms", Amount::Fixed(Duration::from_millis(20))),
            ("1.5 s", Amount::Fixed(Duration::from_millis(1500))),
            ("250us", Amount::Fixed(Duration::from_micros(250))),
            ("$period", Amount::Scaled(1.0, Name("period".into()))),
            ("2 x $period", Amount::Scaled(2.0, Name("period".into()))),
        ];
        for (text, amount) in table {
            assert_eq!(text.parse(), Ok(amount), "{text}");
        }
        for wrong in ["20", "ms", "-1 s", "2 x", "x $p", "1e400 s", "$"] {
            assert!(wrong.parse::<Amount>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn tolerances() {
        let ms = |n| Amount::Fixed(Duration::from_millis(n));
        let table = [
            ("100 ms +/- 10 %", Tolerance::Percent(ms(100), 10.0)),
            ("100 ms +/- 2 ms", Tolerance::PlusMinus(ms(100), ms(2))),
            (">= 100 ms", Tolerance::AtLeast(ms(100))),
            ("90 ms .. 110 ms", Tolerance::Between(ms(90), ms(110))),
        ];
        for (text, tolerance) in table {
            assert_eq!(text.parse(), Ok(tolerance), "{text}");
        }
        assert!("100 ms".parse::<Tolerance>().is_err());
        assert!("100 ms +/- 110 %".parse::<Tolerance>().is_err());
    }

    #[test]
    fn literals() {
        let yaml = "[5, 0x10, 0b1000_0001, -3, 1.5, true, $x, $x + 5, $x - 5, 20 ms, M260, \
            $x + $y, $x +2 + $y - 5]";
        let literals: Vec<Literal> = serde_yaml::from_str(yaml).unwrap();
        let x = |offset| Literal::Named(Name("x".into()), offset);
        assert_eq!(literals[..4], [5, 16, 0x81, -3].map(Literal::Int));
        assert_eq!(literals[4..6], [Literal::Real(1.5), Literal::Bool(true)]);
        assert_eq!(literals[6..9], [x(0), x(5), x(-5)]);
        assert_eq!(literals[9], Literal::Time(Amount::Fixed(Duration::from_millis(20))));
        assert_eq!(literals[10], Literal::Text("M260".into()));
        let sum = |number| Literal::Sum([Name("x".into()), Name("y".into())].into(), number);
        assert_eq!(literals[11..], [sum(0), sum(-3)]);
        assert_eq!(literals[12].to_string(), "$x + $y -3");
        for wrong in ["$x - $y", "$x $y", "$x +", "$x + 1.5", "$x + $"] {
            assert!(wrong.parse::<Literal>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn times_are_shown_short() {
        let table =
            [(1_500_000_000, "1.5 s"), (20_000_000, "20 ms"), (250_000, "250 us"), (0, "0 ms")];
        for (nanos, text) in table {
            assert_eq!(show_time(Duration::from_nanos(nanos)), text);
        }
    }
}
