//! Changes as data.

use std::borrow::Cow;
use std::marker::PhantomData;

use canopen::Mux;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use super::patch::Patch;
use super::profile::ProfilePatch;
use super::settings::SettingsPatch;
use super::sheet::SheetPatch;

/// A mistake in a change: the keys that lead to it, and the reason.
#[derive(Debug, PartialEq)]
pub(super) struct Misfit {
    /// Below the change, such as `frame` and `when`; an item of a list by its number.
    pub path: Vec<String>,
    /// The byte within the text that stands there.
    pub offset: usize,
    /// What is wrong.
    pub message: String,
}

impl Misfit {
    /// Something wrong at these keys.
    pub(super) fn at(path: &[&str], message: impl Into<String>) -> Self {
        let path = path.iter().map(|&key| key.to_owned()).collect();
        Self { path, offset: 0, message: message.into() }
    }

    /// The same, below these keys.
    pub(super) fn below(mut self, keys: &[&str]) -> Self {
        self.path.splice(0..0, keys.iter().map(|&key| key.to_owned()));
        self
    }
}

/// Where the deviation sits.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(transform = decision_in_one)]
pub(crate) enum Change {
    /// In a decision of the stack or of the application, which always has the same result.
    Decision(DecisionChange),
    /// Between the device and the wire.
    Frame(FrameChange),
    /// In the dictionary, after the data sheet was made.
    Dictionary(Patch),
    /// In the dictionary and in the data sheet alike: another device, described as it is.
    Object(Patch),
    /// In what the device takes from its profiles, where the catalogue has decided what a document
    /// leaves open: another device, described as it is.
    Profile(ProfilePatch),
    /// In a decision of the stack.
    Rule(String),
    /// In what the device is and a data sheet does not state.
    Settings(SettingsPatch),
    /// In a decision of the device's application.
    Behaviour(String),
    /// In the application, which does not obey the object at this address: the network writes and
    /// reads it as usual, and the application goes on with its default.
    Ignores(Mux),
    /// In the data sheet, while the device is in order.
    Eds(Vec<SheetPatch>),
}

impl Change {
    /// The kinds, as they are written.
    pub(super) const KINDS: [&'static str; 10] = [
        "decision",
        "frame",
        "dictionary",
        "object",
        "profile",
        "rule",
        "settings",
        "behaviour",
        "ignores",
        "eds",
    ];

    /// Whether one of the two may take back what the other changes of the data of the device.
    pub(super) fn collides_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Dictionary(one) | Self::Object(one), Self::Dictionary(other))
            | (Self::Dictionary(one) | Self::Object(one), Self::Object(other)) => {
                one.index() == other.index()
            }
            (Self::Ignores(one), Self::Ignores(other)) => one.index == other.index,
            (Self::Settings(one), Self::Settings(other)) => one.collides_with(other),
            (Self::Profile(_), Self::Profile(_)) => true,
            (Self::Eds(one), Self::Eds(other)) => {
                one.iter().any(|one| other.iter().any(|other| one.section() == other.section()))
            }
            _ => false,
        }
    }
}

/// A decision that always has the same result, as it is read: `{ decision: NAME, is: VALUE }` with
/// both keys below `decision`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(inline)]
pub(crate) struct DecisionChange {
    /// The decision of the stack or of the application.
    pub decision: String,
    /// Its result: `true` or `false`, a number, a code such as 0x06090030, a word.
    #[schemars(with = "Scalar")]
    pub is: String,
}

/// A decision in the schema, as it is written: with both keys where the kind stands otherwise.
fn decision_in_one(schema: &mut Schema) {
    let kinds = schema.get_mut("oneOf").and_then(|kinds| kinds.as_array_mut());
    let first = kinds.and_then(|kinds| kinds.first_mut()).and_then(|kind| kind.as_object_mut());
    let Some(decision) = first else { return };
    let scalar = Scalar::json_schema(&mut SchemaGenerator::default());
    let written = json_schema!({
        "required": ["decision", "is"],
        "properties": { "decision": { "description": "Its name.", "type": "string" }, "is": scalar }
    });
    decision.extend(written.as_object().cloned().unwrap_or_default());
}

