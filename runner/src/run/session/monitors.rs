//! Rules that hold in each case, regardless of its steps.

use std::time::Duration;

use canopen::monitor::{self, Breach, Seen, Watched};
use canopen::pdo::CobId;
use canopen::{Mux, emcy};

use super::case::CaseRun;
use crate::dut::Dut;
use crate::suite::model::Tolerated;

/// How long a program may wait for the processor while the tester does not: a busy machine with one
/// processor made heartbeats of 1 ms stay away for 8 and 17 ms.
const HOLD_UP: Duration = Duration::from_millis(50);

impl CaseRun<'_, '_> {
    /// The first rule that the frames from place `from` on break.
    pub(super) fn watch(&self, from: usize) -> Option<Breach> {
        let tolerated = self.instance.case().tolerates.contains(&Tolerated::Emergency);
        let emergency = Some(emcy::COB_ID + u16::from(self.common.dut.node));
        let waited_for = |seen: &Seen| {
            let tolerated = tolerated && seen.stamped.frame.data_id() == emergency;
            Seen { expected: seen.expected || tolerated, ..*seen }
        };
        let frames = &self.link.trace()[from..];
        let now = self.link.mark();
        let dut = self.common.dut;
        let known = (!dut.shares_its_bus).then(|| self.common.known.to_vec());
        let mut monitors = monitor::all(Watched {
            node: dut.node,
            known,
            tpdos: tpdos(dut).collect(),
            standing: self.common.baseline.standing(),
            slack: self.common.policy.slow_wire,
            hold_up: if dut.shares_its_machine { HOLD_UP } else { Duration::ZERO },
        });
        monitors.iter_mut().find_map(|monitor| {
            let seen = frames.iter().find_map(|seen| monitor.observe(&waited_for(seen)).err());
            // Without power, silence is expected.
            let silence = || (!self.bench_snapshot.off).then(|| monitor.finish(now).err())?;
            seen.or_else(silence)
        })
    }
}

/// The identifiers the data sheet gives to TPDOs, SYNC and TIME.
pub(super) fn data_sheet_identifiers(dut: &Dut) -> Vec<u16> {
    tpdos(dut).chain([SYNC, TIME].into_iter().filter_map(|mux| identifier(dut, mux))).collect()
}

/// Those it gives to TPDOs.
fn tpdos(dut: &Dut) -> impl Iterator<Item = u16> {
    let objects = dut.eds.objects.iter().map(|object| object.index);
    let tpdos = objects.filter(|index| (0x1800..0x1A00).contains(index));
    tpdos.filter_map(|index| identifier(dut, Mux::new(index, 1)))
}

fn identifier(dut: &Dut, mux: Mux) -> Option<u16> {
    dut.default_int(mux).map(|cob_id| CobId(cob_id as u32).can_id())
}

const SYNC: Mux = Mux::new(0x1005, 0);
const TIME: Mux = Mux::new(0x1012, 0);
