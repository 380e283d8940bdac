//! The other nodes of the bus that are known by name: what happens to them while the device is
//! tested.
//!
//! They are only listened to. The period of a heartbeat is learnt from the heartbeats, so a node
//! is missed from its second one on. What happens to them is no verdict on the device under test.

use std::fmt;
use std::time::Duration;

use canopen::emcy::{self, Emcy, EmcyCode};
use canopen::heartbeat::{self, ErrorControl};
use canopen::nmt::{self, Command, Service};
use canopen::{Instant, Stamped};

use crate::dut::OtherNode;

/// The other nodes, and what happened to them since it was last said.
#[derive(Clone, Debug, Default)]
pub(super) struct OtherNodes {
    nodes: Vec<Watched>,
    happened: Vec<Happened>,
}

#[derive(Clone, Debug)]
struct Watched {
    known: OtherNode,
    /// When its last heartbeat or boot-up came.
    last: Option<Instant>,
    /// The longest time between two heartbeats, once there were two.
    period: Option<Duration>,
    is_silent: bool,
    /// When the tester sent a reset that reaches it, until it boots.
    reset: Option<Instant>,
    /// The last reset, and how many boot-up messages may still come: one for each reset, and those
    /// of resets in a row may all come after the last of them.
    expected: Option<(Instant, u32)>,
}

/// Something that happened to a node, the first time and how often.
#[derive(Clone, Debug)]
struct Happened {
    node: usize,
    what: What,
    at: Instant,
    times: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// No heartbeat came any more, after one each so often.
    Silent(Duration),
    /// Heartbeats came again.
    Back,
    /// A boot-up message that nobody asked for.
    BootUp,
    /// No boot-up message came after a reset of all nodes.
    StaysAway,
    /// An emergency message with this error and this error register.
    Emergency(EmcyCode, u8),
}

/// Two missing heartbeats are silence: a single one may be lost. A wire that the tester fills makes
/// them late as well.
const MISSING: u32 = 2;
const LATE: Duration = Duration::from_millis(50);
/// Heartbeats that come closer together were held back on the way.
const SHORTEST: Duration = Duration::from_millis(1);
/// How long a node may take to boot.
const BOOTS: Duration = Duration::from_secs(10);

impl OtherNodes {
    pub(super) fn of(nodes: &[OtherNode]) -> Self {
        let watched = |known: &OtherNode| Watched {
            known: known.clone(),
            last: None,
            period: None,
            is_silent: false,
            reset: None,
            expected: None,
        };
        Self { nodes: nodes.iter().map(watched).collect(), happened: Vec::new() }
    }

    /// Takes a frame that was on the bus.
    pub(super) fn see(&mut self, seen: &Stamped) {
        if self.nodes.is_empty() {
            return;
        }
        self.until(seen.at);
        let Some(id) = seen.frame.data_id() else { return };
        for place in 0..self.nodes.len() {
            let node = u16::from(self.nodes[place].known.node);
            if seen.own && id == nmt::COB_ID {
                self.nodes[place].commanded(seen);
            } else if !seen.own && id == heartbeat::COB_ID + node {
                self.heartbeat(place, seen);
            } else if !seen.own
                && id == emcy::COB_ID + node
                && let Ok(message) = Emcy::decode(&seen.frame.data)
            {
                self.note(place, What::Emergency(message.code, message.register), seen.at);
            }
        }
    }

    /// Frames were lost, or may come late since the tester does, so that silence proves nothing
    /// until the next heartbeat.
    pub(super) fn lose(&mut self) {
        self.nodes.iter_mut().for_each(|node| node.last = None);
    }

    /// The tester has given a node another period: what it was is forgotten.
    pub(super) fn forget_period_of(&mut self, node: u8) {
        for watched in self.nodes.iter_mut().filter(|watched| watched.known.node == node) {
            *watched = Watched { last: None, period: None, is_silent: false, ..watched.clone() };
        }
    }

