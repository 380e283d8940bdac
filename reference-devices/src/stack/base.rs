//! The state that every service works with.

use std::sync::Arc;

use canopen::eds::Eds;
use canopen::pdo::CobId;
use canopen::{Dictionary, Instant, NmtState};

use crate::rules::{Rules, Service};
use crate::stack::errors::Errors;
use crate::stack::fault::{Fault, FaultKind};
use crate::stack::settings::NodeSettings;

/// The node as its services see it: identity, state, decisions, objects and errors.
#[derive(Clone)]
pub(crate) struct Base {
    pub(crate) id: u8,
    pub(crate) state: NmtState,
    /// Whether an error has led there.
    pub(crate) by_error: bool,
    pub(crate) settings: NodeSettings,
    pub(crate) rules: Arc<Rules>,
    pub(crate) od: Dictionary,
    pub(crate) errors: Errors,
    /// Data types that may fill gaps in RPDOs.
    pub(crate) dummies: Vec<u16>,
    /// The smallest mappable unit in bits.
    pub(crate) granularity: u8,
    /// When the synchronous window closes that the last SYNC opened (1007h).
    pub(crate) window_end: Option<Instant>,
}

impl Base {
    /// The base of a device with this data sheet, whose objects are `od`.
    pub(crate) fn new(
        eds: &Eds,
        od: Dictionary,
        id: u8,
        settings: NodeSettings,
        rules: Rules,
    ) -> Self {
        Self {
            id,
            state: NmtState::INITIALISING,
            by_error: false,
            settings,
            rules: Arc::new(rules),
            od,
            errors: Errors::default(),
            dummies: eds.dummies.clone(),
            granularity: eds.device.granularity,
            window_end: None,
        }
    }

    /// Whether the device can use the identifier of a COB-ID: not each device has those of 29 bits,
    /// and one of 11 bits has no further bits (CiA 301, 7.5.2.35).
    pub(crate) fn has_room_for(&self, cob: CobId) -> bool {
        cob.stray_bits() == 0 && (!cob.extended() || self.rules.long_identifiers_taken())
    }

    /// The state by which a service acts.
    pub(crate) fn state_of(&self, service: Service) -> NmtState {
        if self.by_error && !self.rules.reaction_ends(service) {
            return NmtState::OPERATIONAL;
        }
        self.state
    }

    /// An error of the communication appeared.
    pub(crate) fn raise(&mut self, fault: Fault) {
        self.errors.raise_fault(fault, &self.settings.emcy, &self.rules);
    }

