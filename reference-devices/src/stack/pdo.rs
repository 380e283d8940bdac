//! The common part of RPDOs and TPDOs: where their parameters are, and which communication
//! parameters are refused (CiA 301, 7.5.2.35 and 7.5.2.37).

use canopen::eds::Direction;
use canopen::pdo::{CobId, is_restricted};
use canopen::{Abort, Dictionary, Mux, Value};

use crate::stack::base::Base;

/// One of the parameter objects of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Parameter {
    pub(crate) direction: Direction,
    pub(crate) part: Part,
    /// The PDO, counted from 0.
    pub(crate) pdo: u16,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Communication,
    Mapping,
}

impl Parameter {
    /// Which PDO's parameter the object at `index` is.
    pub(crate) const fn at(index: u16) -> Option<Self> {
        let (direction, part) = match index {
            0x1400..=0x15FF => (Direction::Receive, Part::Communication),
            0x1600..=0x17FF => (Direction::Receive, Part::Mapping),
            0x1800..=0x19FF => (Direction::Transmit, Part::Communication),
            0x1A00..=0x1BFF => (Direction::Transmit, Part::Mapping),
            _ => return None,
        };
        Some(Self { direction, part, pdo: index & 0x1FF })
    }
}

/// The PDOs of a device, counted from 0: those that have both parameter objects.
pub(crate) fn existing(od: &Dictionary, direction: Direction) -> Vec<u16> {
    let first = communication(direction, 0);
    let entries = od.entries_in(first..=first + 0x1FF).iter();
    let cob_ids = entries.map(|entry| entry.mux).filter(|mux| mux.sub == 1);
    cob_ids
        .map(|mux| mux.index - first)
        .filter(|pdo| od.has_object(mapping(direction, *pdo)))
        .collect()
}

/// The index of the communication parameter.
pub(crate) const fn communication(direction: Direction, pdo: u16) -> u16 {
    pdo + match direction {
        Direction::Receive => 0x1400,
        Direction::Transmit => 0x1800,
    }
}

/// The index of the mapping parameter.
pub(crate) const fn mapping(direction: Direction, pdo: u16) -> u16 {
    communication(direction, pdo) + 0x200
}

/// The COB-ID of a PDO.
pub(crate) fn cob_id(od: &Dictionary, direction: Direction, pdo: u16) -> CobId {
    let mux = Mux::new(communication(direction, pdo), COB_ID);
    CobId(od.int(mux).map_or(CobId::INVALID, |cob| cob as u32))
}

/// The refusals of a communication parameter.
pub(crate) fn check_communication(
    mux: Mux,
    bytes: &[u8],
    direction: Direction,
    base: &Base,
) -> Result<(), Abort> {
    let rules = &base.rules;
    if !rules.pdos_configured_in(base.state, mux.sub == COB_ID) {
        return Err(Abort::DEVICE_STATE);
    }
    let cob = cob_id(&base.od, direction, mux.index & 0x1FF);
    let kind = base.od.int(Mux::new(mux.index, TYPE)).unwrap_or(0) as u8;
    let taken = match mux.sub {
        COB_ID => rules.same_cob_id_taken(),
        _ => rules.same_parameter_taken(),
    };
    let same = base.od.get(mux) == Some(bytes) && taken;
    let fixed = !same && cob.valid() && rules.pdo_parameter_fixed_while_valid(mux.sub);
    let refused = match (mux.sub, bytes) {
        (COB_ID, &[a, b, c, d]) => {
            let new = CobId(u32::from_le_bytes([a, b, c, d]));
            !same
                && (cob_id_refused(cob, new, kind, direction, base)
                    || new.valid() && is_taken(mux.index, new, direction, base)
                    || !cob.valid()
                        && base.rules.pdo_needs_mapping(new.valid())
                        && maps_nothing(mux.index, base)
                        && !boots_without_mapping(mux.index, base))
        }
        (TYPE, &[kind]) => {
            fixed
                || !rules.transmission_type_valid(direction, kind)
                || asks_for_rtr(direction, kind) && !cob.rtr_allowed()
        }
        (INHIBIT_TIME | EVENT_TIMER, _) => fixed,
        (SYNC_START, &[start]) => fixed || start > 240,
        _ => false,
    };
    if refused { Err(Abort::VALUE) } else { Ok(()) }
}

