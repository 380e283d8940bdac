//! The notation of steps, as data. The JSON schema comes from the same types.

use std::collections::BTreeMap;
use std::fmt;

use canopen::nmt::Service;
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::each::Objects;
use super::literal::{Amount, Flow, FrameText, Literal, Mistake, Name, ObjectRef, Tolerance};
use super::profile::About;
use super::refusal::{Refusal, Refused};
use crate::source::At;

/// What may be wanted where a table or a matrix has a name that nothing uses.
pub(crate) const REPEATS: &str = "; to send, ask or expect again without it, `produce`, `sync`, \
                                  `ask` and `measure` have a `count`";

/// One step.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Step {
    /// Sends a frame as it is written.
    Send(Box<At<FrameText>>),
    /// Judges the next frame with that identifier: the answer of a confirmed service.
    Reply(Box<Reply>),
    /// Sends a request and judges its answer, repeated if need be: one exchange after the other,
    /// as a client of a confirmed service does.
    Ask(Box<Ask>),
    /// Waits for a frame.
    Expect(Box<Expect>),
    /// Makes sure that a frame does not come.
    Never(Box<Never>),
    /// Uploads an object and judges the value or the refusal.
    Read(Box<Read>),
    /// Downloads a value and judges the confirmation or the refusal. The runner restores what a
    /// case wrote.
    Write(Box<Write>),
    /// Uploads every entry of the data sheet that fits, and compares it with its default value.
    Defaults(Box<Objects>),
    /// Changes a PDO mapping by the procedure of CiA 301 (invalid, count 0, entries, count, valid).
    Remap(Box<Remap>),
    /// Sends an NMT command to the node.
    Nmt(Nmt),
    /// Lets time pass.
    Wait(At<Amount>),
    /// Uploads an object again and again until it has the value.
    Until(Box<Until>),
    /// Measures the intervals between frames.
    Measure(Box<Measure>),
    /// Counts frames.
    Collect(Box<Collect>),
    /// Sends SYNC messages.
    Sync(Box<SyncStep>),
    /// Sends a frame periodically.
    Produce(Box<Produce>),
    /// Sets stimuli on the physical side, each by its name: `power: off`. The runner sets them
    /// back.
    Bench(Stimuli),
    /// Judges what is to be seen on the physical side.
    Observe(Box<Observe>),
    /// Changes the other node of the bus, `$partner`. The runner sets back what a case changed.
    Partner(PartnerStep),
    /// Judges the data sheet.
    Eds(Box<EdsStep>),
    /// Asks for objects that the data sheet does not have; each must be refused.
    Undeclared(Box<Undeclared>),
    /// Layer setting services that are more than a frame and its answer.
    Lss(Box<LssStep>),
}

impl Step {
    /// Whether the case passes when the device answers in the other way that is allowed, although
    /// nothing was judged before.
    pub(crate) fn is_enough(&self) -> bool {
        match self {
            Self::Write(write) => write.enough,
            Self::Reply(reply) => reply.enough,
            Self::Ask(ask) => ask.enough,
            _ => false,
        }
    }

    /// Whether it begins with an SDO transfer.
    pub(crate) fn transfers_objects(&self) -> bool {
        matches!(
            self,
            Self::Read(_)
                | Self::Write(_)
                | Self::Defaults(_)
                | Self::Remap(_)
                | Self::Until(_)
                | Self::Undeclared(_)
        )
    }
}

/// See [`Step::Partner`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PartnerStep {
    /// How often it sends its heartbeat (1017h): `100 ms`, or `0 ms` for never.
    pub heartbeat: At<Amount>,
}

/// See [`Step::Lss`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum LssStep {
    /// Finds a slave without node id by a fastscan, which leaves it in LSS configuration.
    Fastscan(FastscanStep),
}

/// See [`LssStep::Fastscan`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct FastscanStep {
    /// The vendor-ID to be found.
    pub vendor: At<Literal>,
    /// The product code to be found.
    pub product: At<Literal>,
    /// The revision number to be found.
    pub revision: At<Literal>,
    /// The serial number to be found.
    pub serial: At<Literal>,
    /// How long to wait for the answer to a question that a slave in order does not answer; 10 ms
    /// unless said otherwise.
    #[serde(default)]
    pub slot: Option<At<Amount>>,
}

