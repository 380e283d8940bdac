//! The form of `canopen` values in the journal.

use std::str::FromStr;

use canopen::{Frame, Instant, Stamped};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A frame in candump form.
struct Candump(Frame);

impl Serialize for Candump {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&self.0)
    }
}

impl<'de> Deserialize<'de> for Candump {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        Frame::from_str(&text).map(Self).map_err(D::Error::custom)
    }
}

/// A point in time as whole nanoseconds.
pub(crate) mod nanoseconds {
    use super::{Deserialize, Deserializer, Instant, Serializer};

    pub(crate) fn serialize<S: Serializer>(at: &Instant, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(at.0)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Instant, D::Error> {
        u64::deserialize(from).map(Instant)
    }
}

/// A frame in candump form, or null.
pub(crate) mod optional_frame {
    use super::{Candump, Deserialize, Deserializer, Frame, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        frame: &Option<Frame>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        frame.map(Candump).serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<Frame>, D::Error> {
        Ok(Option::<Candump>::deserialize(from)?.map(|candump| candump.0))
    }
}

/// A frame with its time stamp.
pub(crate) mod stamped {
    use super::{Candump, Deserialize, Deserializer, Serialize, Serializer, Stamped, nanoseconds};
    use canopen::Instant;

    #[derive(Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Line {
        #[serde(with = "nanoseconds")]
        at: Instant,
        own: bool,
        frame: Candump,
    }

    pub(crate) fn serialize<S: Serializer>(seen: &Stamped, to: S) -> Result<S::Ok, S::Error> {
        Line { at: seen.at, own: seen.own, frame: Candump(seen.frame) }.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Stamped, D::Error> {
        let Line { at, own, frame } = Line::deserialize(from)?;
        Ok(Stamped { at, frame: frame.0, own })
    }
}