/// What happens to frames that fit a pattern. Exactly one of `edit`, `drop`, `repeat`, `delay`,
/// `answer`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct FrameChange {
    /// Which frames the device sends.
    pub when: String,
    /// Frames it receives instead.
    #[serde(default)]
    pub received: bool,
    /// What they become.
    #[serde(default)]
    pub edit: Option<String>,
    /// They are lost.
    #[serde(default)]
    pub drop: bool,
    /// They come so many times more.
    #[serde(default)]
    pub repeat: Option<u32>,
    /// They come so much later, such as `20 ms`.
    #[serde(default)]
    pub delay: Option<String>,
    /// What the device receives while such a frame is delayed, and loses; only with `delay`.
    #[serde(default)]
    pub deaf: Option<String>,
    /// The device sends this instead of taking them; only frames that are received.
    #[serde(default)]
    pub answer: Option<String>,
    /// The first so many since power-on are left alone. What a run reads before its first case
    /// counts as well: `harness qualify --why MUTANT` names them.
    #[serde(default)]
    pub skip: u32,
    /// At most so many are changed.
    #[serde(default)]
    pub most: Option<u32>,
}

impl FrameChange {
    /// Whether it depends on how many frames there were before.
    pub(super) const fn counts(&self) -> bool {
        self.skip > 0 || self.most.is_some()
    }
}

/// Devices and variants, by their names.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(transparent)]
pub struct On(Vec<String>);

impl On {
    /// The names; none stands for the device itself.
    pub fn names(&self) -> &[String] {
        &self.0
    }
}

/// What is different in an entry as it is written, by its kind.
#[derive(JsonSchema)]
#[schemars(rename_all = "kebab-case")]
#[expect(dead_code, reason = "the schema is made of it")]
pub(crate) struct WrittenChange {
    /// In a decision of the stack or of the application, which always has the same result.
    decision: Option<String>,
    /// That result.
    is: Option<Scalar>,
    /// Between the device and the wire.
    frame: Option<FrameChange>,
    /// In the dictionary, after the data sheet was made.
    dictionary: Option<Patch>,
    /// In the dictionary and in the data sheet alike: another device, described as it is.
    object: Option<Patch>,
    /// In what the device takes from its profiles, where the catalogue has decided what a document
    /// leaves open: another device, described as it is.
    profile: Option<ProfilePatch>,
    /// In a decision of the stack.
    rule: Option<String>,
    /// In what the device is and a data sheet does not state.
    settings: Option<SettingsPatch>,
    /// In a decision of the device's application.
    behaviour: Option<String>,
    /// In the application, which does not obey the object at this address.
    ignores: Option<Mux>,
    /// In the data sheet, while the device is in order.
    eds: Option<Vec<SheetPatch>>,
}

/// `true` or `false`, a number or a word.
pub(crate) struct Scalar;

impl JsonSchema for Scalar {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Scalar".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Its result: `true` or `false`, a number, a code, a word.",
            "type": ["boolean", "number", "string"]
        })
    }
}

/// A text, or a list of them.
pub(crate) struct OneOrMore;

impl JsonSchema for OneOrMore {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "OneOrMore".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["string", "array"], "items": { "type": "string" } })
    }
}

/// A text, a list of them, or a map from each to texts.
pub(crate) struct OnEach;

impl JsonSchema for OnEach {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "OnEach".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let texts = OneOrMore::json_schema(generator);
        json_schema!({
            "type": ["string", "array", "object"],
            "items": { "type": "string" },
            "additionalProperties": texts
        })
    }
}

/// An entry as it is written: one, of which the first key may be its name, with the sentence; or a
/// table of several.
pub(crate) struct Written<T>(PhantomData<T>);

impl<T: JsonSchema> JsonSchema for Written<T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<T>();
        json_schema!({ "anyOf": [one, {
            "description": "A table: `$column` is the value of the row.",
            "type": "object",
            "required": ["for", "rows"],
            "properties": {
                "for": {
                    "description": "The columns.",
                    "type": "array",
                    "items": { "type": "string" }
                },
                "rows": { "description": "A list of values for each entry.", "type": "array" }
            }
        }] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_change_is_known() {
        let schema = schemars::schema_for!(Change).to_value();
        let kinds = schema["oneOf"].as_array().unwrap().iter();
        let kinds = kinds.map(|kind| kind["required"][0].as_str().unwrap());
        assert_eq!(kinds.collect::<Vec<_>>(), Change::KINDS);
    }
}
