//! The words for refusals: which abort codes are expected, and which are accepted.

use std::borrow::Cow;
use std::fmt;

use canopen::Abort;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::literal::Literal;
use crate::source::At;

/// The refusal that is expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The abort codes of a conformant device, mostly one.
    pub codes: Vec<u32>,
    /// Codes that are accepted, too.
    pub lenient: Vec<Refused>,
    /// A device that does not refuse is accepted, too.
    pub or_taken: bool,
}

/// A code with which a device may refuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// That one.
    With(u32),
    /// Any that is about the value or the state of the device: for documents that want an abort and
    /// give no code. Those about the protocol, a missing object, its access or its length are not.
    WithAny,
}

impl Refused {
    /// Whether the code is among those that it means.
    pub const fn fits(self, code: u32) -> bool {
        match self {
            Self::With(known) => known == code,
            Self::WithAny => {
                !matches!(code >> 16, 0x0504 | 0x0601 | 0x0602 | 0x0607) && code != 0x0609_0011
            }
        }
    }

    /// The code, when it is a certain one.
    pub const fn code(self) -> Option<u32> {
        match self {
            Self::With(code) => Some(code),
            Self::WithAny => None,
        }
    }
}

/// As sentences have it.
impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let codes: Vec<String> = self.codes.iter().map(|code| Abort(*code).to_string()).collect();
        write!(f, "refused with {}", codes.join(" or "))
    }
}

/// One of the lenient answers to what is to be refused.
#[derive(Deserialize)]
#[serde(try_from = "Literal")]
enum Instead {
    Refused(Refused),
    Taken,
}

impl TryFrom<Literal> for Instead {
    type Error = String;

    fn try_from(literal: Literal) -> Result<Self, String> {
        match literal {
            Literal::Int(code) => code
                .try_into()
                .map(|code| Self::Refused(Refused::With(code)))
                .map_err(|_| TOO_WIDE.to_owned()),
            Literal::Text(text) if text == "any" => Ok(Self::Refused(Refused::WithAny)),
            Literal::Text(text) if text == "taken" => Ok(Self::Taken),
            other => Err(format!("`{other}`: write abort codes, `any` or `taken`")),
        }
    }
}

impl<'de> Deserialize<'de> for Refused {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Instead::deserialize(deserializer)? {
            Instead::Refused(refused) => Ok(refused),
            Instead::Taken => Err(de::Error::custom("`taken`: write abort codes, or `any`")),
        }
    }
}

impl JsonSchema for Refused {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Refused".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "oneOf": [{ "type": "integer" }, { "const": "any" }] })
    }
}

/// One code, or several.
#[derive(Deserialize)]
#[serde(untagged)]
enum OneOrMore {
    One(u32),
    More(Vec<u32>),
}

impl<'de> Deserialize<'de> for Refusal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CodeOrMap;
        impl<'de> Visitor<'de> for CodeOrMap {
            type Value = Refusal;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an abort code such as 0x06010002, or `code` and `lenient`")
            }
            fn visit_u64<E: de::Error>(self, code: u64) -> Result<Refusal, E> {
                let code = code.try_into().map_err(|_| E::custom(TOO_WIDE))?;
                Ok(Refusal { codes: vec![code], lenient: Vec::new(), or_taken: false })
            }
            fn visit_i64<E: de::Error>(self, code: i64) -> Result<Refusal, E> {
                let code = code.try_into().map_err(|_| E::custom(TOO_WIDE))?;
                Ok(Refusal { codes: vec![code], lenient: Vec::new(), or_taken: false })
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Refusal, A::Error> {
                let (mut codes, mut instead) = (Vec::new(), Vec::new());
                while let Some(key) = map.next_key::<At<String>>()? {
                    match key.value.as_str() {
                        "code" => {
                            codes = match map.next_value()? {
                                OneOrMore::One(code) => vec![code],
                                OneOrMore::More(codes) => codes,
                            }
                        }
                        "lenient" => instead = map.next_value::<Vec<Instead>>()?,
                        other => return Err(de::Error::unknown_field(other, &["code", "lenient"])),
                    }
                }
                if codes.is_empty() {
                    return Err(de::Error::missing_field("code"));
                }
                let or_taken = instead.iter().any(|one| matches!(one, Instead::Taken));
                let lenient = instead.into_iter().filter_map(|one| match one {
                    Instead::Refused(refused) => Some(refused),
                    Instead::Taken => None,
                });
                Ok(Refusal { codes, lenient: lenient.collect(), or_taken })
            }
        }
        deserializer.deserialize_any(CodeOrMap)
    }
}

impl JsonSchema for Refusal {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Refusal".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let code = json_schema!({ "type": "integer" });
        json_schema!({
            "description": "An abort code, or the strict ones and the lenient ones.",
            "oneOf": [
                code,
                {
                    "type": "object",
                    "properties": {
                        "code": { "oneOf": [code, { "type": "array", "items": code }] },
                        "lenient": {
                            "type": "array",
                            "items": { "oneOf": [code, { "enum": ["any", "taken"] }] }
                        }
                    },
                    "required": ["code"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

const TOO_WIDE: &str = "an abort code has 32 bits";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals() {
        let refusal = |yaml| serde_yaml::from_str::<Refusal>(yaml);
        let of = |codes: &[u32], lenient: &[Refused], or_taken| Refusal {
            codes: codes.to_vec(),
            lenient: lenient.to_vec(),
            or_taken,
        };
        let general = Refused::With(0x0800_0000);
        for (yaml, expected) in [
            ("0x06010002", of(&[0x0601_0002], &[], false)),
            ("{ code: 0x06010002, lenient: [0x08000000] }", of(&[0x0601_0002], &[general], false)),
            ("{ code: 1, lenient: [taken, 0x08000000] }", of(&[1], &[general], true)),
            ("{ code: [1, 2], lenient: [any] }", of(&[1, 2], &[Refused::WithAny], false)),
        ] {
            assert_eq!(refusal(yaml).unwrap(), expected, "{yaml}");
        }
        for wrong in [
            "{ code: 1, lenient: [token] }",
            "{ code: 1, lenent: [] }",
            "{ lenient: [] }",
            "{ code: [] }",
            "{ code: any }",
            "0x100000000",
        ] {
            assert!(refusal(wrong).is_err(), "{wrong}");
        }
        assert!(serde_yaml::from_str::<Refused>("taken").is_err());
    }

    #[test]
    fn any_code_is_one_about_the_value() {
        for code in [0x0604_0043, 0x0609_0030, 0x0800_0000, 0x0800_0022] {
            assert!(Refused::WithAny.fits(code), "{code:08X}");
        }
        for code in [0x0504_0001, 0x0601_0002, 0x0602_0000, 0x0607_0010, 0x0609_0011] {
            assert!(!Refused::WithAny.fits(code), "{code:08X}");
        }
    }
}
