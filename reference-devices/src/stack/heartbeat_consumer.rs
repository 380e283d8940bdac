//! The heartbeat consumer (CiA 301, 7.2.8.3.2.2, object 1016h).

use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::{Abort, Instant, Mux};

use crate::rules::Timer;
use crate::stack::base::Base;
use crate::stack::fault::{Fault, FaultKind};
use crate::stack::heartbeat_producer;

/// Watches the nodes that 1016h names.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeartbeatConsumer {
    watches: Vec<Watch>,
}

#[derive(Clone, Debug)]
struct Watch {
    sub: u8,
    node: u8,
    time: Duration,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// No node or no time is configured.
    Unused,
    /// The first heartbeat starts the watch.
    Waiting,
    /// The next heartbeat comes before this.
    Alive(Instant),
    /// It did not.
    Lost,
}

impl HeartbeatConsumer {
    /// Takes all entries of 1016h.
    pub(crate) fn reset(&mut self, now: Instant, base: &mut Base) {
        let subs = base.od.entries_in(TIMES..=TIMES).iter().map(|entry| entry.mux.sub);
        let subs = subs.filter(|sub| *sub > 0);
        let unused = |sub| Watch { sub, node: 0, time: Duration::ZERO, state: State::Unused };
        self.watches = subs.map(unused).collect();
        for watch in &mut self.watches {
            watch.configure(now, base);
        }
    }

    /// Takes the entry of sub-index `sub`; its watch restarts.
    pub(crate) fn configure(&mut self, now: Instant, sub: u8, base: &mut Base) {
        if let Some(watch) = self.watches.iter_mut().find(|watch| watch.sub == sub) {
            watch.configure(now, base);
        }
    }

    /// The nodes that are there are watched from their next heartbeat on.
    pub(crate) fn begin_anew(&mut self) {
        for watch in &mut self.watches {
            if matches!(watch.state, State::Alive(_)) {
                watch.state = State::Waiting;
            }
        }
    }