fn cob_id_refused(old: CobId, new: CobId, kind: u8, direction: Direction, base: &Base) -> bool {
    let identifier = |cob: CobId| cob.0 & !(CobId::INVALID | CobId::NO_RTR);
    let changes = identifier(old) != identifier(new) || !base.rules.same_cob_id_taken();
    let moved = old.valid() && new.valid() && changes;
    let looks = match new.valid() {
        true => base.rules.restricted_ids_refused(),
        false => changes && base.rules.restricted_ids_of_invalid_pdos_refused(),
    };
    let opens = direction == Direction::Transmit && new.rtr_allowed() && !old.rtr_allowed();
    moved && base.rules.cob_id_fixed_while_valid()
        || !base.has_room_for(new)
        || looks && is_restricted(new.can_id())
        || opens && !base.rules.remote_requests_can_be_allowed()
        || new.valid() && !new.rtr_allowed() && matches!(kind, 252 | 253)
}

/// Whether another TPDO has the identifier.
fn is_taken(index: u16, new: CobId, direction: Direction, base: &Base) -> bool {
    let has_it = |pdo: u16| {
        let other = cob_id(&base.od, direction, pdo);
        let used = other.valid() || !base.rules.disabled_tpdo_leaves_its_id();
        pdo != index & 0x1FF && used && other.can_id() == new.can_id()
    };
    direction == Direction::Transmit
        && base.rules.tpdo_ids_unique()
        && existing(&base.od, direction).into_iter().any(has_it)
}

fn maps_nothing(index: u16, base: &Base) -> bool {
    base.od.int(Mux::new(index | 0x0200, 0)) == Some(0)
}

/// Whether the PDO exists after power-on although it maps nothing. Such a device can be switched
/// back to its previous configuration: a master that saves the configuration it has read gets no
/// refusal.
fn boots_without_mapping(index: u16, base: &Base) -> bool {
    let default = |mux| Some(base.od.entry(mux)?.default.as_ref()?.resolve(base.id));
    let valid = |cob: Value| cob.as_int().is_some_and(|cob| CobId(cob as u32).valid());
    default(Mux::new(index, COB_ID)).is_some_and(valid)
        && default(Mux::new(index | 0x0200, 0)).and_then(|count| count.as_int()) == Some(0)
}

const fn asks_for_rtr(direction: Direction, kind: u8) -> bool {
    matches!(direction, Direction::Transmit) && matches!(kind, 252 | 253)
}

