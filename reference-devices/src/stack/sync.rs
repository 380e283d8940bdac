//! The SYNC consumer (CiA 301, 7.2.5, objects 1005h, 1006h, 1007h and 1019h).

use std::time::Duration;

use canopen::pdo::{CobId, is_restricted};
use canopen::sync::Sync;
use canopen::{Abort, Id, Instant, Mux, NmtState};

use crate::rules::Service;
use crate::stack::base::Base;
use crate::stack::fault::{Fault, FaultKind};

/// Receives SYNC, and notices when it does not come.
#[derive(Clone, Debug, Default)]
pub(crate) struct SyncConsumer {
    id: Option<Id>,
    counted: bool,
    longest_gap: Option<Duration>,
    deadline: Option<Instant>,
}

impl SyncConsumer {
    pub(crate) fn reset(&mut self, base: &mut Base) {
        self.deadline = None;
        base.window_end = None;
        self.configure(base);
    }

    /// Takes identifier, period and counter overflow value. Supervision restarts with the next
    /// SYNC.
    pub(crate) fn configure(&mut self, base: &mut Base) {
        self.id = base.od.int(COB_ID).map(|cob| CobId(cob as u32).can_id());
        self.counted = base.od.int(COUNTER_OVERFLOW).is_some_and(|last| last != 0);
        let period = Duration::from_micros(base.od.int(PERIOD).unwrap_or(0).max(0) as u64);
        let supervision = base.settings.sync_supervision.filter(|_| !period.is_zero());
        self.longest_gap = supervision.map(|supervision| {
            let gap = base.rules.sync_period(period).saturating_mul(supervision.percent) / 100;
            round_up(gap, supervision.resolution)
        });
        if self.longest_gap.is_none() || base.rules.new_sync_period_ends_deadline() {
            self.deadline = None;
        }
        if self.longest_gap.is_none() {
            base.mend(FaultKind::SyncTimeout, 0);
        }
    }

    /// The identifier on which SYNC comes.
    pub(crate) fn id(&self) -> Option<Id> {
        self.id
    }

    /// A frame on that identifier. `None` when it is not used.
    pub(crate) fn handle_frame(
        &mut self,
        now: Instant,
        data: &[u8],
        base: &mut Base,
    ) -> Option<Sync> {
        // SYNC belongs to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
        if !matches!(
            base.state_of(Service::Sync),
            NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL
        ) {
            return None;
        }
        let expected = usize::from(self.counted);
        if !base.rules.sync_length_valid(expected, data.len()) {
            let (expected, actual) = (expected as u8, data.len() as u8);
            base.raise(Fault { kind: FaultKind::SyncLength, subject: 0, expected, actual });
            return None;
        }
        if base.rules.sync_length_error_ends() {
            base.mend(FaultKind::SyncLength, 0);
        }
        if base.rules.sync_watched_in(base.state)
            && let Some(gap) = self.longest_gap
        {
            base.mend(FaultKind::SyncTimeout, 0);
            self.deadline = Some(now + gap);
        }
        self.open_window(now, base);
        Some(Sync { counter: data.first().copied().filter(|_| self.counted) })
    }

    /// Synchronous PDOs have their time from each SYNC on; no limit when 1007h is 0 (7.5.2.7).
    pub(crate) fn open_window(&self, now: Instant, base: &mut Base) {
        let length = Duration::from_micros(base.od.int(WINDOW).unwrap_or(0).max(0) as u64);
        let length = base.rules.sync_window(length);
        base.window_end = (!length.is_zero()).then(|| now + length);
    }

    /// OPERATIONAL begins.
    pub(crate) fn start(&mut self, now: Instant, base: &Base) {
        if base.rules.sync_watched_from_start() {
            self.deadline = self.longest_gap.map(|gap| now + gap);
        }
    }

    /// Supervision belongs to OPERATIONAL. A missed SYNC stays an error until SYNC is back.
    pub(crate) fn stop(&mut self) {
        self.deadline = None;
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &mut Base) {
        if self.deadline.take_if(|due| *due <= now).is_some() && base.rules.sync_loss_told() {
            base.raise(Fault::new(FaultKind::SyncTimeout, 0));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.deadline
    }
}

/// The refusals of 1005h, 1006h and 1019h (CiA 301, 7.5.2.5, 7.5.2.6 and 7.5.2.22).
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    match (mux, bytes) {
        (COB_ID, &[a, b, c, d]) => {
            // A master that restores what it has read must not be refused.
            let before = base.od.int(COB_ID).unwrap_or(0) as u32;
            let cob = u32::from_le_bytes([a, b, c, d]);
            let same = before == cob && base.rules.sync_id_taken_as_it_is();
            return if same { Ok(()) } else { check_cob_id(before, cob, base) };
        }
        (PERIOD, &[a, b, c, d]) => {
            let period = Duration::from_micros(u32::from_le_bytes([a, b, c, d]).into());
            let shortest = base.settings.sync_producer.unwrap_or_default();
            // 0 ends the production, so no producer is too slow for it.
            let possible = period >= shortest && base.rules.sync_period_taken(period);
            if !period.is_zero() && !possible {
                return Err(Abort::VALUE);
            }
        }
        (COUNTER_OVERFLOW, &[last]) => {
            if base.od.int(PERIOD).is_some_and(|period| period != 0) {
                return Err(Abort::DEVICE_STATE);
            }
            if !base.rules.sync_overflow_valid(last) {
                return Err(Abort::VALUE);
            }
        }
        _ => {}
    }
    Ok(())
}

