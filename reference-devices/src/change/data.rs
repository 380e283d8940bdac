//! Changes as data.

use canopen::Mux;
use schemars::JsonSchema;
use serde::Deserialize;

use super::patch::Patch;
use super::profile::ProfilePatch;
use super::settings::SettingsPatch;
use super::sheet::SheetPatch;

/// What is wrong with a change: the keys that lead there, and why.
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
pub(crate) enum Change {
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
    /// The first so many are left alone.
    #[serde(default)]
    pub skip: u32,
    /// At most so many are changed.
    #[serde(default)]
    pub most: Option<u32>,
}
