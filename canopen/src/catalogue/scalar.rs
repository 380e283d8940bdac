//! The single values of a description.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::eds::{Access, Term};
use crate::nearest::did_you_mean;
use crate::value::{DataType, Value};

/// A default value or a limit as written, before its type is known.
#[derive(Clone, Debug, PartialEq)]
pub enum Scalar {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Int(i128),
    /// A number with a point.
    Real(f64),
    /// Any other text, `$NODEID+0x180` among them.
    Text(String),
}

impl Scalar {
    /// The value in the terms of a data sheet; `None` when it is none of this type.
    pub fn term(&self, data_type: DataType) -> Option<Term> {
        let fixed = |value: Value| {
            data_type.encode(&value).is_ok().then_some(Term { value, plus_node: false })
        };
        // A data sheet is read back with the precision of the type.
        let real = |number: f64| match data_type {
            DataType::REAL32 => Value::Real(f64::from(number as f32)),
            _ => Value::Real(number),
        };
        match self {
            Self::Bool(on) => fixed(Value::Bool(*on)),
            Self::Int(number @ 0..=1) if data_type == DataType::BOOLEAN => {
                fixed(Value::Bool(*number == 1))
            }
            Self::Int(number) if data_type.is_integer() => fixed(Value::Int(*number)),
            Self::Int(number) => {
                fixed(real(*number as f64)).or_else(|| fixed(Value::Text(self.to_string())))
            }
            Self::Real(number) => {
                fixed(real(*number)).or_else(|| fixed(Value::Text(self.to_string())))
            }
            Self::Text(text) => match text.strip_prefix("$NODEID") {
                Some(rest) if data_type.is_integer() => {
                    Some(Term { value: Value::Int(offset(rest)?), plus_node: true })
                }
                _ => fixed(Value::Text(text.clone())),
            },
        }
    }
}

impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(on) => write!(f, "{on}"),
            Self::Int(number) => write!(f, "{number}"),
            Self::Real(number) => write!(f, "{number}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ScalarVisitor)
    }
}

impl Serialize for DataType {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for DataType {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name).ok_or_else(|| {
            let meant = did_you_mean(&name, Self::names());
            D::Error::custom(format!("unknown data type `{name}`{meant}"))
        })
    }
}

impl<'de> Deserialize<'de> for Access {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            D::Error::custom(format!("unknown access type `{name}`: there is {names}"))
        })
    }
}

impl JsonSchema for DataType {
    fn schema_name() -> Cow<'static, str> {
        "DataType".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = Self::names().collect();
        json_schema!({ "type": "string", "enum": names })
    }
}

impl JsonSchema for Access {
    fn schema_name() -> Cow<'static, str> {
        "Access".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": Self::ALL.map(Self::name) })
    }
}

/// The `+0x180` after `$NODEID`; nothing is 0.
fn offset(text: &str) -> Option<i128> {
    let Some(number) = text.strip_prefix('+') else {
        return text.is_empty().then_some(0);
    };
    match number.strip_prefix("0x") {
        Some(digits) => i128::from_str_radix(digits, 16).ok(),
        None => number.parse().ok(),
    }
}

impl JsonSchema for Scalar {
    fn schema_name() -> Cow<'static, str> {
        "Scalar".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description":
                "A value of the type of the object; `$NODEID+0x180` depends on the node id.",
            "type": ["boolean", "number", "string"],
        })
    }
}

struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a text, true or false")
    }

    fn visit_bool<E: Error>(self, on: bool) -> Result<Scalar, E> {
        Ok(Scalar::Bool(on))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Scalar, E> {
        Ok(Scalar::Int(number.into()))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Scalar, E> {
        Ok(Scalar::Int(number.into()))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Scalar, E> {
        Ok(Scalar::Real(number))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Scalar, E> {
        Ok(Scalar::Text(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_every_kind() {
        let text = |text: &str| Scalar::Text(text.into());
        let node = |offset| Some(Term { value: Value::Int(offset), plus_node: true });
        let table = [
            (text("$NODEID+0x180"), DataType::UNSIGNED32, node(0x180)),
            (text("$NODEID"), DataType::UNSIGNED8, node(0)),
            (text("$NODEID-1"), DataType::UNSIGNED8, None),
            (text("M260"), DataType::VISIBLE_STRING, Some(Term::fixed(Value::Text("M260".into())))),
            (Scalar::Int(1), DataType::BOOLEAN, Some(Term::fixed(Value::Bool(true)))),
            (Scalar::Int(256), DataType::UNSIGNED8, None),
            (Scalar::Int(2), DataType::REAL32, Some(Term::fixed(Value::Real(2.0)))),
            (Scalar::Real(1.5), DataType::INTEGER16, None),
            (
                Scalar::Real(0.6),
                DataType::REAL32,
                Some(Term::fixed(Value::Real(f64::from(0.6_f32)))),
            ),
        ];
        for (scalar, data_type, term) in table {
            assert_eq!(scalar.term(data_type), term, "{scalar} as {data_type}");
        }
    }

    #[test]
    fn yaml_gives_the_kind_that_is_written() {
        let read = |yaml: &str| serde_yaml::from_str::<Vec<Scalar>>(yaml).unwrap();
        assert_eq!(
            read("[0x10, -3, 0.5, false, $NODEID+1, FW 1.02]"),
            [
                Scalar::Int(16),
                Scalar::Int(-3),
                Scalar::Real(0.5),
                Scalar::Bool(false),
                Scalar::Text("$NODEID+1".into()),
                Scalar::Text("FW 1.02".into()),
            ]
        );
    }
}
