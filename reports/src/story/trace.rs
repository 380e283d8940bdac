//! The frames of a case until its problem, each with its meaning, and in groups that belong
//! together: a transfer is a group, and a question that is asked again is one of many times.

use std::collections::BTreeMap;

use canopen::decoder::Seen;
use canopen::sdo::block::BlockRequest;
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Data, Decoder, Id, Instant, Mux, Stamped, heartbeat};

/// The frames until an instant.
pub(super) struct Trace<'c> {
    /// By time.
    pub frames: &'c [Stamped],
    /// Their meanings.
    pub seen: Vec<Seen>,
    /// By the time of their last frame.
    pub groups: Vec<Group>,
}

/// Frames that belong together.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Group {
    /// Their places in the trace.
    pub frames: Vec<usize>,
    /// Their kind.
    pub kind: Kind,
    /// How many groups with the same frames came directly before.
    pub again: usize,
}

/// What a group is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Before the first step.
    Settling,
    /// A transfer by SDO that was not about one object, or did not come to its end.
    Transfer,
    /// A value that was read.
    Read(Mux),
    /// A value that the device has taken.
    Written(Mux),
    /// An emergency message.
    Emergency,
    /// A process data object of the device with the data that it had before.
    SamePdo,
    /// One with other data.
    NewPdo,
    /// A heartbeat with the state that was known.
    SameState,
    /// SYNC or TIME.
    Clock,
    /// Anything else: NMT, LSS, boot-up, a new state, a frame of the tester.
    Other,
}

impl Kind {
    /// Whether a device or a tester sends it again and again, and it says nothing new.
    pub(super) const fn is_cyclic(self) -> bool {
        matches!(self, Self::SamePdo | Self::SameState | Self::Clock)
    }

    /// The noun for that many.
    pub(super) fn counted(self, count: usize) -> String {
        let many = if count == 1 { "" } else { "s" };
        match self {
            Self::Settling => format!("{count} frame{many} before the first step"),
            Self::Transfer | Self::Read(_) | Self::Written(_) => {
                format!("{count} SDO transfer{many}")
            }
            Self::Emergency => format!("{count} EMCY"),
            Self::SamePdo => format!("{count} TPDO{many} unchanged"),
            Self::NewPdo => format!("{count} TPDO{many} changed"),
            Self::SameState => format!("{count} heartbeat{many}"),
            Self::Clock => format!("{count} SYNC or TIME"),
            Self::Other => format!("{count} other frame{many}"),
        }
    }
}

impl<'c> Trace<'c> {
    /// The frames until `until`. Those before `first_step` settled the device.
    pub(super) fn read(
        trace: &'c [Stamped],
        node: u8,
        decoder: &mut Decoder,
        (first_step, until): (Instant, Instant),
    ) -> Self {
        let frames = &trace[..trace.partition_point(|seen| seen.at <= until)];
        let seen: Vec<Seen> = frames.iter().map(|seen| decoder.read(&seen.frame)).collect();
        let mut grouping = Grouping { node, ..Grouping::default() };
        for (place, (stamped, seen)) in frames.iter().zip(&seen).enumerate() {
            grouping.take(place, stamped, seen);
        }
        let mut groups = grouping.groups;
        for group in &mut groups {
            if frames[group.frames[0]].at < first_step && group.kind != Kind::Emergency {
                group.kind = Kind::Settling;
            }
        }
        groups.sort_by_key(|group| group.frames.last().copied());
        Self { frames, seen, groups: folded(frames, groups) }
    }

    /// The last frame of a group.
    pub(super) fn end(&self, group: &Group) -> Instant {
        group.frames.last().map_or(Instant::ZERO, |place| self.frames[*place].at)
    }
}

/// Puts frames into groups.
#[derive(Default)]
struct Grouping {
    node: u8,
    groups: Vec<Group>,
    /// The place of the transfer that is under way.
    open: Option<usize>,
    /// The data that each identifier had last.
    last: BTreeMap<Id, Data>,
}

