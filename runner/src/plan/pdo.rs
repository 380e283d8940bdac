//! The PDOs of a data sheet, and the names that a case has for them.

use canopen::eds::Object;
use canopen::pdo::{CobId, Mapping};
use canopen::{DataType, Mux};

use super::scope::{Binding, Bound, Scope};
use crate::dut::Dut;
use crate::suite::each::{DirectionName, PdoHas, Pdos};
use crate::suite::literal::Literal;

/// Each PDO that fits, with its names.
pub(super) fn pdo_scopes(pdos: &Pdos, dut: &Dut) -> Vec<Bound> {
    let kind = match pdos.direction {
        DirectionName::Receive => "RPDO",
        DirectionName::Transmit => "TPDO",
    };
    let label = |pdo: &Pdo| vec![format!("{kind}{}", pdo.number)];
    fitting(pdos, dut).into_iter().map(|(pdo, scope)| (label(&pdo), scope)).collect()
}

/// The names of the first PDO that fits and maps an entry by default.
pub(super) fn mapping_scope(mux: Mux, pdos: &Pdos, dut: &Dut) -> Option<Scope> {
    fitting(pdos, dut).into_iter().find_map(|(pdo, mut scope)| {
        let (ahead, behind) = pdo.around(mux, dut)?;
        scope.bind("ahead", Binding::Bytes(ahead));
        scope.bind("behind", Binding::Bytes(behind));
        Some(scope)
    })
}

/// Whether a PDO maps an entry by default.
pub(super) fn is_mapped(mux: Mux, dut: &Dut) -> bool {
    let mut all = Pdo::all(DirectionName::Receive, dut);
    all.append(&mut Pdo::all(DirectionName::Transmit, dut));
    all.iter().any(|pdo| dut.default_mapping(pdo.mapping).iter().any(|entry| entry.mux == mux))
}

fn fitting(pdos: &Pdos, dut: &Dut) -> Vec<(Pdo, Scope)> {
    let all = Pdo::all(pdos.direction, dut);
    let mut fitting = Vec::new();
    for (place, pdo) in all.iter().enumerate() {
        let settable = |pdo: &&Pdo| pdo.in_use() && pdo.states(PdoHas::Settable, None, dut);
        let neighbour = all[place + 1..].iter().find(settable);
        let with = |sub: &u8| pdo.writable(dut, pdo.communication, *sub);
        if (pdos.used && !pdo.in_use())
            || !pdos.with.iter().all(with)
            || !pdos.has.iter().all(|has| pdo.states(*has, neighbour, dut))
        {
            continue;
        }
        let mut scope = Scope::default();
        pdo.bind(&mut scope, neighbour, dut);
        fitting.push((*pdo, scope));
    }
    fitting.truncate(pdos.most.unwrap_or(usize::MAX).max(1));
    fitting
}

/// A PDO as the data sheet describes it.
#[derive(Clone, Copy)]
struct Pdo {
    number: u16,
    /// Indices of communication and mapping parameter.
    communication: u16,
    mapping: u16,
    cob: CobId,
    /// Bits of the default mapping.
    bits: u32,
}

impl Pdo {
    /// The PDOs of that direction.
    fn all(direction: DirectionName, dut: &Dut) -> Vec<Self> {
        let (first, mapping) = match direction {
            DirectionName::Receive => (0x1400, 0x1600),
            DirectionName::Transmit => (0x1800, 0x1A00),
        };
        let pdo = |object: &Object| {
            let number = object.index.checked_sub(first).filter(|number| *number < 512)?;
            let mapping = mapping + number;
            dut.eds.object(mapping)?;
            let cob = CobId(dut.default_int(Mux::new(object.index, 1))? as u32);
            let bits = dut.default_mapping(mapping).iter().map(|entry| u32::from(entry.bits)).sum();
            Some(Self { number: number + 1, communication: object.index, mapping, cob, bits })
        };
        dut.eds.objects.iter().filter_map(pdo).collect()
    }

    /// The bytes before and after an entry that is mapped by default, where the mapped objects are
    /// whole bytes: of each other object its default.
    fn around(&self, mux: Mux, dut: &Dut) -> Option<(Vec<u8>, Vec<u8>)> {
        let mapped = dut.default_mapping(self.mapping);
        let place = mapped.iter().position(|entry| entry.mux == mux)?;
        let bytes = |mapped: &[Mapping]| -> Vec<u8> {
            mapped.iter().flat_map(|entry| default_bytes(entry, dut)).collect()
        };
        let whole = mapped.iter().all(|entry| entry.bits.is_multiple_of(8));
        whole.then(|| (bytes(&mapped[..place]), bytes(&mapped[place + 1..])))
    }