/// See [`Step::Eds`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct EdsStep {
    /// The findings of `harness eds check` that must not be there, by their names.
    pub without: Box<[At<String>]>,
    /// Findings that do not violate the requirement and make the case LENIENT.
    #[serde(default)]
    pub lenient: Box<[At<String>]>,
}

/// See [`Step::Undeclared`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Undeclared {
    /// Range of indices, such as `1000..1FFF`.
    #[serde(rename = "in")]
    pub range: At<String>,
    /// Not other objects, but other sub-indices of the objects that the data sheet has there.
    #[serde(default)]
    pub subs: bool,
    /// Objects that this profile, such as `em66`, and those it builds on do not have, whatever the
    /// data sheet has; those of the data sheet are asked for first, and all of them.
    #[serde(default)]
    pub profile: Option<At<About>>,
    /// At most so many, spread over the range; `--every-index` asks for all.
    pub most: usize,
}

/// See [`Step::Bench`]: what is set, by name.
// Most steps set one thing, for which a map takes the room of eleven.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(from = "BTreeMap<String, At<Literal>>")]
pub struct Stimuli(
    #[schemars(with = "BTreeMap<String, At<Literal>>")] pub Box<[(String, At<Literal>)]>,
);

impl From<BTreeMap<String, At<Literal>>> for Stimuli {
    fn from(stimuli: BTreeMap<String, At<Literal>>) -> Self {
        Self(stimuli.into_iter().collect())
    }
}

/// See [`Step::Observe`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Observe {
    /// The name of what is observed.
    pub bench: At<String>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<At<Literal>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<At<Literal>>,
    /// How long to go on looking; once unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
}

/// See [`Step::Reply`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Reply {
    /// The answer of a conformant device.
    pub frame: At<FrameText>,
    /// Answers that are accepted, too; the reason is in the register.
    #[serde(default)]
    pub lenient: Box<[At<FrameText>]>,
    /// Answers that a device may give instead; the rest of the steps is then left out.
    #[serde(default)]
    pub or_else: Box<[At<FrameText>]>,
    /// The device may be silent as well; the rest of the steps is then left out.
    #[serde(default)]
    pub or_silence: bool,
    /// Such an answer is all that the case asks for: it passes. Without it, a case that has judged
    /// nothing by then is SKIP.
    #[serde(default)]
    pub enough: bool,
    /// How long to wait; 1 s unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
}

/// See [`Step::Ask`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Ask {
    /// A frame that is sent before each request.
    #[serde(default)]
    pub first: Option<At<FrameText>>,
    /// How long the device gets for the first frame.
    #[serde(default)]
    pub pause: Option<At<Amount>>,
    /// The request.
    pub send: At<FrameText>,
    /// The answer of a conformant device; the next frame with its identifier is judged.
    pub reply: At<FrameText>,
    /// Answers that are accepted, too; the reason is in the register.
    #[serde(default)]
    pub lenient: Box<[At<FrameText>]>,
    /// Answers that a device may give instead; the rest of the steps is then left out.
    #[serde(default)]
    pub or_else: Box<[At<FrameText>]>,
    /// The device may be silent as well; the rest of the steps is then left out.
    #[serde(default)]
    pub or_silence: bool,
    /// Such an answer is all that the case asks for: it passes. Without it, a case that has judged
    /// nothing by then is SKIP.
    #[serde(default)]
    pub enough: bool,
    /// The device may be silent as well, and the steps go on.
    #[serde(default)]
    pub accept_silence: bool,
    /// How long to wait for each answer; 1 s unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
    /// How often to send the request until it is answered; once unless said otherwise.
    #[serde(default)]
    pub tries: Option<usize>,
    /// How many exchanges, one after the other; one unless said otherwise.
    #[serde(default)]
    pub count: Option<usize>,
    /// What the time from a request to its answer must be.
    #[serde(default)]
    pub latency: Option<Bounds>,
}

