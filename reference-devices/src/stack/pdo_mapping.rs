//! PDO mapping: the content of a PDO, and the refusals of its mapping parameter (CiA 301, 7.5.2.36
//! and 7.5.2.38).

use canopen::eds::{Direction, Entry};
use canopen::pdo::{Mapping, Packer};
use canopen::{Abort, Data, DataType, Dictionary, Mux};

use crate::stack::base::Base;
use crate::stack::pdo::cob_id;

/// The mapped objects of a PDO, in their order.
#[derive(Clone, Debug, Default)]
pub(crate) struct PdoMapping {
    entries: Vec<Mapping>,
}

impl PdoMapping {
    /// Takes the mapping of the parameter at `index`.
    pub(crate) fn load(&mut self, od: &Dictionary, index: u16) {
        let count = od.int(Mux::new(index, 0)).unwrap_or(0) as u8;
        self.entries.clear();
        self.entries.extend((1..=count).map_while(|sub| entry(od, index, sub)));
    }

    pub(crate) fn entries(&self) -> &[Mapping] {
        &self.entries
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The length of the PDO in bytes.
    pub(crate) fn len(&self) -> usize {
        bits(&self.entries).div_ceil(8).min(8) as usize
    }

    /// Whether one of the values has changed since [`Dictionary::changes`] was `count`.
    pub(crate) fn has_changed_since(&self, count: u64, od: &Dictionary) -> bool {
        let is_mapped = |mux| self.entries.iter().any(|entry| entry.mux == mux);
        od.changed_since(count).is_none_or(|mut changed| changed.any(is_mapped))
    }

    /// The present values, side by side.
    pub(crate) fn pack(&self, od: &Dictionary) -> Data {
        let mut packer = Packer::default();
        for entry in &self.entries {
            packer.push(od.get(entry.mux).unwrap_or_default(), entry.bits);
        }
        packer.finish()
    }
}

/// The refusals of a mapping parameter: changes out of order, objects that cannot be mapped, too
/// much data.
pub(crate) fn check(
    mux: Mux,
    bytes: &[u8],
    direction: Direction,
    base: &Base,
) -> Result<(), Abort> {
    let od = &base.od;
    if !base.rules.pdos_configured_in(base.state, true) {
        return Err(Abort::DEVICE_STATE);
    }
    if od.get(mux) == Some(bytes) && base.rules.same_mapping_taken() {
        return Ok(());
    }
    let valid = cob_id(od, direction, mux.index & 0x1FF).valid();
    if valid && base.rules.mapping_fixed_while_valid() {
        return Err(Abort::ACCESS);
    }
    match (mux.sub, bytes) {
        (0, &[count]) => check_count(mux.index, count, direction, base),
        (_, &[a, b, c, d]) => {
            let active = od.int(Mux::new(mux.index, 0)).is_some_and(|count| count != 0);
            if active && base.rules.mapping_fixed_while_active() {
                return Err(Abort::ACCESS);
            }
            match u32::from_le_bytes([a, b, c, d]) {
                // 0 takes an entry out of use, regardless of its mapping.
                0 => Ok(()),
                word => check_entry(Mapping::decode(word), direction, base),
            }
        }
        _ => Ok(()),
    }
}

fn check_count(index: u16, count: u8, direction: Direction, base: &Base) -> Result<(), Abort> {
    if count >= MULTIPLEXED {
        return Err(Abort::VALUE);
    }
    let entries: Option<Vec<Mapping>> =
        (1..=count).map(|sub| entry(&base.od, index, sub)).collect();
    let mapped = entries.ok_or(Abort::PDO_LENGTH)?;
    for entry in &mapped {
        // A gap has the index of a data type. An unused entry within the count maps nothing.
        if entry.encode() != 0 {
            check_entry(*entry, direction, base)?;
        } else if base.rules.empty_entries_refused() {
            return Err(base.rules.empty_entry());
        }
    }
    if bits(&mapped) > base.rules.pdo_bits_max() {
        return Err(Abort::PDO_LENGTH);
    }
    Ok(())
}

fn check_entry(entry: Mapping, direction: Direction, base: &Base) -> Result<(), Abort> {
    if (1..=LAST_DUMMY).contains(&entry.mux.index) {
        return check_dummy(entry, direction, base);
    }
    let od = &base.od;
    let Some(object) = od.entry(entry.mux) else {
        return Err(match od.has_object(entry.mux.index) {
            true => Abort::NO_SUB_INDEX,
            false => Abort::NO_OBJECT,
        });
    };
    if !object.maps_into(direction) && base.rules.mappability_checked() {
        return Err(Abort::NOT_MAPPABLE);
    }
    let length = mapped_bits(object, base.granularity);
    if !base.rules.mapped_length_valid(length, entry.bits) {
        return Err(Abort::NOT_MAPPABLE);
    }
    Ok(())
}

/// Gaps in an RPDO, by the objects that are data types (CiA 301, 7.4.7).
fn check_dummy(entry: Mapping, direction: Direction, base: &Base) -> Result<(), Abort> {
    if !base.rules.gaps_checked() {
        return Ok(());
    }
    let allowed = base.dummies.contains(&entry.mux.index) && entry.mux.sub == 0;
    let length = match DataType(entry.mux.index) {
        DataType::BOOLEAN => Some(1),
        data_type => data_type.size().map(|size| 8 * size as u8),
    };
    if allowed && direction == Direction::Receive && length == Some(entry.bits) {
        Ok(())
    } else {
        Err(Abort::NOT_MAPPABLE)
    }
}

/// The bits an object takes in a PDO; `None` when its length is not fixed or exceeds a frame. A
/// BOOLEAN takes a byte where mapping has the granularity of bytes.
fn mapped_bits(object: &Entry, granularity: u8) -> Option<u8> {
    if object.data_type == DataType::BOOLEAN && granularity == 1 {
        return Some(1);
    }
    object.data_type.size().filter(|size| *size <= 8).map(|size| 8 * size as u8)
}

fn entry(od: &Dictionary, index: u16, sub: u8) -> Option<Mapping> {
    let word = od.int(Mux::new(index, sub))?;
    Some(Mapping::decode(word as u32))
}

fn bits(entries: &[Mapping]) -> u32 {
    entries.iter().map(|entry| u32::from(entry.bits)).sum()
}

/// Whether a mapped object is a gap.
pub(crate) const fn is_dummy(mux: Mux) -> bool {
    mux.index <= LAST_DUMMY
}

const LAST_DUMMY: u16 = 0x0007;
/// Counts from here on make a PDO a multiplexed one, which this device does not have.
const MULTIPLEXED: u8 = 0xFE;

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, eds, entry, full, mux};
    use canopen::eds::Access;
    use canopen::{Abort, DataType};

    const SET_DUMMY: u32 = 0x0005_0008;

    /// The first PDOs switched off, mapping ready to be changed.
    fn ready(rules: &str) -> Fixture {
        let mut sheet = eds(full());
        sheet.dummies = vec![5];
        let mut fixture = match rules {
            "" => Fixture::new(&sheet),
            rules => Fixture::mutant(&sheet, rules),
        };
        for index in [0x1400, 0x1800] {
            fixture.write(mux(index, 1), &[0x85, 1, 0, 0x80]).unwrap();
        }
        fixture
    }

    fn map(fixture: &mut Fixture, index: u16, sub: u8, entry: u32) -> Result<(), Abort> {
        fixture.write(mux(index, sub), &entry.to_le_bytes()).map_err(Abort)
    }

    fn count(fixture: &mut Fixture, index: u16, count: u8) -> Result<(), Abort> {
        fixture.write(mux(index, 0), &[count]).map_err(Abort)
    }

    #[test]
    fn an_entry_is_what_the_device_offers() {
        let table = [
            (0x1600, 0x6200_0108, Ok(())),
            (0x1600, 0x2006_0010, Ok(())),
            (0x1600, SET_DUMMY, Ok(())),
            (0x1A00, 0x6401_0110, Ok(())),
            (0x1600, 0x0000_0000, Ok(())),
            (0x1600, 0x7FFF_0008, Err(Abort::NO_OBJECT)),
            (0x1600, 0x6200_0908, Err(Abort::NO_SUB_INDEX)),
            (0x1600, 0x1017_0010, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x6000_0108, Err(Abort::NOT_MAPPABLE)),
            (0x1A00, 0x6200_0108, Err(Abort::NOT_MAPPABLE)),
            (0x1A00, 0x2006_0010, Err(Abort::NOT_MAPPABLE)),
            (0x1A00, SET_DUMMY, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x0006_0010, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x6200_0107, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x6200_0110, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x6200_0100, Err(Abort::NOT_MAPPABLE)),
            (0x1600, 0x2004_0008, Err(Abort::NOT_MAPPABLE)),
        ];
        for (index, entry, result) in table {
            assert_eq!(map(&mut ready(""), index, 1, entry), result, "{index:04X} {entry:08X}");
        }
    }

    #[test]
    fn a_boolean_takes_a_bit_where_mapping_has_bits() {
        for (granularity, bits, others) in [(1, 1, 8), (8, 8, 1)] {
            let mut entries = full();
            entries.push(entry(mux(0x2010, 0), DataType::BOOLEAN, Access::Rw, 0));
            let mut sheet = eds(entries);
            sheet.device.granularity = granularity;
            sheet.dummies = vec![1];
            let mut fixture = Fixture::new(&sheet);
            for index in [0x1400, 0x1800] {
                fixture.write(mux(index, 1), &[0x85, 1, 0, 0x80]).unwrap();
            }
            let boolean = 0x2010_0000;
            let refused = map(&mut fixture, 0x1A00, 1, boolean | others);
            assert_eq!(refused, Err(Abort::NOT_MAPPABLE), "{granularity}");
            assert_eq!(map(&mut fixture, 0x1A00, 1, boolean | bits), Ok(()), "{granularity}");
            assert_eq!(map(&mut fixture, 0x1600, 1, 0x0001_0001), Ok(()), "a gap");
        }
    }

    #[test]
    fn changes_need_their_order() {
        let mut fixture = ready("");
        map(&mut fixture, 0x1A00, 1, 0x6401_0110).unwrap();
        assert_eq!(count(&mut fixture, 0x1A00, 1), Ok(()));
        assert_eq!(map(&mut fixture, 0x1A00, 1, 0x6000_0108), Err(Abort::ACCESS));
        fixture.write(mux(0x1800, 1), &[0x85, 1, 0, 0]).unwrap();
        assert_eq!(count(&mut fixture, 0x1A00, 0), Err(Abort::ACCESS));
        assert_eq!(map(&mut fixture, 0x1A00, 2, 0x6000_0108), Err(Abort::ACCESS));
        assert_eq!(fixture.read(mux(0x1A00, 0)), Ok(vec![1]));
    }

    #[test]
    fn the_count_is_judged_with_all_that_it_covers() {
        let mut fixture = ready("");
        for sub in 1..=9 {
            map(&mut fixture, 0x1600, sub, SET_DUMMY).unwrap();
        }
        assert_eq!(count(&mut fixture, 0x1600, 9), Err(Abort::PDO_LENGTH));
        assert_eq!(count(&mut fixture, 0x1600, 10), Err(Abort::PDO_LENGTH));
        assert_eq!(count(&mut fixture, 0x1600, 0xFE), Err(Abort::VALUE));
        assert_eq!(count(&mut fixture, 0x1600, 8), Ok(()));
        assert_eq!(count(&mut fixture, 0x1600, 0), Ok(()));
        map(&mut fixture, 0x1600, 2, 0).unwrap();
        assert_eq!(count(&mut fixture, 0x1600, 3), Err(Abort::VALUE));
        assert_eq!(fixture.read(mux(0x1600, 0)), Ok(vec![0]));
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0]));
    }

    #[test]
    fn mutants_break_what_they_say() {
        let long = |rules| {
            let mut fixture = ready(rules);
            for sub in 1..=9 {
                map(&mut fixture, 0x1600, sub, SET_DUMMY).unwrap();
            }
            fixture
        };
        assert_eq!(count(&mut long("pdo-bits-max: 0xFFFFFFFF"), 0x1600, 9), Ok(()));
        assert_eq!(count(&mut long("pdo-bits-max: 72"), 0x1600, 9), Ok(()));
        let mut fixture = long("mapping-refused-but-written");
        assert_eq!(count(&mut fixture, 0x1600, 9), Err(Abort::PDO_LENGTH));
        assert_eq!(fixture.read(mux(0x1600, 0)), Ok(vec![9]));
        let mut fixture = long("mapping-refused-sets-error-register");
        assert_eq!(count(&mut fixture, 0x1600, 9), Err(Abort::PDO_LENGTH));
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![1]));
        let mut fixture = ready("mappability-checked: false");
        assert_eq!(map(&mut fixture, 0x1600, 1, 0x1017_0010), Ok(()));
        let mut fixture = ready("mapped-length-valid: true");
        assert_eq!(map(&mut fixture, 0x1600, 1, 0x6200_0110), Ok(()));
    }
}
