//! What the tester did, at other moments for another replica: what a device does with something
//! depends on where in its cycle it gets it, and that is known of the model only.

use std::time::Duration;

use canopen::sdo::{REQUEST_COB_ID, Request};
use canopen::{Id, Instant};
use reference_devices::change::Replica;

use super::lane::{GRACE, Lane};
use crate::oracle::{Seen, error_control, is_reset};

/// By how many nanoseconds what the tester did comes later for a replica.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    /// Power-on and resets: the control cycle begins with them.
    starts: i64,
    /// Every other frame or stimulus, and those between them.
    rest: [i64; 2],
    /// By how many nanoseconds the clock of the replica is ahead.
    clock: i64,
}

impl Shift {
    pub(super) const NONE: Self = Self { starts: 0, rest: [0; 2], clock: 0 };

    /// All of it comes later.
    const fn all(millis: i64) -> Self {
        let by = millis * MILLISECOND;
        Self { starts: by, rest: [by; 2], ..Self::NONE }
    }

    /// One half comes earlier, and the other half later.
    const fn apart(millis: i64) -> Self {
        let by = millis * MILLISECOND;
        Self { rest: [-by, by], ..Self::NONE }
    }

    /// The cycle that begins with a start began earlier.
    const fn began(millis: i64) -> Self {
        Self { starts: -millis * MILLISECOND, ..Self::NONE }
    }

    /// The cycle that goes on by the clock of the device is ahead.
    const fn clock(millis: i64) -> Self {
        Self { clock: millis * MILLISECOND, ..Self::NONE }
    }
}

/// A control cycle: what a device does within it, before or after it notices, nobody knows.
pub(in crate::explore) const CYCLE: Duration = Duration::from_millis(100);
const CYCLES: i64 = CYCLE.as_millis() as i64;
const MILLISECOND: i64 = 1_000_000;
pub(super) const SHIFTS: [Shift; 2] = [Shift::all(-CYCLES), Shift::all(CYCLES)];
/// The same for a device in a time of its own: what blinks changes within a cycle, what it gets may
/// come at another moment of its cycle, and a moment before or after what it does by itself. The
/// clocks of 200 to 800 ms are for intervals of a second. The steps were found by trial, with
/// devices that go on for 1500 sessions.
pub(super) const SHIFTS_ON_BUS: [Shift; 19] = [
    Shift::all(-CYCLES),
    Shift::all(CYCLES),
    Shift::all(-50),
    Shift::all(50),
    Shift::apart(6),
    Shift::apart(-6),
    Shift::began(8),
    Shift::began(25),
    Shift::began(50),
    Shift::began(75),
    Shift::clock(12),
    Shift::clock(25),
    Shift::clock(50),
    Shift::clock(75),
    Shift::clock(88),
    Shift::clock(200),
    Shift::clock(400),
    Shift::clock(600),
    Shift::clock(800),
];

/// A replica for which what the tester did came at other times.
pub(super) struct Shifted {
    pub(super) lane: Lane,
    /// The times, and the places of what came.
    events: Vec<(Instant, usize)>,
    next: usize,
}

impl Shifted {
    pub(super) fn new(seen: &[Seen], model: Box<dyn Replica>, node: u8, by: Shift) -> Self {
        Self { lane: Lane::new(model, node, by.clock), events: shifted(seen, by, node), next: 0 }
    }

    /// Takes what comes by the time of what was seen at this place.
    pub(super) fn follow(&mut self, seen: &[Seen], place: usize, to: Instant) {
        while let Some((at, what)) = self.events.get(self.next).copied() {
            let is_read = is_read(&seen[what]);
            if at > to || is_read && what > place {
                break;
            }
            if is_read {
                while self.lane.answer().is_some() {}
            }
            self.lane.give(at, &seen[what]);
            self.next += 1;
        }
    }
}