/// See [`Step::Expect`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Expect {
    /// The frame.
    pub frame: At<FrameText>,
    /// Frames that are accepted, too; the reason is in the register.
    #[serde(default)]
    pub lenient: Box<[At<FrameText>]>,
    /// How long to wait.
    pub within: At<Amount>,
    /// The earliest it may come.
    #[serde(default)]
    pub after: Option<At<Amount>>,
    /// How many bytes of data the frame has.
    #[serde(default)]
    pub length: Option<At<Literal>>,
    /// Silence is accepted, too; the reason is in the register.
    #[serde(default)]
    pub optional: bool,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// See [`Step::Never`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Never {
    /// The frame.
    pub frame: At<FrameText>,
    /// Frames that are accepted nevertheless; the reason is in the register.
    #[serde(default)]
    pub lenient: Box<[At<FrameText>]>,
    /// Frames after which nothing can be judged: the rest of the steps is left out.
    #[serde(default)]
    pub or_else: Box<[At<FrameText>]>,
    /// How long to watch.
    #[serde(rename = "for")]
    pub time: At<Amount>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// What a value must be. All that is given must hold.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Read {
    /// What to read.
    pub object: At<ObjectRef>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Values that are accepted instead of `value`; the reason is in the register.
    #[serde(default)]
    pub tolerated: Box<[At<Literal>]>,
    /// Only these bits are compared with `value`.
    #[serde(default)]
    pub mask: Option<Box<At<Literal>>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<Box<At<Literal>>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<Box<At<Literal>>>,
    /// The length in bytes.
    #[serde(default)]
    pub length: Option<Box<At<Literal>>>,
    /// It is readable ASCII, one character at least and so many at most.
    #[serde(default)]
    pub characters: Option<usize>,
    /// The application may have changed the value itself: with another one the rest of the steps is
    /// left out.
    #[serde(default)]
    pub or_another: bool,
    /// Names the value for later steps.
    #[serde(default)]
    pub save: Option<Box<At<Name>>>,
    /// The device must refuse, with this code.
    #[serde(default)]
    pub refused: Option<Box<At<Refusal>>>,
    /// Abort codes that are accepted instead of a value; the reason is in the register.
    #[serde(default)]
    pub lenient: Box<[Refused]>,
    /// The protocol the device must choose; `block` is what the client asks for, too.
    #[serde(default)]
    pub transfer: Option<Flow>,
    /// Segments of a sub-block, 127 unless said otherwise; makes it a block transfer.
    #[serde(default)]
    pub block_size: Option<Box<At<Literal>>>,
}

/// See [`Step::Write`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Write {
    /// Where to.
    pub object: At<ObjectRef>,
    /// The value, typed by the data sheet.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Bytes instead of a value, for what the data sheet does not allow.
    #[serde(default)]
    pub bytes: Option<Box<At<String>>>,
    /// So many bytes of readable text instead of a value.
    #[serde(default)]
    pub fill: Option<Box<At<Literal>>>,
    /// Names what was written for later steps.
    #[serde(default)]
    pub save: Option<Box<At<Name>>>,
    /// The device must refuse, with this code.
    #[serde(default)]
    pub refused: Option<Box<At<Refusal>>>,
    /// With these codes the device may refuse as well; the rest of the steps is then left out.
    #[serde(default)]
    pub or_refused: Box<[At<Refused>]>,
    /// Such a refusal is all that the case asks for: it passes. Without it, a case that has judged
    /// nothing by then is SKIP.
    #[serde(default)]
    pub enough: bool,
    /// Nothing is written where the data sheet has no such object, or none that can be written.
    #[serde(default)]
    pub if_there: bool,
    /// The protocol; what a client would choose unless said otherwise.
    #[serde(default)]
    pub transfer: Option<Flow>,
    /// What the tester does wrong; makes it a block transfer.
    #[serde(default)]
    pub mistake: Option<Mistake>,
}

/// See [`Step::Remap`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Remap {
    /// Mapping parameter's count, such as `"1A00:00"` or `$count`.
    pub pdo: At<ObjectRef>,
    /// What to map, in order: addresses, or 32-bit mapping entries as they are written.
    pub objects: Box<[At<Literal>]>,
    /// The device must refuse at an entry or at the count, with this code.
    #[serde(default)]
    pub refused: Option<At<Refusal>>,
}

/// NMT commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Nmt {
    /// Start remote node.
    Start,
    /// Stop remote node.
    Stop,
    /// Enter PRE-OPERATIONAL.
    PreOperational,
    /// Reset node.
    ResetNode,
    /// Reset communication.
    ResetCommunication,
}