    /// The cause of an error of the communication is gone.
    pub(crate) fn mend(&mut self, kind: FaultKind, subject: u16) {
        if self.rules.communication_errors_end() {
            self.errors.remove(kind, subject);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen::DataType;
    use canopen::eds::{Access, Eds};

    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, entry, full, mux, sent, set};
    use crate::stack::{Inert, NodeSettings};

    const OFF: [u8; 4] = [0, 0, 0, 0x80];

    /// A device with every service that has a COB-ID. The first TPDO and the first RPDO carry a
    /// byte.
    fn sheet() -> Eds {
        let (u8, u32, rw) = (DataType::UNSIGNED8, DataType::UNSIGNED32, Access::Rw);
        let mut entries = full();
        for (mapping, word) in [(0x1600, 0x6200_0108), (0x1A00, 0x2000_0008)] {
            set(&mut entries, mux(mapping, 0), 1);
            set(&mut entries, mux(mapping, 1), word);
        }
        for (index, default) in [(0x1012, 0x100), (0x2010, 0)] {
            entries.push(entry(mux(index, 0), u32, rw, default));
        }
        for index in [0x1028, 0x1201] {
            entries.push(entry(mux(index, 0), u8, Access::Ro, 2));
            let channel = (1..=2).map(|sub| entry(mux(index, sub), u32, rw, 1 << 31));
            entries.extend(channel);
        }
        eds(entries)
    }

    fn fixture(rules: &str) -> Fixture {
        let settings = NodeSettings {
            sync_producer: Some(Duration::from_millis(1)),
            time_interval_object: Some(mux(0x2010, 0)),
            ..NodeSettings::default()
        };
        let rules = if rules.is_empty() { Rules::default() } else { Rules::otherwise(rules) };
        Fixture::with(&sheet(), settings, rules, Box::new(Inert))
    }

    #[test]
    fn identifiers_of_29_bits_are_for_the_device_to_support() {
        let of_services = [0x1005, 0x1012, 0x1014].map(|index| (index, 0));
        let of_channels = [0x1028, 0x1201, 0x1400, 0x1800].map(|index| (index, 1));
        for (index, sub) in of_services.into_iter().chain(of_channels) {
            let mux = mux(index, sub);
            let answers = ["", "long-identifiers-taken: true"].map(|rules| {
                let mut fixture = fixture(rules);
                if index > 0x1012 {
                    fixture.write(mux, &OFF).unwrap();
                }
                [[0x45, 0x23, 0x01, 0x20], [0x85, 0x08, 0, 0]].map(|cob| fixture.write(mux, &cob))
            });
            let refused = Err(0x0609_0030);
            assert_eq!(answers, [[refused, refused], [Ok(()), refused]], "{mux}");
        }
    }

    #[test]
    fn each_service_uses_its_identifier_of_29_bits_alone() {
        let mut fixture = fixture("long-identifiers-taken: true");
        for (index, sub, last) in [(0x1800, 1, 0x80), (0x1400, 1, 0x81), (0x1014, 0, 0x82)] {
            fixture.write(mux(index, sub), &OFF).unwrap();
            fixture.write(mux(index, sub), &[last, 1, 0xCD, 0x3A]).unwrap();
        }
        fixture.write(mux(0x1201, 1), &[0x83, 1, 0xCD, 0x3A]).unwrap();
        fixture.write(mux(0x1201, 2), &[0x84, 1, 0xCD, 0x3A]).unwrap();
        fixture.write(mux(0x1005, 0), &[0x85, 1, 0xCD, 0x3A]).unwrap();
        assert_eq!(fixture.ask("000#0105"), ["1ACD0180#11"]);
        assert_eq!(fixture.ask("1ACD0180#R1"), ["1ACD0180#11"]);
        for short in ["180#R1", "00000180#R1", "181#", "00000181#", "1ACD0191#", "1BCD0181#"] {
            assert!(fixture.ask(short).is_empty(), "{short}");
        }
        assert_eq!(fixture.ask("1ACD0181#"), ["1ACD0182#1082110000000000"]);
        assert_eq!(fixture.ask("1ACD0183#4000100000000000"), ["1ACD0184#4300100091010000"]);
        assert!(fixture.ask("183#4000100000000000").is_empty());
        fixture.write(mux(0x1800, 2), &[1]).unwrap();
        assert!(fixture.ask("185#").is_empty());
        assert_eq!(fixture.ask("1ACD0185#"), ["1ACD0180#11"]);
    }

    #[test]
    fn producers_of_sync_and_time_use_their_identifiers_of_29_bits() {
        let mut fixture = fixture("long-identifiers-taken: true");
        let at = fixture.now.0 / 1000;
        fixture.write(mux(0x1006, 0), &10_000_u32.to_le_bytes()).unwrap();
        fixture.write(mux(0x1005, 0), &[0x85, 1, 0xCD, 0x7A]).unwrap();
        assert_eq!(fixture.until(at + 12_000), sent(&[(at + 10_000, "1ACD0185#")]));
        // The identifier of a producer stays, and so does its length (7.5.2.5).
        assert!(fixture.write(mux(0x1005, 0), &[0x85, 1, 0, 0x40]).is_err());
        fixture.write(mux(0x1005, 0), &[0x85, 1, 0xCD, 0x3A]).unwrap();
        fixture.write(mux(0x2010, 0), &[10, 0, 0, 0]).unwrap();
        fixture.write(mux(0x1012, 0), &[0x86, 1, 0xCD, 0x7A]).unwrap();
        let times = fixture.until(at + 23_000);
        assert!(times.iter().all(|(_, frame)| frame.starts_with("1ACD0186#")), "{times:?}");
        assert_eq!(times.len(), 1);
    }
}
