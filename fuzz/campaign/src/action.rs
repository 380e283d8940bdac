//! What a session does to a device.

use std::sync::Arc;
use std::time::Duration;

use canopen::{Frame, Value};
use serde::{Deserialize, Serialize};

/// Something that a session does: frames, and what it waits for after them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Action {
    /// What it is, for people and for the count of goals.
    pub does: Kind,
    /// The frames, as candump writes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "frames")]
    pub frames: Vec<Frame>,
    /// What is set on the bench, after the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bench: Option<Stimulus>,
    /// What follows.
    pub then: Then,
}

impl Action {
    /// Frames, and what follows.
    pub const fn new(does: Kind, frames: Vec<Frame>, then: Then) -> Self {
        Self { does, frames, bench: None, then }
    }

    /// What it does, in words: a line for each frame, where there are not too many.
    pub fn words(&self) -> Vec<String> {
        /// What is more is a transfer of many segments, or a flood.
        const MOST: usize = 8;
        let frames = self.frames.iter().take(MOST);
        let mut lines: Vec<String> =
            frames.map(|frame| format!("{frame}  {}", canopen::meaning(frame))).collect();
        match self.frames.len() {
            more @ MOST.. if more > MOST => lines.push(format!("and {} more frames", more - MOST)),
            _ => {}
        }
        lines.extend(self.bench.iter().map(|Stimulus { name, value }| format!("{name} = {value}")));
        match self.then {
            Then::Wait(micros) if lines.is_empty() => {
                lines.push(format!("{} {:?}", self.does.word(), Duration::from_micros(micros)));
            }
            Then::Answers { .. } if lines.is_empty() => lines.push(self.does.word()),
            _ => {}
        }
        lines
    }
}

impl Kind {
    /// Whether only an exploration does it.
    pub const fn is_of_explorations(self) -> bool {
        matches!(self, Self::Stimulate | Self::Look | Self::LookAtAll)
    }
}

/// A stimulus of the bench.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Stimulus {
    /// Its name.
    pub name: Arc<str>,
    /// A number, or a word.
    pub value: Arc<str>,
}

impl Stimulus {
    /// The value as a bench takes it.
    pub fn level(&self) -> Value {
        let whole = self.value.parse().map(Value::Int);
        let number = whole.or_else(|_| self.value.parse().map(Value::Real));
        number.unwrap_or_else(|_| Value::Text(self.value.as_ref().to_owned()))
    }
}

/// What a session waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Then {
    /// So many frames with an identifier, as long as they take.
    Answers {
        /// The identifier.
        id: u16,
        /// How many.
        count: u16,
    },
    /// The end of so many microseconds; with 0, the next action follows at once.
    Wait(u64),
}

impl Then {
    /// One frame with an identifier.
    pub const fn answer(id: u16) -> Self {
        Self::Answers { id, count: 1 }
    }

    /// The end of a time.
    pub const fn after(time: Duration) -> Self {
        Self::Wait(time.as_micros() as u64)
    }
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// What an action is.
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
        )]
        #[serde(rename_all = "kebab-case")]
        pub enum Kind { $($(#[$doc])* $name,)* }

        impl Kind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// The word in files.
            pub fn word(self) -> String {
                let name = match self { $(Self::$name => stringify!($name),)* };
                let mut word = String::new();
                for letter in name.chars() {
                    if letter.is_uppercase() && !word.is_empty() {
                        word.push('-');
                    }
                    word.push(letter.to_ascii_lowercase());
                }
                word
            }
        }
    };
}

