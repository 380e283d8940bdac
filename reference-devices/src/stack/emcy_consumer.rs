//! The EMCY consumer (CiA 301, 7.5.2.31, object 1028h).

use canopen::emcy::Emcy;
use canopen::pdo::CobId;
use canopen::{Abort, Id, Mux};

use crate::stack::base::Base;
use crate::stack::emcy;

/// The emergency message of another node that a frame is, with the number of that node: an entry
/// of 1028h names its identifier.
pub(crate) fn received(id: Id, data: &[u8], base: &Base) -> Option<(u8, Emcy)> {
    let entries = base.od.entries_in(CONSUMER..=CONSUMER).iter().map(|entry| entry.mux);
    let mut producers = entries.filter(|mux| mux.sub > 0);
    let producer = producers.find(|mux| {
        let cob = cob_id(*mux, base);
        cob.valid() && cob.can_id() == id
    })?;
    Some((producer.sub, Emcy::decode(data).ok()?))
}

/// The refusals of 1028h: the same as of 1014h.
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    match bytes {
        &[a, b, c, d] => {
            let before = Mux::new(mux.index, base.rules.emcy_consumer_entry(mux.sub));
            let after = CobId(u32::from_le_bytes([a, b, c, d]));
            emcy::check_cob_id(cob_id(before, base), after, base)
        }
        _ => Ok(()),
    }
}

fn cob_id(mux: Mux, base: &Base) -> CobId {
    base.od.int(mux).map_or(CobId(CobId::INVALID), |cob| CobId(cob as u32))
}

const CONSUMER: u16 = 0x1028;

#[cfg(test)]
mod tests {
    use canopen::eds::Access;
    use canopen::emcy::EmcyCode;
    use canopen::{Abort, DataType, Dictionary, Instant};

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, entry, full, mux};
    use crate::stack::{Behaviour, CommunicationEvent, NodeSettings};

    /// 2002h shows node and code of the last emergency message.
    #[derive(Clone)]
    struct Recorder;

    impl Behaviour for Recorder {
        fn event(&mut self, _now: Instant, event: CommunicationEvent, od: &mut Dictionary) {
            if let CommunicationEvent::Emergency { node, emcy } = event {
                assert_ne!(emcy.code, EmcyCode::RESET);
                od.set_int(mux(0x2002, 0), i64::from(node) << 16 | i64::from(emcy.code.0));
            }
        }
    }

    fn fixture() -> Fixture {
        let mut entries = full();
        for (sub, data_type, value) in
            [(0, DataType::UNSIGNED8, 2), (1, DataType::UNSIGNED32, 1 << 31)]
        {
            entries.push(entry(mux(0x1028, sub), data_type, Access::Rw, value));
        }
        let (settings, rules) = (NodeSettings::default(), Rules::default());
        Fixture::with(&eds(entries), settings, rules, Box::new(Recorder))
    }

    #[test]
    fn messages_of_a_named_producer_reach_the_application() {
        let mut fixture = fixture();
        fixture.send("081#1082010000000000");
        assert_eq!(fixture.read(mux(0x2002, 0)), Ok(vec![0x11, 0x22, 0x33, 0x44]));
        fixture.write(mux(0x1028, 1), &[0x81, 0, 0, 0]).unwrap();
        fixture.send("081#10820100");
        assert_eq!(fixture.read(mux(0x2002, 0)), Ok(vec![0x11, 0x22, 0x33, 0x44]));
        fixture.send("081#1082010000000000");
        assert_eq!(fixture.read(mux(0x2002, 0)), Ok(vec![0x10, 0x82, 1, 0]));
    }

    #[test]
    fn identifiers_are_judged_as_those_of_1014h() {
        let mut fixture = fixture();
        let cob = mux(0x1028, 1);
        assert_eq!(fixture.write(cob, &[0x01, 6, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x81, 0, 0, 0x20]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x81, 0, 0, 0]), Ok(()));
        assert_eq!(fixture.write(cob, &[0x82, 0, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x81, 0, 0, 0x80]), Ok(()));
        assert_eq!(fixture.write(cob, &[0x82, 0, 0, 0]), Ok(()));
    }
}