/// Only a device that can produce SYNC takes bit 30, and while it produces, the identifier stays.
fn check_cob_id(before: u32, cob: u32, base: &Base) -> Result<(), Abort> {
    let foreign_bits = !IDENTIFIER & !base.settings.sync_producer.map_or(0, |_| PRODUCER);
    let moved = before & cob & PRODUCER != 0 && base.rules.sync_id_fixed_while_producing();
    let restricted = is_restricted(CobId(cob).can_id()) && base.rules.restricted_ids_refused();
    if cob & foreign_bits != 0 || !base.has_room_for(CobId(cob)) || moved || restricted {
        return Err(Abort::VALUE);
    }
    Ok(())
}

fn round_up(span: Duration, step: Duration) -> Duration {
    let step = step.as_nanos().max(1);
    let rounded = span.as_nanos().div_ceil(step) * step;
    Duration::from_nanos(u64::try_from(rounded).unwrap_or(u64::MAX))
}

pub(crate) const COB_ID: Mux = Mux::new(0x1005, 0);
pub(crate) const PERIOD: Mux = Mux::new(0x1006, 0);
const WINDOW: Mux = Mux::new(0x1007, 0);
/// Bits 0 to 29 of 1005h.
const IDENTIFIER: u32 = 0x3FFF_FFFF;
/// Bit 30 of 1005h.
pub(crate) const PRODUCER: u32 = 1 << 30;
pub(crate) const COUNTER_OVERFLOW: Mux = Mux::new(0x1019, 0);

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, eds, entry, full, mux, sent, set};
    use canopen::eds::Access;
    use canopen::{Abort, DataType};

    #[test]
    fn supervision_begins_with_the_first_sync_in_operational() {
        let mut fixture = Fixture::new(&eds(full()));
        fixture.write(mux(0x1006, 0), &100_000u32.to_le_bytes()).unwrap();
        fixture.send("080#");
        assert_eq!(fixture.until(1_000_000), []);
        fixture.send("000#0105");
        fixture.send("080#");
        assert_eq!(fixture.until(2_000_000), sent(&[(1_150_000, "085#0081110000000000")]));
        fixture.send("000#8005");
        assert!(fixture.ask("080#").is_empty());
        fixture.send("000#0105");
        assert_eq!(fixture.ask("080#"), ["085#0000000000000000"]);
    }

    #[test]
    fn a_sync_of_another_length_is_told_and_not_used() {
        let mut fixture = Fixture::new(&eds(full()));
        assert_eq!(fixture.ask("080#01"), ["085#4082110000000000"]);
        assert!(fixture.ask("080#01").is_empty());
        assert_eq!(fixture.ask("080#"), ["085#0000000000000000"]);
        fixture.write(mux(0x1019, 0), &[10]).unwrap();
        assert_eq!(fixture.ask("080#"), ["085#4082110000000000"]);
        assert_eq!(fixture.ask("080#01"), ["085#0000000000000000"]);
    }

    #[test]
    fn synchronous_rpdos_have_their_window() {
        let mut entries = full();
        entries.push(entry(mux(0x1007, 0), DataType::UNSIGNED32, Access::Rw, 0));
        set(&mut entries, mux(0x1400, 2), 1);
        set(&mut entries, mux(0x1600, 0), 1);
        set(&mut entries, mux(0x1600, 1), 0x6200_0108);
        let mut fixture = Fixture::new(&eds(entries));
        let brought = |fixture: &mut Fixture, pause: u64, byte: u8| {
            fixture.send("080#");
            fixture.run_to(fixture.now.0 / 1000 + pause);
            fixture.send(&format!("205#{byte:02X}"));
            fixture.send("080#");
            fixture.read(mux(0x6200, 1)).unwrap() == [byte]
        };
        fixture.send("000#0105");
        assert!(brought(&mut fixture, 50_000, 1));
        fixture.write(mux(0x1007, 0), &5_000u32.to_le_bytes()).unwrap();
        assert!(brought(&mut fixture, 5_000, 2));
        assert!(!brought(&mut fixture, 5_001, 3));
        fixture.run_to(fixture.now.0 / 1000 + 50_000);
        fixture.write(mux(0x1007, 0), &[0; 4]).unwrap();
        fixture.send("205#04");
        fixture.send("080#");
        assert_eq!(fixture.read(mux(0x6200, 1)), Ok(vec![4]));
    }

    #[test]
    fn parameters_are_judged() {
        let mut fixture = Fixture::new(&eds(full()));
        for cob in [0x4000_0080u32, 0x2000_0080, 0x0000_0880, 0x0000_0000, 0x0000_0601] {
            let refused = fixture.write(mux(0x1005, 0), &cob.to_le_bytes());
            assert_eq!(refused, Err(Abort::VALUE.0), "{cob:08X}");
        }
        assert_eq!(fixture.write(mux(0x1005, 0), &[0x81, 0, 0, 0]), Ok(()));
        for last in [1, 241, 255] {
            assert_eq!(fixture.write(mux(0x1019, 0), &[last]), Err(Abort::VALUE.0));
        }
        assert_eq!(fixture.write(mux(0x1019, 0), &[240]), Ok(()));
        fixture.write(mux(0x1006, 0), &[1, 0, 0, 0]).unwrap();
        assert_eq!(fixture.write(mux(0x1019, 0), &[0]), Err(Abort::DEVICE_STATE.0));
    }
}
