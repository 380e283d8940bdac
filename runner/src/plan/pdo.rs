//! The PDOs of a data sheet, and the names that a case has for them.

use canopen::eds::{Object, Term};
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

    /// The bytes before and after an entry that is mapped by default once: of each other object its
    /// default. None where an object is not whole bytes, or where its limits exclude that default.
    fn around(&self, mux: Mux, dut: &Dut) -> Option<(Vec<u8>, Vec<u8>)> {
        let mapped = dut.default_mapping(self.mapping);
        let mut places = (0..mapped.len()).filter(|place| mapped[*place].mux == mux);
        let place = places.next().filter(|_| places.next().is_none())?;
        let bytes = |mapped: &[Mapping]| -> Option<Vec<u8>> {
            let each = mapped.iter().map(|entry| default_bytes(entry, dut));
            Some(each.collect::<Option<Vec<_>>>()?.concat())
        };
        let whole = mapped[place].bits.is_multiple_of(8);
        whole.then(|| bytes(&mapped[..place]).zip(bytes(&mapped[place + 1..])))?
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

/// The default of a mapped object, as long as it is mapped; of a dummy, zeros. None where it is not
/// whole bytes, or outside of the limits.
fn default_bytes(mapped: &Mapping, dut: &Dut) -> Option<Vec<u8>> {
    let size = mapped.bits.is_multiple_of(8).then_some(usize::from(mapped.bits / 8))?;
    let Some(entry) = dut.eds.entry(mapped.mux) else { return Some(vec![0; size]) };
    let mut bytes = entry.default_bytes(dut.node).unwrap_or_default();
    bytes.resize(size, 0);
    let value = entry.data_type.decode(&bytes).ok().and_then(|value| value.as_int());
    let bound = |term: &Option<Term>| term.as_ref()?.resolve(dut.node).as_int();
    let is_below = value.zip(bound(&entry.low)).is_some_and(|(value, low)| value < low);
    let is_above = value.zip(bound(&entry.high)).is_some_and(|(value, high)| value > high);
    (!is_below && !is_above).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use canopen::eds;

    use super::*;

    /// Whether 2000h, of 16 bits, is in an RPDO with `mapping` in a place of its own; beside it are
    /// 2001h from 1 to 9, with this default, and 2002h of one bit.
    fn place(default: &str, mapping: &[u32]) -> Option<(Vec<u8>, Vec<u8>)> {
        let var = |index: u16, data_type: u8, rest: &str| {
            format!(
                "[{index:04X}]\nParameterName=x\nObjectType=7\nDataType={data_type}\n\
                 AccessType=rww\nPDOMapping=1\n{rest}\n"
            )
        };
        let mut text = var(0x2000, 6, "DefaultValue=7") + &var(0x2002, 1, "");
        text += &var(0x2001, 5, &format!("LowLimit=1\nHighLimit=9\nDefaultValue={default}"));
        for (index, values) in [(0x1400, &[0x201, 255][..]), (0x1600, mapping)] {
            text += &format!("[{index:04X}]\nParameterName=x\nObjectType=9\nSubNumber=9\n");
            let count = [values.len() as u32];
            for (sub, value) in count.iter().chain(values).enumerate() {
                text += &format!(
                    "[{index:04X}sub{sub}]\nParameterName=x\nObjectType=7\nDataType=7\n\
                     AccessType=rw\nDefaultValue={value}\n"
                );
            }
        }
        let objects = "[ManufacturerObjects]\nSupportedObjects=3\n1=0x2000\n2=0x2001\n3=0x2002\n\
                       [OptionalObjects]\nSupportedObjects=2\n1=0x1400\n2=0x1600\n";
        let dut = Dut::new("", 1, eds::read((objects.to_owned() + &text).as_bytes()).eds);
        let pdo = Pdo::all(DirectionName::Receive, &dut)[0];
        pdo.around(Mux::new(0x2000, 0), &dut)
    }

    #[test]
    fn the_bytes_around_an_entry_are_defaults_that_the_device_takes() {
        let (word, byte, bit) = (0x2000_0010, 0x2001_0008, 0x2002_0001);
        assert_eq!(place("3", &[byte, word, byte]), Some((vec![3], vec![3])));
        assert_eq!(place("3", &[word]), Some((vec![], vec![])));
        assert_eq!(place("", &[byte, word]), None, "0 is below the limit");
        assert_eq!(place("3", &[word, word]), None, "which of them counts is not said");
        assert_eq!(place("3", &[bit, word]), None);
    }
}