    /// A frame on the error control identifier of another node.
    pub(crate) fn handle_frame(&mut self, now: Instant, node: u8, data: &[u8], base: &mut Base) {
        let Ok(report) = ErrorControl::decode(data) else { return };
        if !base.rules.is_heartbeat(report.state) || !watches(base) {
            return;
        }
        for watch in self.watches.iter_mut().filter(|watch| watch.node == node) {
            watch.heard(now, base);
        }
        let there = |watch: &Watch| matches!(watch.state, State::Unused | State::Alive(_));
        if !base.rules.lost_nodes_end_one_by_one() && self.watches.iter().all(there) {
            for watch in &self.watches {
                base.mend(FaultKind::Heartbeat, watch.node.into());
            }
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &mut Base) {
        if !watches(base) {
            for watch in self.watches.iter_mut().filter(|watch| watch.state != State::Unused) {
                watch.state = State::Waiting;
            }
        }
        let mut told = !base.rules.each_lost_node_told()
            && self.watches.iter().any(|watch| watch.state == State::Lost);
        for watch in &mut self.watches {
            let over = |due| base.rules.elapsed(Timer::HeartbeatConsumer, due, now);
            if matches!(watch.state, State::Alive(due) if over(due)) {
                watch.state = State::Lost;
                if told {
                    continue;
                }
                told = !base.rules.each_lost_node_told();
                let fault = Fault::new(FaultKind::Heartbeat, watch.node.into());
                base.raise(fault);
            }
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let deadline = |watch: &Watch| match watch.state {
            State::Alive(due) => Some(due),
            _ => None,
        };
        self.watches.iter().filter_map(deadline).min()
    }
}

/// Whether nodes are watched at present.
fn watches(base: &Base) -> bool {
    let produces = base.od.int(heartbeat_producer::PERIOD).is_some_and(|time| time != 0);
    base.rules.nodes_watched_in(base.state)
        && (produces || base.rules.nodes_watched_without_heartbeat())
}

impl Watch {
    fn configure(&mut self, now: Instant, base: &mut Base) {
        let (node, time) = entry(base.od.int(Mux::new(TIMES, self.sub)).unwrap_or(0) as u32);
        let goes_on = matches!(self.state, State::Alive(_)) && !is_used(node, time);
        if goes_on && !base.rules.unused_entry_ends_watch() {
            return;
        }
        // The loss was about the node and the time of the old entry.
        if self.state == State::Lost && base.rules.end_of_watch_ends_error() {
            base.mend(FaultKind::Heartbeat, self.node.into());
        }
        self.node = node;
        self.time = base.rules.heartbeat_consumer_time(time);
        self.state = if !is_used(node, time) {
            State::Unused
        } else if base.rules.first_heartbeat_starts_watch() {
            State::Waiting
        } else {
            State::Alive(now + self.time)
        };
    }

    fn heard(&mut self, now: Instant, base: &mut Base) {
        match self.state {
            State::Unused => return,
            State::Lost
                if !base.rules.heartbeat_loss_recovers()
                    || !base.rules.heartbeat_return_seen_in(base.state) =>
            {
                return;
            }
            // A restarted watch may have been lost before.
            State::Lost | State::Waiting if base.rules.lost_nodes_end_one_by_one() => {
                base.mend(FaultKind::Heartbeat, self.node.into());
            }
            State::Lost | State::Waiting | State::Alive(_) => {}
        }
        self.state = State::Alive(now + self.time);
    }
}

/// A node may be watched by one entry only (CiA 301, 7.5.2.19).
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    let &[a, b, c, d] = bytes else { return Ok(()) };
    let (node, time) = entry(u32::from_le_bytes([a, b, c, d]));
    if mux.sub == 0 || !is_used(node, time) {
        return Ok(());
    }
    let last = base.od.int(Mux::new(TIMES, 0)).unwrap_or(0) as u8;
    let twice = (1..=last).filter(|sub| *sub != mux.sub).any(|sub| {
        let (other, time) = entry(base.od.int(Mux::new(TIMES, sub)).unwrap_or(0) as u32);
        base.rules.heartbeat_node_taken(other, is_used(other, time), node)
    });
    if twice { Err(Abort::INCOMPATIBLE) } else { Ok(()) }
}

fn entry(word: u32) -> (u8, Duration) {
    ((word >> 16) as u8, Duration::from_millis(u64::from(word & 0xFFFF)))
}

fn is_used(node: u8, time: Duration) -> bool {
    (1..=127).contains(&node) && !time.is_zero()
}

pub(crate) const TIMES: u16 = 0x1016;

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, eds, full, mux, sent};
    use canopen::{Abort, NmtState};

    /// Sub 1 watches node 10 for 100 ms, sub 2 node 11 for 150 ms.
    fn watching(rules: &str) -> Fixture {
        let mut fixture = match rules {
            "" => Fixture::new(&eds(full())),
            rules => Fixture::mutant(&eds(full()), rules),
        };
        fixture.write(mux(0x1016, 1), &[100, 0, 10, 0]).unwrap();
        fixture.write(mux(0x1016, 2), &[150, 0, 11, 0]).unwrap();
        fixture
    }

    #[test]
    fn a_watch_begins_with_the_first_heartbeat_and_ends_in_an_emergency() {
        let mut fixture = watching("");
        assert_eq!(fixture.until(1_000_000), []);
        fixture.send("70A#7F");
        fixture.send("70B#05");
        fixture.run_to(1_090_000);
        fixture.send("70A#7F");
        fixture.send("70B#05");
        assert_eq!(fixture.until(1_200_000), sent(&[(1_190_000, "085#3081110000000000")]));
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0x11]));
        fixture.send("70B#05");
        assert_eq!(fixture.ask("70A#05"), ["085#0000000000000000"]);
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0]));
        assert_eq!(
            fixture.until(2_000_000),
            sent(&[(1_300_000, "085#3081110000000000"), (1_350_000, "085#3081110000000000")])
        );
    }

    #[test]
    fn what_is_no_heartbeat_does_not_count() {
        let mut fixture = watching("");
        for frame in ["70A#00", "70A#", "70A#0505", "70A#03", "70C#05", "70A#R1"] {
            fixture.send(frame);
        }
        assert_eq!(fixture.until(1_000_000), []);
    }

    #[test]
    fn a_node_is_watched_by_one_entry() {
        let mut fixture = watching("");
        let twice = fixture.write(mux(0x1016, 3), &[50, 0, 10, 0]);
        assert_eq!(twice, Err(Abort::INCOMPATIBLE.0));
        for entry in [[100, 0, 10, 0], [0, 0, 10, 0], [100, 0, 10, 0], [50, 0, 200, 0]] {
            assert_eq!(fixture.write(mux(0x1016, 1), &entry), Ok(()), "{entry:?}");
        }
        assert_eq!(fixture.write(mux(0x1016, 3), &[0, 0, 11, 0]), Ok(()));
    }

    #[test]
    fn an_entry_that_is_switched_off_takes_its_error_along() {
        let mut fixture = watching("");
        fixture.send("70A#7F");
        fixture.run_to(500_000);
        fixture.until(500_000);
        fixture.write(mux(0x1016, 1), &[0; 4]).unwrap();
        assert_eq!(fixture.until(500_000), sent(&[(500_000, "085#0000000000000000")]));
    }

    #[test]
    fn loss_leads_to_the_state_of_1029h_from_operational_only() {
        for (reaction, state) in [(0, 127), (1, 5), (2, 4)] {
            let mut fixture = watching("");
            fixture.write(mux(0x1029, 1), &[reaction]).unwrap();
            fixture.send("000#0105");
            fixture.send("70A#7F");
            let told = fixture.until(1_000_000);
            assert_eq!(told.len(), 1, "{told:?}");
            assert_eq!(fixture.node.state(), NmtState(state));
        }
        let mut fixture = watching("");
        fixture.write(mux(0x1029, 1), &[2]).unwrap();
        fixture.send("70A#7F");
        fixture.run_to(1_000_000);
        assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL);
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut fixture = watching("first-heartbeat-starts-watch: false");
        assert_eq!(fixture.until(110_000), sent(&[(101_000, "085#3081110000000000")]));
        let mut fixture = watching("heartbeat-loss-recovers: false");
        fixture.send("70A#7F");
        fixture.run_to(400_000);
        assert!(fixture.ask("70A#7F").is_empty());
        let mut fixture = watching("heartbeat-node-taken: false");
        assert_eq!(fixture.write(mux(0x1016, 3), &[50, 0, 10, 0]), Ok(()));
        let mut fixture = watching("heartbeat-consumer-time-doubled");
        fixture.send("70A#7F");
        assert_eq!(fixture.until(900_000), sent(&[(201_000, "085#3081110000000000")]));
        let mut fixture = watching("error-reaction: none");
        fixture.send("000#0105");
        fixture.send("70A#7F");
        fixture.run_to(900_000);
        assert_eq!(fixture.node.state(), NmtState::OPERATIONAL);
        let mut fixture = watching("nmt-start-ignored-after-error");
        fixture.send("70A#7F");
        fixture.run_to(900_000);
        fixture.send("000#0105");
        assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL);
    }
}