/// What the tester did, at other times: nothing passes a look, and what waited for a boot-up
/// message comes after it.
fn shifted(seen: &[Seen], by: Shift, node: u8) -> Vec<(Instant, usize)> {
    let later = |at: Instant, by: i64| Instant(at.0.saturating_add_signed(by));
    let is_look = |what: &Seen| is_read(what) || matches!(what, Seen::Observed(..));
    let mut events: Vec<(Instant, usize)> = Vec::new();
    let (mut last, mut started, mut booted) = (Instant::ZERO, false, None);
    for (place, what) in seen.iter().enumerate() {
        if is_boot_up(what, node) {
            // The first one is at the same time for each replica if nobody switched it on.
            let at = later(what.at(), if started { by.starts } else { 0 });
            last = last.max(at);
            booted = Some((what.at(), at));
        }
        // A replica that boots a moment later than the device takes nothing by then.
        if is_own(what)
            && let Some((of_device, at)) = booted.take()
        {
            last = last.max(at + what.at().since(of_device).min(GRACE));
        }
        if is_look(what) {
            last = last.max(what.at());
        }
        if is_own(what) {
            let at = if is_read(what) {
                what.at()
            } else {
                let is_start = starts(what, node);
                started |= is_start;
                let by = if is_start { by.starts } else { by.rest[events.len() % 2] };
                later(what.at(), by).max(last)
            };
            last = last.max(at);
            events.push((at, place));
        }
    }
    // What came later than a look that follows comes just before it.
    let mut next = Instant(u64::MAX);
    let mut places = events.len();
    for (place, what) in seen.iter().enumerate().rev() {
        if is_look(what) {
            next = what.at();
        }
        while places > 0 && events[places - 1].1 >= place {
            let (at, of) = events[places - 1];
            let limit = if is_read(&seen[of]) { at } else { Instant(next.0.saturating_sub(1)) };
            events[places - 1].0 = at.min(limit);
            places -= 1;
        }
    }
    events
}

fn is_boot_up(what: &Seen, node: u8) -> bool {
    let id = Id::standard(error_control(node));
    match what {
        Seen::Frame(stamped) => {
            !stamped.own && stamped.frame.id == id && stamped.frame.data.first() == Some(&0)
        }
        _ => false,
    }
}

/// Whether something that the tester did lets the device boot.
fn starts(what: &Seen, node: u8) -> bool {
    match what {
        Seen::Frame(stamped) => is_reset(&stamped.frame, node),
        Seen::Power(..) => true,
        _ => false,
    }
}

/// Whether the tester did it.
const fn is_own(what: &Seen) -> bool {
    match what {
        Seen::Frame(stamped) => stamped.own,
        Seen::Power(..) | Seen::Stimulus(..) => true,
        _ => false,
    }
}

/// Whether it is a request that reads.
fn is_read(what: &Seen) -> bool {
    match what {
        Seen::Frame(stamped) if stamped.own => {
            let id = stamped.frame.data_id().unwrap_or(0) & 0x780;
            id == REQUEST_COB_ID
                && matches!(
                    Request::decode(&stamped.frame.data),
                    Ok(Request::Upload(_) | Request::UploadSegment(_))
                )
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use canopen::Stamped;

    use super::*;

    fn seen(micros: u64, own: bool, frame: &str) -> Seen {
        let at = Instant(micros * 1000);
        Seen::Frame(Stamped { at, frame: frame.parse().unwrap(), own })
    }

    /// A replica that boots a moment later would take nothing at the moment of the boot-up message.
    #[test]
    fn what_waited_for_a_boot_up_keeps_its_distance() {
        let all = [seen(1_200_000, false, "701#00"), seen(1_201_000, true, "000#0101")];
        let at = |by| shifted(&all, by, 1)[0].0;
        assert_eq!(at(SHIFTS[0]), Instant(1_201_000_000));
        assert_eq!(at(Shift::apart(6)), Instant(1_201_000_000));
        assert_eq!(at(SHIFTS[1]), Instant(1_301_000_000));
        // What came much later may come earlier, and not too early.
        let late = [all[0].clone(), seen(1_290_000, true, "000#0101")];
        assert_eq!(shifted(&late, SHIFTS[0], 1)[0].0, Instant(1_220_000_000));
        // A boot-up after a reset comes earlier with the reset.
        let reset = [seen(500_000, true, "000#8101"), all[0].clone(), all[1].clone()];
        assert_eq!(shifted(&reset, SHIFTS[0], 1)[1].0, Instant(1_101_000_000));
    }

    /// Only the reset is moved, so that what follows falls elsewhere in the cycle.
    #[test]
    fn a_cycle_that_began_earlier_gets_the_rest_at_its_time() {
        let all = [
            seen(500_000, true, "000#8101"),
            seen(1_200_000, false, "701#00"),
            seen(1_201_000, true, "000#0101"),
        ];
        let times: Vec<_> = shifted(&all, Shift::began(25), 1).iter().map(|it| it.0).collect();
        assert_eq!(times, [Instant(475_000_000), Instant(1_201_000_000)]);
    }
}