impl Nmt {
    /// The command specifier.
    pub const fn service(self) -> Service {
        match self {
            Self::Start => Service::START,
            Self::Stop => Service::STOP,
            Self::PreOperational => Service::ENTER_PRE_OPERATIONAL,
            Self::ResetNode => Service::RESET_NODE,
            Self::ResetCommunication => Service::RESET_COMMUNICATION,
        }
    }
}

/// See [`Step::Until`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Until {
    /// What to read.
    pub object: At<ObjectRef>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Values that are accepted instead of `value`; the reason is in the register.
    #[serde(default)]
    pub tolerated: Box<[At<Literal>]>,
    /// Only these bits are compared with `value`.
    #[serde(default)]
    pub mask: Option<Box<At<Literal>>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<Box<At<Literal>>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<Box<At<Literal>>>,
    /// How long to go on.
    pub within: At<Amount>,
    /// Pause between two uploads; 20 ms unless said otherwise.
    #[serde(default)]
    pub every: Option<At<Amount>>,
}

/// See [`Step::Measure`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Measure {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many frames; one interval fewer is measured.
    pub count: usize,
    /// What each interval must be.
    #[serde(default)]
    pub interval: Option<Bounds>,
    /// What the mean interval must be.
    #[serde(default)]
    pub mean: Option<Bounds>,
    /// What the median of the intervals must be: a drift shows in it, a single late frame does not.
    #[serde(default)]
    pub median: Option<Bounds>,
    /// How long after the first frame of `during` the first may come, and so on.
    #[serde(default)]
    pub latency: Option<Bounds>,
    /// How long the first may take; the upper bound of the interval unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// Bounds of a measured time: `100 ms +/- 10 %`, or with what is accepted, too.
#[derive(Debug, JsonSchema)]
#[schemars(with = "OneOrTwoBounds")]
pub struct Bounds {
    /// What a conformant device keeps.
    pub strict: At<Tolerance>,
    /// What is accepted, too.
    pub lenient: Option<At<Tolerance>>,
}

impl<'de> Deserialize<'de> for Bounds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TextOrMap;
        impl<'de> Visitor<'de> for TextOrMap {
            type Value = OneOrTwoBounds;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a bound such as `100 ms +/- 10 %`, or `strict` and `lenient`")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<OneOrTwoBounds, E> {
                text.parse().map(OneOrTwoBounds::One).map_err(E::custom)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<OneOrTwoBounds, A::Error> {
                let map = MapAccessDeserializer::new(map);
                TwoBounds::deserialize(map).map(OneOrTwoBounds::Two)
            }
        }
        struct Either(OneOrTwoBounds);
        impl<'de> Deserialize<'de> for Either {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(TextOrMap).map(Self)
            }
        }
        let At { value: Either(bounds), place } = At::deserialize(deserializer)?;
        Ok(match bounds {
            OneOrTwoBounds::One(strict) => Self { strict: At::new(strict, place), lenient: None },
            OneOrTwoBounds::Two(TwoBounds { strict, lenient }) => Self { strict, lenient },
        })
    }
}

/// How bounds are written.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum OneOrTwoBounds {
    /// What a conformant device keeps; nothing else is accepted.
    One(Tolerance),
    /// What a conformant device keeps, and what is accepted, too.
    Two(TwoBounds),
}

/// See [`Bounds`].
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TwoBounds {
    /// What a conformant device keeps: `100 ms +/- 10 %`, or `>= 100 ms`.
    pub strict: At<Tolerance>,
    /// What is accepted, too.
    #[serde(default)]
    pub lenient: Option<At<Tolerance>>,
}

/// See [`Step::Collect`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Collect {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many must come.
    pub count: At<Literal>,
    /// How long to watch; with `during`, how long to go on watching after it.
    #[serde(rename = "for")]
    pub time: At<Amount>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// See [`Step::Sync`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SyncStep {
    /// How many.
    pub count: usize,
    /// Time from one to the next.
    #[serde(default)]
    pub every: Option<At<Amount>>,
}

/// See [`Step::Produce`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Produce {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many.
    pub count: usize,
    /// Time from one to the next.
    pub every: At<Amount>,
}
