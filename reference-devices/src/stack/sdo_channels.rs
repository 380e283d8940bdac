//! SDO channels: the default server, the further servers of 1201h to 127Fh, and what the
//! parameters of servers and clients refuse (CiA 301, 7.5.2.33 and 7.5.2.34).

use canopen::pdo::{CobId, is_restricted};
use canopen::{Abort, Dictionary, Id, Mux, NmtState};

use crate::stack::base::Base;

/// SDOs belong to PRE-OPERATIONAL and OPERATIONAL for clients as for servers.
pub(crate) fn used_in(state: NmtState, base: &Base) -> bool {
    base.rules.sdo_served_in(state)
}

/// The indices of the channels of a device within `range`.
pub(crate) fn channels(
    od: &Dictionary,
    range: std::ops::RangeInclusive<u16>,
) -> impl Iterator<Item = u16> {
    let entries = od.entries_in(range).iter().map(|entry| entry.mux);
    entries.filter(|mux| mux.sub == TO_SERVER).map(|mux| mux.index)
}

/// The identifiers to the server and to the client; `None` while the channel is off, which it is
/// until both are valid.
pub(crate) fn identifiers(index: u16, base: &Base) -> Option<(Id, Id)> {
    let cob_id = |sub| base.od.int(Mux::new(index, sub)).map(|cob| CobId(cob as u32));
    let (to_server, to_client) = (cob_id(TO_SERVER)?, cob_id(TO_CLIENT)?);
    let on = to_server.valid() && (to_client.valid() || !base.rules.sdo_channel_needs_both());
    on.then(|| (to_server.can_id(), to_client.can_id()))
}

/// The refusals of the parameter of a server or client.
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    let rules = &base.rules;
    let refused = match (mux.sub, bytes) {
        (TO_SERVER | TO_CLIENT, &[a, b, c, d]) => {
            let new = CobId(u32::from_le_bytes([a, b, c, d]));
            let old = CobId(base.od.int(mux).unwrap_or(0) as u32);
            let moved = old.valid() && new.valid() && old.can_id() != new.can_id();
            moved && rules.cob_id_fixed_while_valid()
                || !base.has_room_for(new) && !rules.sdo_long_identifier_taken()
                || new.valid() && is_kept(mux.index, new) && rules.restricted_ids_refused()
        }
        (NODE, &[node]) => !rules.sdo_partner_valid(node),
        _ => false,
    };
    if refused { Err(Abort::VALUE) } else { Ok(()) }
}

/// Whether the identifier belongs to another service. A client may use those of default servers:
/// that is its purpose.
const fn is_kept(index: u16, cob: CobId) -> bool {
    let id = cob.can_id();
    let of_default_server = matches!(id.raw(), 0x581..=0x5FF | 0x601..=0x67F);
    is_restricted(id) && !(index >= *CLIENTS.start() && of_default_server)
}

/// The further servers and the clients.
pub(crate) const SERVERS: std::ops::RangeInclusive<u16> = 0x1201..=0x127F;
pub(crate) const CLIENTS: std::ops::RangeInclusive<u16> = 0x1280..=0x12FF;

const TO_SERVER: u8 = 1;
const TO_CLIENT: u8 = 2;
const NODE: u8 = 3;

#[cfg(test)]
mod tests {
    use canopen::DataType;
    use canopen::eds::{Access, Entry};

    use crate::stack::testing::{Fixture, basic, eds, entry, mux};

    fn further() -> Vec<Entry> {
        let mut entries = basic();
        for index in [0x1201, 0x1280] {
            entries.push(entry(mux(index, 0), DataType::UNSIGNED8, Access::Ro, 3));
            for sub in 1..=2 {
                let off = 0x8000_0000;
                entries.push(entry(mux(index, sub), DataType::UNSIGNED32, Access::Rw, off));
            }
            entries.push(entry(mux(index, 3), DataType::UNSIGNED8, Access::Rw, 1));
        }
        entries
    }

    fn fixture() -> Fixture {
        let mut fixture = Fixture::new(&eds(further()));
        fixture.write(mux(0x1201, 1), &[0x80, 0x06, 0, 0]).unwrap();
        fixture.write(mux(0x1201, 2), &[0x81, 0x06, 0, 0]).unwrap();
        fixture
    }

    #[test]
    fn a_further_server_serves_when_both_identifiers_are_valid() {
        let mut fixture = fixture();
        assert_eq!(fixture.ask("680#4000100000000000"), ["681#4300100091010000"]);
        fixture.write(mux(0x1201, 2), &[0x81, 0x06, 0, 0x80]).unwrap();
        assert!(fixture.ask("680#4000100000000000").is_empty());
    }

    #[test]
    fn transfers_of_two_servers_do_not_meet() {
        let mut fixture = fixture();
        assert_eq!(fixture.ask("605#4004200000000000"), ["585#410420000F000000"]);
        assert_eq!(fixture.ask("680#2103200008000000"), ["681#6003200000000000"]);
        assert_eq!(fixture.ask("605#6000000000000000"), ["585#006669667465656E"]);
        assert_eq!(fixture.ask("680#000102030405060A"), ["681#2000000000000000"]);
        assert_eq!(fixture.ask("605#7000000000000000"), ["585#10206C6574746572"]);
        let given_up = fixture.until(3_000_000);
        assert_eq!(given_up.len(), 2, "{given_up:?}");
        assert!(given_up.iter().any(|(_, frame)| frame == "681#8003200000000405"));
    }

    #[test]
    fn a_channel_that_is_switched_off_gives_up_in_silence() {
        let mut fixture = fixture();
        assert_eq!(fixture.ask("680#4004200000000000"), ["681#410420000F000000"]);
        fixture.write(mux(0x1201, 1), &[0x80, 0x06, 0, 0x80]).unwrap();
        assert_eq!(fixture.until(5_000_000), []);
    }

    #[test]
    fn parameters_refuse_what_cannot_be() {
        let mut fixture = fixture();
        const VALUE: Result<(), u32> = Err(0x0609_0030);
        let refused = [
            (mux(0x1201, 1), [0x82, 0x06, 0, 0]),
            (mux(0x1201, 1), [0x80, 0x06, 0, 0x20]),
            (mux(0x1201, 1), [0x80, 0x0E, 0, 0x80]),
            (mux(0x1280, 1), [0x80, 0x01, 0, 0]),
        ];
        for (mux, bytes) in refused {
            assert_eq!(fixture.write(mux, &bytes), VALUE, "{mux} {bytes:02X?}");
        }
        fixture.write(mux(0x1201, 1), &[0, 0, 0, 0x80]).unwrap();
        assert_eq!(fixture.write(mux(0x1201, 1), &[0x0A, 0x06, 0, 0]), VALUE);
        assert_eq!(fixture.write(mux(0x1280, 1), &[0x0A, 0x06, 0, 0]), Ok(()));
        for (node, answer) in [(0, VALUE), (1, Ok(())), (127, Ok(())), (128, VALUE)] {
            assert_eq!(fixture.write(mux(0x1201, 3), &[node]), answer, "{node}");
        }
    }
}