impl Grouping {
    fn take(&mut self, place: usize, stamped: &Stamped, seen: &Seen) {
        let frame = &stamped.frame;
        let id = frame.data_id().unwrap_or_default();
        let (request, response) =
            (REQUEST_COB_ID + u16::from(self.node), RESPONSE_COB_ID + u16::from(self.node));
        let kind = match id {
            _ if id == request || id == response => {
                return self.transfer(place, stamped, seen);
            }
            0x080 | 0x100 => Kind::Clock,
            0x081..=0x0FF => Kind::Emergency,
            _ if stamped.own => Kind::Other,
            _ => {
                let same = self.last.insert(frame.id, frame.data) == Some(frame.data);
                let beats = (heartbeat::COB_ID + 1..=heartbeat::COB_ID + 0x7F).contains(&id);
                match (seen.pdo.is_some() || (0x180..0x580).contains(&id), beats, same) {
                    (true, _, true) => Kind::SamePdo,
                    (true, _, false) => Kind::NewPdo,
                    // A boot-up message says something each time.
                    (_, true, true) if *frame.data != [0] => Kind::SameState,
                    _ => Kind::Other,
                }
            }
        };
        self.groups.push(Group { frames: vec![place], kind, again: 0 });
    }

    fn transfer(&mut self, place: usize, stamped: &Stamped, seen: &Seen) {
        let begins = matches!(
            Request::decode(&stamped.frame.data),
            Ok(Request::Upload(_)
                | Request::Download(..)
                | Request::Block(BlockRequest::Upload { .. } | BlockRequest::Download { .. }))
        );
        let open = self.open.filter(|_| !(stamped.own && begins));
        let open = open.unwrap_or_else(|| {
            self.groups.push(Group { frames: Vec::new(), kind: Kind::Transfer, again: 0 });
            self.groups.len() - 1
        });
        self.open = Some(open);
        let group = &mut self.groups[open];
        group.frames.push(place);
        if let Some(given) = &seen.given {
            group.kind = match given.written {
                true => Kind::Written(given.mux),
                false => Kind::Read(given.mux),
            };
        }
    }
}

/// Of groups with the same frames one after the other, the last. What comes by itself in between
/// does not count.
fn folded(trace: &[Stamped], groups: Vec<Group>) -> Vec<Group> {
    let same = |one: &Group, other: &Group| {
        let content = |group: &Group| -> Vec<_> {
            group.frames.iter().map(|place| (trace[*place].own, trace[*place].frame)).collect()
        };
        one.kind == other.kind && content(one) == content(other)
    };
    let mut folded: Vec<Group> = Vec::new();
    for group in groups {
        let before = match group.kind.is_cyclic() {
            true => None,
            false => folded.iter().rposition(|before| !before.kind.is_cyclic()),
        };
        match before.filter(|before| same(&folded[*before], &group)) {
            Some(before) => {
                let again = folded.remove(before).again + 1;
                folded.push(Group { again, ..group });
            }
            None => folded.push(group),
        }
    }
    folded
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(at: u64, text: &str) -> Stamped {
        let (own, text) = text.strip_prefix('>').map_or((false, text), |text| (true, text));
        Stamped { at: Instant(at), frame: text.parse().expect("a frame"), own }
    }

    fn groups(frames: &[&str]) -> Vec<(Kind, usize, usize)> {
        let trace: Vec<Stamped> = (0..).zip(frames).map(|(at, text)| seen(at, text)).collect();
        let mut decoder = Decoder::default();
        let trace = Trace::read(&trace, 5, &mut decoder, (Instant::ZERO, Instant::NEVER));
        let groups = trace.groups.iter();
        groups.map(|group| (group.kind, group.frames.len(), group.again)).collect()
    }

    #[test]
    fn a_question_that_is_asked_again_and_again_takes_one_place() {
        let mut frames = vec![">605#2F01200101000000", "585#6001200100000000"];
        for _ in 0..100 {
            frames.extend([">605#4002200100000000", "705#05", "585#4F02200100000000"]);
        }
        let mut groups = groups(&frames);
        groups.retain(|(kind, ..)| !kind.is_cyclic());
        let [first, second] = [Mux::new(0x2001, 1), Mux::new(0x2002, 1)];
        let other = (Kind::Other, 1, 0);
        assert_eq!(groups, [(Kind::Written(first), 2, 0), other, (Kind::Read(second), 2, 99)]);
    }

    #[test]
    fn what_comes_by_itself_is_told_from_services() {
        for (text, kind) in [
            ("705#05", Kind::SameState),
            ("705#00", Kind::Other),
            ("185#0102", Kind::SamePdo),
            (">205#0102", Kind::Other),
            (">080#", Kind::Clock),
            ("085#0010010000000000", Kind::Emergency),
            ("585#6017100000000000", Kind::Transfer),
            (">7E5#0401000000000000", Kind::Other),
            (">000#0105", Kind::Other),
        ] {
            let (last, ..) = groups(&[text, ">000#8005", text]).pop().expect("a group");
            assert_eq!(last, kind, "{text}");
        }
    }
}