    /// Takes note that nothing more came until `now`.
    fn until(&mut self, now: Instant) {
        for place in 0..self.nodes.len() {
            let node = &mut self.nodes[place];
            let is_expected = !node.is_silent && node.reset.is_none();
            if let (Some(last), Some(period), true) = (node.last, node.period, is_expected)
                && now.since(last) > period * MISSING + LATE
            {
                node.is_silent = true;
                self.note(place, What::Silent(period), last);
            } else if let Some(reset) = node.reset.take_if(|reset| now.since(*reset) > BOOTS) {
                self.note(place, What::StaysAway, reset);
            }
        }
    }

    fn heartbeat(&mut self, place: usize, seen: &Stamped) {
        let node = &mut self.nodes[place];
        if ErrorControl::decode(&seen.frame.data) == Ok(ErrorControl::BOOT_UP) {
            node.reset = None;
            let was_asked_for = node.takes_boot_up(seen.at);
            // It may have another period now.
            *node = Watched { last: None, period: None, is_silent: false, ..node.clone() };
            if !was_asked_for {
                self.note(place, What::BootUp, seen.at);
            }
            return;
        }
        let passed = node.last.replace(seen.at).map(|last| seen.at.since(last));
        if std::mem::take(&mut node.is_silent) {
            self.note(place, What::Back, seen.at);
        } else if let Some(passed) = passed.filter(|passed| *passed >= SHORTEST) {
            node.period = node.period.max(Some(passed));
        }
    }

    fn note(&mut self, node: usize, what: What, at: Instant) {
        match self.happened.iter_mut().find(|it| it.node == node && it.what == what) {
            Some(again) => again.times += 1,
            None => self.happened.push(Happened { node, what, at, times: 1 }),
        }
    }

    /// Returns what happened until `now`, a sentence each, and forgets it.
    pub(super) fn take(&mut self, now: Instant) -> Vec<String> {
        self.until(now);
        let happened = std::mem::take(&mut self.happened);
        happened.iter().map(|it| format!("{}: {it}", self.nodes[it.node].known)).collect()
    }
}

impl Watched {
    /// Takes note of a command of the tester.
    fn commanded(&mut self, seen: &Stamped) {
        let Ok(command) = Command::decode(&seen.frame.data) else { return };
        let resets = [Service::RESET_NODE, Service::RESET_COMMUNICATION];
        if [0, self.known.node].contains(&command.node) && resets.contains(&command.service) {
            (self.last, self.reset) = (None, Some(seen.at));
            let before = self.expected.filter(|(reset, _)| seen.at.since(*reset) <= BOOTS);
            self.expected = Some((seen.at, before.map_or(1, |(_, boots)| boots + 1)));
        }
    }

    /// Whether a boot-up message belongs to a reset, which it then answers.
    fn takes_boot_up(&mut self, at: Instant) -> bool {
        match &mut self.expected {
            Some((reset, boots @ 1..)) if at.since(*reset) <= BOOTS => {
                *boots -= 1;
                true
            }
            _ => false,
        }
    }
}