    const fn in_use(&self) -> bool {
        self.cob.valid() && self.bits > 0
    }

    /// Whether the device has the parameter, and it can be written.
    fn writable(&self, dut: &Dut, index: u16, sub: u8) -> bool {
        dut.eds.entry(Mux::new(index, sub)).is_some_and(|entry| entry.access.writable())
    }

    fn states(&self, has: PdoHas, neighbour: Option<&Self>, dut: &Dut) -> bool {
        let settable = || [1, 2].iter().all(|sub| self.writable(dut, self.communication, *sub));
        match has {
            PdoHas::Settable => settable(),
            PdoHas::Variable => {
                settable() && [0, 1].iter().all(|sub| self.writable(dut, self.mapping, *sub))
            }
            PdoHas::Fixed => {
                let first = dut.eds.entry(Mux::new(self.mapping, 1));
                first.is_some_and(|entry| !entry.access.writable())
            }
            PdoHas::Rtr => self.cob.rtr_allowed(),
            PdoHas::NoRtr => !self.cob.rtr_allowed(),
            PdoHas::Neighbour => neighbour.is_some(),
            PdoHas::VariableNeighbour => {
                neighbour.is_some_and(|next| next.states(PdoHas::Variable, None, dut))
            }
            PdoHas::Dummy => dut.eds.dummies.contains(&DataType::UNSIGNED8.0),
            PdoHas::Quiet => {
                let event_timer = Mux::new(self.communication, 5);
                let entry = dut.eds.entry(event_timer);
                entry.is_none_or(|entry| entry.access.writable())
                    || dut.default_int(event_timer) == Some(0)
            }
            PdoHas::NoReserved => dut.eds.entry(Mux::new(self.communication, 4)).is_none(),
        }
    }

    fn bind(&self, scope: &mut Scope, neighbour: Option<&Self>, dut: &Dut) {
        let int = |number: i128| Binding::Literal(Literal::Int(number));
        let off = |cob: CobId| int((cob.0 | CobId::INVALID).into());
        scope.bind("pdo", Binding::Id(self.cob.can_id()));
        scope.bind("on", int((self.cob.0 & !CobId::INVALID).into()));
        scope.bind("off", off(self.cob));
        scope.bind("number", int(self.number.into()));
        scope.bind("length", int(self.bits.div_ceil(8).into()));
        let entries = dut.eds.object(self.mapping).map_or(0, |object| {
            object.entries.iter().filter(|entry| !matches!(entry.mux.sub, 0 | 0xFF)).count()
        });
        scope.bind("entries", int(entries as i128));
        for (name, index, sub) in [
            ("parameters", self.communication, 0),
            ("cob-id", self.communication, 1),
            ("transmission", self.communication, 2),
            ("inhibit", self.communication, 3),
            ("reserved", self.communication, 4),
            ("event-timer", self.communication, 5),
            ("sync-start", self.communication, 6),
            ("count", self.mapping, 0),
            ("first", self.mapping, 1),
            ("second", self.mapping, 2),
        ] {
            scope.bind(name, Binding::Mux(Mux::new(index, sub)));
        }
        if let Some(next) = neighbour {
            scope.bind("neighbour", Binding::Id(next.cob.can_id()));
            scope.bind("neighbour-off", off(next.cob));
            scope.bind("neighbour-on", int((next.cob.0 & !CobId::INVALID).into()));
            for (name, index, sub) in [
                ("neighbour-cob-id", next.communication, 1),
                ("neighbour-transmission", next.communication, 2),
                ("neighbour-inhibit", next.communication, 3),
                ("neighbour-count", next.mapping, 0),
            ] {
                scope.bind(name, Binding::Mux(Mux::new(index, sub)));
            }
        }
    }
}

/// The default of a mapped object, as long as it is mapped; of a dummy, zeros.
fn default_bytes(mapped: &Mapping, dut: &Dut) -> Vec<u8> {
    let entry = dut.eds.entry(mapped.mux);
    let mut bytes = entry.and_then(|entry| entry.default_bytes(dut.node).ok()).unwrap_or_default();
    bytes.resize(usize::from(mapped.bits / 8), 0);
    bytes
}
