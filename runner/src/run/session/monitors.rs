//! Rules that hold in each case, regardless of its steps.

use std::time::Duration;

use canopen::emcy::Emcy;
use canopen::monitor::{self, Breach, Seen, Watched};
use canopen::pdo::CobId;
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID};
use canopen::{Frame, Id, Mux, Stamped, emcy, heartbeat};

use super::case::CaseRun;
use crate::dut::Dut;
use crate::protect::download;
use crate::suite::model::Tolerated;

/// How long a program may wait for the processor while the tester does not: a busy machine with one
/// processor made heartbeats of 1 ms stay away for 8 and 17 ms.
const HOLD_UP: Duration = Duration::from_millis(50);

impl CaseRun<'_, '_> {
    /// The first rule that the frames from place `from` on break.
    pub(super) fn watch(&self, from: usize) -> Option<Breach> {
        let tolerated = self.instance.case().tolerates.contains(&Tolerated::Emergency);
        let emergency = Some(emcy::COB_ID + u16::from(self.common.dut.node));
        // Only the document of an application tells what it reports about a value.
        let unknown = self.instance.suite.about().is_none();
        let mut given = false;
        let mut waited_for = |seen: &Seen| {
            let Stamped { own, ref frame, .. } = seen.stamped;
            given |= unknown && own && gives_a_value(frame, self.common.dut.node);
            let tolerated =
                frame.data_id() == emergency && (tolerated || given && is_of_application(frame));
            Seen { expected: seen.expected || tolerated, ..*seen }
        };
        let frames = &self.link.trace()[from..];
        let now = self.link.mark();
        let dut = self.common.dut;
        let known = (!dut.shares_its_bus)
            .then(|| self.common.known.iter().copied().chain(of_partner(dut)).collect());
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

/// The identifiers of the other node of the bus.
fn of_partner(dut: &Dut) -> impl Iterator<Item = Id> {
    let bases = [emcy::COB_ID, RESPONSE_COB_ID, heartbeat::COB_ID];
    let ids = move |node: u8| bases.map(|base| Id::standard(base + u16::from(node)));
    dut.partner.iter().flat_map(move |other| ids(other.node))
}

/// Whether a frame gives the application a value: a download of one of its objects, or a PDO.
fn gives_a_value(frame: &Frame, node: u8) -> bool {
    match frame.data_id() {
        Some(id) if id == REQUEST_COB_ID + u16::from(node) => {
            download(frame).is_some_and(|(mux, _)| mux.index >= FIRST_OF_APPLICATION)
        }
        Some(id) => (0x180..0x580).contains(&id),
        // What has 29 bits by default is no service but a PDO.
        None => !frame.remote,
    }
}

/// Whether an emergency message is none about the communication.
fn is_of_application(frame: &Frame) -> bool {
    Emcy::decode(&frame.data).is_ok_and(|emcy| !emcy.code.is_of_communication())
}

const FIRST_OF_APPLICATION: u16 = 0x2000;

/// The identifiers the data sheet gives to TPDOs, SYNC and TIME.
pub(super) fn data_sheet_identifiers(dut: &Dut) -> Vec<Id> {
    tpdos(dut).chain([SYNC, TIME].into_iter().filter_map(|mux| identifier(dut, mux))).collect()
}

/// Those it gives to TPDOs.
fn tpdos(dut: &Dut) -> impl Iterator<Item = Id> {
    let objects = dut.eds.objects.iter().map(|object| object.index);
    let tpdos = objects.filter(|index| (0x1800..0x1A00).contains(index));
    tpdos.filter_map(|index| identifier(dut, Mux::new(index, 1)))
}

fn identifier(dut: &Dut, mux: Mux) -> Option<Id> {
    dut.default_int(mux).map(|cob_id| CobId(cob_id as u32).can_id())
}

const SYNC: Mux = Mux::new(0x1005, 0);
const TIME: Mux = Mux::new(0x1012, 0);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_application_may_answer_its_values_with_an_emergency() {
        let gives = |text: &str| gives_a_value(&text.parse().unwrap(), 5);
        for value in
            ["605#2B002000E8FF0000", "605#2101200004000000", "605#C202200004000000", "205#0102"]
        {
            assert!(gives(value), "{value}");
        }
        for other in [
            "605#4000200000000000",
            "605#2B17100064000000",
            "606#2B00200000000000",
            "000#0105",
            "080#",
            "705#05",
        ] {
            assert!(!gives(other), "{other}");
        }
        let is_its = |text: &str| is_of_application(&text.parse().unwrap());
        assert!(is_its("085#0010010000000000") && is_its("085#0000000000000000"));
        assert!(!is_its("085#3081110000000000") && !is_its("085#1082110000000000"));
    }
}