impl fmt::Display for Happened {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, at, times, .. } = self;
        match what {
            What::Silent(period) => {
                write!(f, "no heartbeat since {at} s, after one each {} ms", period.as_millis())
            }
            What::Back => write!(f, "heartbeats again at {at} s"),
            What::BootUp => write!(f, "boot-up message without a reset at {at} s"),
            What::StaysAway => write!(f, "no boot-up message after the reset at {at} s"),
            What::Emergency(code, register) => {
                write!(f, "emergency message {code}, error register {register:02X}h, at {at} s")
            }
        }?;
        match times {
            1 => Ok(()),
            times => write!(f, " for the first of {times} times"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said after frames at milliseconds, `>` those of the tester.
    fn said(frames: &[(u64, &str)], now: u64) -> Vec<String> {
        let at = |ms: u64| Instant(ms * 1_000_000);
        let mut nodes = OtherNodes::of(&[OtherNode { name: "pump".to_owned(), node: 6 }]);
        for (ms, text) in frames {
            let (own, text) = text.strip_prefix('>').map_or((false, *text), |text| (true, text));
            nodes.see(&Stamped { at: at(*ms), frame: text.parse().unwrap(), own });
        }
        let said = nodes.take(at(now));
        assert!(nodes.take(at(now)).is_empty(), "it is said once");
        said
    }

    #[test]
    fn a_heartbeat_is_missed_from_the_second_one_on() {
        let silent = "pump, node 6: no heartbeat since 0.200000 s, after one each 100 ms";
        assert_eq!(said(&[(100, "706#05"), (200, "706#05")], 450), [""; 0]);
        assert_eq!(said(&[(100, "706#05"), (200, "706#05")], 451), [silent]);
        assert_eq!(said(&[(100, "706#05")], 10_000), [""; 0]);
        assert_eq!(said(&[(100, "705#05"), (200, "705#05")], 10_000), [""; 0]);
        let frames = [(100, "706#05"), (200, "706#05"), (900, "706#05"), (1000, "706#05")];
        let back = "pump, node 6: heartbeats again at 0.900000 s";
        assert_eq!(said(&frames, 1000), [silent, back]);
        // The time of silence is no period.
        let again = format!("{silent} for the first of 2 times");
        assert_eq!(said(&frames, 1300), [&*again, back]);
    }

    #[test]
    fn a_restart_that_was_asked_for_is_expected() {
        let beats = [(100, "706#05"), (200, "706#05")];
        let after = |frames: &[(u64, &str)], now| said(&[&beats, frames].concat(), now);
        for reset in [">000#8100", ">000#8200", ">000#8106"] {
            let boots = [(210, reset), (211, "706#05"), (3000, "706#00")];
            assert_eq!(after(&boots, 9000), [""; 0], "{reset}");
            let away = "pump, node 6: no boot-up message after the reset at 0.210000 s";
            assert_eq!(after(&[(210, reset)], 10_211), [away]);
        }
        let row = [(210, ">000#8100"), (211, ">000#8200"), (220, "706#00"), (230, "706#00")];
        assert_eq!(after(&row, 9000), [""; 0]);
        let restarts = "pump, node 6: boot-up message without a reset at 0.250000 s";
        assert_eq!(after(&[&row[..], &[(250, "706#00")]].concat(), 9000), [restarts]);
        let late = [(210, ">000#8100"), (250, "706#00"), (10_300, "706#00")];
        let restarted = "pump, node 6: boot-up message without a reset at 10.300000 s";
        assert_eq!(after(&late, 10_400), [restarted]);
        for not_a_reset in [">000#8105", ">000#0100", "000#8100"] {
            let frames = [(210, not_a_reset), (250, "706#00")];
            assert_eq!(after(&frames, 9000), [restarts], "{not_a_reset}");
        }
    }

    #[test]
    fn what_comes_again_and_again_is_said_once() {
        let frames = [(1, "086#3081110000000000"), (2, "086#3081110000000000"), (3, "085#00")];
        let emergency = "pump, node 6: emergency message 8130h (life guarding or heartbeat error), \
                         error register 11h, at 0.001000 s for the first of 2 times";
        assert_eq!(said(&frames, 10), [emergency]);
    }

    #[test]
    fn a_node_that_is_given_another_period_is_learnt_anew() {
        let mut nodes = OtherNodes::of(&[OtherNode { name: "pump".to_owned(), node: 6 }]);
        let beat = |nodes: &mut OtherNodes, ms: u64| {
            let (at, frame) = (Instant(ms * 1_000_000), "706#05".parse().unwrap());
            nodes.see(&Stamped { at, frame, own: false });
        };
        [100, 200].into_iter().for_each(|ms| beat(&mut nodes, ms));
        nodes.forget_period_of(6);
        [2000, 4000].into_iter().for_each(|ms| beat(&mut nodes, ms));
        assert!(nodes.take(Instant(6_000_000_000)).is_empty());
    }

    #[test]
    fn silence_proves_nothing_where_frames_were_lost() {
        let mut nodes = OtherNodes::of(&[OtherNode { name: "pump".to_owned(), node: 6 }]);
        for ms in [100, 200] {
            let frame = "706#05".parse().unwrap();
            nodes.see(&Stamped { at: Instant(ms * 1_000_000), frame, own: false });
        }
        nodes.lose();
        assert!(nodes.take(Instant(5_000_000_000)).is_empty());
    }
}