/// Sub-index of the COB-ID.
pub(crate) const COB_ID: u8 = 1;
/// Sub-index of the transmission type.
pub(crate) const TYPE: u8 = 2;
/// Sub-index of the inhibit time, in 100 microseconds.
pub(crate) const INHIBIT_TIME: u8 = 3;
/// Sub-index of the event timer, in milliseconds.
pub(crate) const EVENT_TIMER: u8 = 5;
/// Sub-index of the SYNC start value.
pub(crate) const SYNC_START: u8 = 6;

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, eds, full, mux, set};
    use canopen::Abort;
    use canopen::eds::Entry;

    const VALUE: Result<(), u32> = Err(Abort::VALUE.0);

    /// The first RPDO and the first TPDO carry something.
    fn mapped() -> Vec<Entry> {
        let mut entries = full();
        for index in [0x1600, 0x1A00] {
            set(&mut entries, mux(index, 0), 1);
            set(&mut entries, mux(index, 1), 0x2000_0008);
        }
        entries
    }

    /// Writes a COB-ID to the first RPDO and the first TPDO, which agree.
    fn cob(fixture: &mut Fixture, cob: u32) -> Result<(), u32> {
        let rpdo = fixture.write(mux(0x1400, 1), &(cob + 0x80).to_le_bytes());
        let tpdo = fixture.write(mux(0x1800, 1), &cob.to_le_bytes());
        assert_eq!(rpdo, tpdo);
        tpdo
    }

    #[test]
    fn an_identifier_moves_by_way_of_invalid() {
        let mut fixture = Fixture::new(&eds(mapped()));
        assert_eq!(cob(&mut fixture, 0x185), Ok(()));
        assert_eq!(cob(&mut fixture, 0x186), VALUE);
        assert_eq!(cob(&mut fixture, 0x8000_0185), Ok(()));
        assert_eq!(cob(&mut fixture, 0x2000_0185), VALUE);
        assert_eq!(cob(&mut fixture, 0x8000_1185), VALUE);
        assert_eq!(cob(&mut fixture, 0x186), Ok(()));
        assert_eq!(cob(&mut fixture, 0x4000_0186), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x80, 0x05, 0, 0x80]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x81, 0x05, 0, 0]), VALUE);
    }

    #[test]
    fn a_pdo_needs_a_mapping_and_a_tpdo_an_identifier_of_its_own() {
        let mut fixture = Fixture::new(&eds(mapped()));
        for index in [0x1400, 0x1800] {
            fixture.write(mux(index, 1), &[0x85, 1, 0, 0x80]).unwrap();
            fixture.write(mux(index | 0x200, 0), &[0]).unwrap();
            assert_eq!(fixture.write(mux(index, 1), &[0x85, 1, 0, 0]), VALUE);
        }
        let mut fixture = Fixture::new(&eds(mapped()));
        for (index, result) in [(0x1400, Ok(())), (0x1800, VALUE)] {
            let neighbour = fixture.read(mux(index + 1, 1)).unwrap();
            fixture.write(mux(index, 1), &[0x85, 1, 0, 0x80]).unwrap();
            assert_eq!(fixture.write(mux(index, 1), &neighbour), result);
        }
    }

    /// A master saves the configuration that it has read.
    #[test]
    fn a_pdo_that_boots_without_a_mapping_can_be_switched_off_and_on() {
        let mut fixture = Fixture::new(&eds(full()));
        for index in [0x1400, 0x1800] {
            let booted = fixture.read(mux(index, 1)).unwrap();
            let off = [booted[0], booted[1], booted[2], booted[3] | 0x80];
            assert_eq!(booted[3] & 0x80, 0, "valid at boot");
            assert_eq!(fixture.read(mux(index | 0x200, 0)), Ok(vec![0]), "and without a mapping");
            for cob in [&off[..], &booted] {
                assert_eq!(fixture.write(mux(index, 1), cob), Ok(()));
            }
        }
    }

    #[test]
    fn types_that_the_direction_does_not_have_are_refused() {
        let mut fixture = Fixture::new(&eds(mapped()));
        for kind in 0..=255 {
            let rpdo = matches!(kind, 0..=240 | 254..);
            let tpdo = matches!(kind, 0..=240 | 252..);
            assert_eq!(fixture.write(mux(0x1400, 2), &[kind]).is_ok(), rpdo, "{kind}");
            assert_eq!(fixture.write(mux(0x1800, 2), &[kind]).is_ok(), tpdo, "{kind}");
        }
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x40]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 2), &[252]), VALUE);
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 2), &[252]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x40]), VALUE);
    }

    #[test]
    fn inhibit_time_and_sync_start_are_fixed_while_the_pdo_exists() {
        let mut fixture = Fixture::new(&eds(mapped()));
        assert_eq!(fixture.write(mux(0x1800, 3), &[0, 0]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 3), &[1, 0]), VALUE);
        assert_eq!(fixture.write(mux(0x1800, 6), &[1]), VALUE);
        assert_eq!(fixture.write(mux(0x1800, 5), &[1, 0]), Ok(()));
        assert_eq!(cob(&mut fixture, 0x8000_0185), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 3), &[1, 0]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 6), &[240]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 6), &[241]), VALUE);
        assert_eq!(fixture.write(mux(0x1800, 4), &[0]), Err(Abort::NO_SUB_INDEX.0));
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut fixture = Fixture::mutant(&eds(mapped()), "cob-id-fixed-while-valid: false");
        assert_eq!(cob(&mut fixture, 0x186), Ok(()));
        let mut fixture = Fixture::mutant(&eds(mapped()), "transmission-type-valid: true");
        assert_eq!(fixture.write(mux(0x1800, 2), &[245]), Ok(()));
        let mut fixture = Fixture::mutant(&eds(mapped()), "pdo-parameter-fixed-while-valid: false");
        assert_eq!(fixture.write(mux(0x1800, 3), &[1, 0]), Ok(()));
        let mut fixture = Fixture::mutant(&eds(mapped()), "tpdo-ids-unique: false");
        fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x80]).unwrap();
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 2, 0, 0]), Ok(()));
        let mut fixture = Fixture::mutant(&eds(mapped()), "pdo-needs-mapping: false");
        fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x80]).unwrap();
        fixture.write(mux(0x1A00, 0), &[0]).unwrap();
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0]), Ok(()));
        let mut fixture = Fixture::mutant(&eds(mapped()), "restricted-ids-refused: false");
        assert_eq!(fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0x80]), Ok(()));
        assert_eq!(fixture.write(mux(0x1800, 1), &[1, 6, 0, 0]), Ok(()));
    }
}