kinds! {
    /// Time passes.
    Wait,
    /// The supply is switched off and on.
    PowerCycle,
    /// An NMT command that changes the state.
    NmtState,
    /// NMT reset node or reset communication.
    NmtReset,
    /// An NMT command for another node.
    NmtForAnother,
    /// An NMT command of another length, with another specifier or with a 29-bit identifier.
    NmtWrong,
    /// An upload is initiated.
    Upload,
    /// An upload of an object that does not exist, or cannot be read.
    UploadOfNothing,
    /// A download of up to four bytes.
    Download,
    /// The same without a size.
    DownloadUnsized,
    /// A download of another length than that of the object.
    DownloadLength,
    /// A download beyond the limits of the object.
    DownloadRange,
    /// A download to what does not exist, or cannot be written.
    DownloadRefused,
    /// A segmented download is initiated.
    DownloadInSegments,
    /// The next segment of a download.
    DownloadSegment,
    /// A segment of a download with a wrong toggle bit, too long or too short.
    DownloadSegmentWrong,
    /// The next segment of an upload is requested.
    UploadSegment,
    /// The same with a wrong toggle bit.
    UploadSegmentWrong,
    /// A block download is initiated.
    BlockDownload,
    /// Segments of a sub-block.
    BlockSegments,
    /// Segments of which one is lost, repeated or has a wrong number.
    BlockSegmentsWrong,
    /// A block download is ended.
    BlockEnd,
    /// The same with a wrong checksum or a wrong number of bytes.
    BlockEndWrong,
    /// A block upload is initiated.
    BlockUpload,
    /// A block upload is started.
    BlockStart,
    /// A sub-block is confirmed.
    BlockAck,
    /// A part of a sub-block is confirmed, or more than was sent.
    BlockAckWrong,
    /// The end of a block upload is confirmed.
    BlockUploadEnd,
    /// The client aborts.
    Abort,
    /// A request with an unknown command, with reserved bits, or of another length or format.
    SdoWrong,
    /// A request to another node.
    SdoForAnother,
    /// A request to a further server.
    FurtherServer,
    /// The parameters are stored.
    Store,
    /// The defaults are restored.
    Restore,
    /// A parameter of the heartbeat of the device, or of its supervision of others.
    ConfigureErrorControl,
    /// A communication parameter of a PDO.
    ConfigurePdo,
    /// A mapping of a PDO.
    ConfigureMapping,
    /// A parameter of SYNC or TIME.
    ConfigureSync,
    /// A parameter of emergency messages or of the reaction to errors.
    ConfigureErrors,
    /// The identifiers of an SDO channel.
    ConfigureChannel,
    /// An RPDO of the mapped length.
    Rpdo,
    /// An RPDO of another length or format.
    RpdoWrong,
    /// A TPDO is requested.
    TpdoRequest,
    /// SYNC.
    Sync,
    /// SYNC of a wrong length or format.
    SyncWrong,
    /// A time stamp.
    Time,
    /// A time stamp of a wrong length or format, or with reserved bits.
    TimeWrong,
    /// The heartbeat of another node.
    Heartbeat,
    /// What looks like a heartbeat and is none.
    HeartbeatWrong,
    /// The guarding request of the device.
    Guarding,
    /// The guarding request of another node, or one in another format.
    GuardingWrong,
    /// The emergency message of another node.
    Emergency,
    /// LSS switch state.
    LssSwitch,
    /// LSS inquiries.
    LssInquire,
    /// LSS identification and fastscan.
    LssIdentify,
    /// LSS configuration of node id and bit timing.
    LssConfigure,
    /// The LSS configuration is stored.
    LssStore,
    /// An LSS message of another length, format or command.
    LssWrong,
    /// A frame with an identifier of nobody, or with one that the device no longer has.
    Stranger,
    /// A stimulus of the bench.
    Stimulate,
    /// A look at objects and at the bench.
    Look,
    /// A look at everything.
    LookAtAll,
}

mod frames {
    use canopen::Frame;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(all: &[Frame], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(all.iter().map(Frame::to_string))
    }

    pub(super) fn deserialize<'d, D: Deserializer<'d>>(from: D) -> Result<Vec<Frame>, D::Error> {
        let texts = Vec::<String>::deserialize(from)?;
        let frame = |text: String| {
            text.parse().map_err(|_| D::Error::custom(format!("`{text}` is not a frame")))
        };
        texts.into_iter().map(frame).collect()
    }
}
