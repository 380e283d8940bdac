//! The object dictionary at work: the values of one device, and the rules of network access.
//!
//! The effect of a value on a service does not belong here: whoever holds the dictionary asks for
//! what changed.

mod addresses;

use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

use smallvec::SmallVec;

use crate::abort::Abort;
use crate::eds::{Eds, Entry};
use crate::mux::Mux;
use crate::pdo::Mapping;
use crate::value::{DataType, Value, ValueError};

use addresses::Addresses;

/// The values of one device's objects. [`read`](Self::read) and [`write`](Self::write) are the
/// network's side, where the error is the SDO abort code; [`get`](Self::get) and
/// [`set`](Self::set) are the device's own.
#[derive(Clone, Debug)]
pub struct Dictionary {
    sheet: Arc<Sheet>,
    values: Vec<Bytes>,
    changes: u64,
    /// The places of the last changes; the one counted `n` is at `n % RECENT`.
    recent: [u32; RECENT],
}

/// The part that all devices with one data sheet share.
#[derive(Debug)]
struct Sheet {
    entries: Vec<Entry>,
    places: Addresses,
    /// The value of each entry on an unchanged device, whatever its node id is...
    defaults: Vec<Bytes>,
    /// ...but for those at these places.
    of_node: Vec<usize>,
}

/// How many changes are remembered.
const RECENT: usize = 32;

/// A value. Most are no longer than a register, and need no memory of their own.
type Bytes = SmallVec<[u8; 16]>;

/// How many objects a PDO maps at most (7.5.2.36); a greater count means another thing.
const MOST_MAPPED: i64 = 64;

impl Dictionary {
    /// The dictionary of a device with this sheet and node id, every value at its default.
    ///
    /// # Errors
    /// The address of a default value that is not one of its entry's type, and why.
    pub fn new(eds: &Eds, node: u8) -> Result<Self, (Mux, ValueError)> {
        let mut entries = Vec::with_capacity(eds.entries().count());
        entries.extend(eds.entries().cloned());
        let defaults =
            entries.iter().map(|entry| default(entry, node)).collect::<Result<_, _>>()?;
        let places = Addresses::new(entries.iter().map(|entry| entry.mux));
        let depends = |entry: &Entry| entry.default.as_ref().is_some_and(|term| term.plus_node);
        let of_node = (0..entries.len()).filter(|place| depends(&entries[*place])).collect();
        let sheet = Arc::new(Sheet { entries, places, defaults, of_node });
        Ok(Self { values: sheet.defaults.clone(), sheet, changes: 0, recent: [0; RECENT] })
    }

    /// The same device with another node id, every value at its default.
    ///
    /// # Errors
    /// As [`new`](Self::new): a default value that is too large with this node id.
    pub fn of_node(&self, node: u8) -> Result<Self, (Mux, ValueError)> {
        let sheet = Arc::clone(&self.sheet);
        let mut values = sheet.defaults.clone();
        for place in &sheet.of_node {
            values[*place] = default(&sheet.entries[*place], node)?;
        }
        // Any value may have changed, so the count must exceed the list of recent changes.
        let changes = self.changes + RECENT as u64 + 1;
        Ok(Self { sheet, values, changes, recent: [0; RECENT] })
    }

    /// The value at `mux` for an SDO upload.
    ///
    /// # Errors
    /// [`Abort::NO_OBJECT`], [`Abort::NO_SUB_INDEX`] or [`Abort::WRITE_ONLY`].
    pub fn read(&self, mux: Mux) -> Result<&[u8], Abort> {
        let place = self.place(mux)?;
        if !self.sheet.entries[place].access.readable() {
            return Err(Abort::WRITE_ONLY);
        }
        Ok(&self.values[place])
    }

    /// Stores `bytes` at `mux` for an SDO download, after [`check`](Self::check).
    ///
    /// # Errors
    /// Those of [`check`](Self::check); the value is then unchanged.
    pub fn write(&mut self, mux: Mux, bytes: &[u8]) -> Result<(), Abort> {
        let place = self.check(mux, bytes)?;
        self.store(place, bytes);
        Ok(())
    }

    /// Whether the network may write `bytes` to `mux`: existence, access, length, range.
    ///
    /// # Errors
    /// [`Abort::NO_OBJECT`], [`Abort::NO_SUB_INDEX`], [`Abort::READ_ONLY`], [`Abort::TOO_LONG`],
    /// [`Abort::TOO_SHORT`], [`Abort::VALUE`], [`Abort::TOO_HIGH`] or [`Abort::TOO_LOW`].
    pub fn check(&self, mux: Mux, bytes: &[u8]) -> Result<usize, Abort> {
        let place = self.place(mux)?;
        let entry = &self.sheet.entries[place];
        if !entry.access.writable() {
            return Err(Abort::READ_ONLY);
        }
        check_length(entry.data_type, bytes.len())?;
        check_range(entry, bytes)?;
        Ok(place)
    }

    /// The bytes at `mux`, `None` when there is no such entry.
    pub fn get(&self, mux: Mux) -> Option<&[u8]> {
        self.find(mux).map(|place| self.values[place].as_slice())
    }

    /// What the PDO with its communication parameters at `index` maps at present (CiA 301, 7.5.2.36
    /// and 7.5.2.38): the mapping is 200h further. An entry that counts and is not there maps
    /// nothing, in 0 bits. `None` when the device has no mapping there.
    pub fn mapped(&self, index: u16) -> Option<Vec<Mapping>> {
        let mapping = index + 0x200;
        let count = self.int(Mux::new(mapping, 0))?.clamp(0, MOST_MAPPED) as u8;
        let word = |sub| self.int(Mux::new(mapping, sub)).unwrap_or(0) as u32;
        Some((1..=count).map(|sub| Mapping::decode(word(sub))).collect())
    }

    /// The whole number at `mux`, `None` when there is none.
    pub fn int(&self, mux: Mux) -> Option<i64> {
        let place = self.find(mux)?;
        self.sheet.entries[place].data_type.decode_int(&self.values[place])
    }

    /// Stores `bytes` at `mux`, regardless of the access rights of the network. Ignored when the
    /// entry does not exist, since optional objects may be missing.
    pub fn set(&mut self, mux: Mux, bytes: &[u8]) {
        if let Some(place) = self.find(mux) {
            self.store(place, bytes);
        }
    }

    /// Stores a whole number at `mux`, cut to the entry's type; ignored when there is no such
    /// entry.
    pub fn set_int(&mut self, mux: Mux, number: i64) {
        let Some(place) = self.find(mux) else { return };
        let data_type = self.sheet.entries[place].data_type;
        // Devices set most of their values again and again.
        if data_type.decode_int(&self.values[place]) != Some(number)
            && let Some(size) = data_type.size()
        {
            let bytes = i128::from(number).to_le_bytes();
            self.store(place, &bytes[..size]);
        }
    }

    /// Takes over the values of `other`, a dictionary of the same sheet, for every object whose
    /// index is in `indices`, as a reset does.
    ///
    /// # Panics
    /// When `other` was made from another sheet.
    pub fn restore(&mut self, other: &Self, indices: RangeInclusive<u16>) {
        assert_eq!(self.values.len(), other.values.len(), "dictionaries of different sheets");
        for place in self.places_in(indices) {
            self.store(place, &other.values[place]);
        }
    }

    /// A number that grows with each change of a value.
    pub const fn changes(&self) -> u64 {
        self.changes
    }

    /// The addresses whose values have changed since [`changes`](Self::changes) was `count`, once
    /// for each change; `None` when those were too many to tell.
    pub fn changed_since(&self, count: u64) -> Option<impl Iterator<Item = Mux> + '_> {
        let remembered = self.changes.checked_sub(count)? <= RECENT as u64;
        let mux = |change| self.sheet.entries[self.recent[change as usize % RECENT] as usize].mux;
        remembered.then(|| (count..self.changes).map(mux))
    }

    /// The description of the entry at `mux`.
    pub fn entry(&self, mux: Mux) -> Option<&Entry> {
        self.find(mux).map(|place| &self.sheet.entries[place])
    }

    /// Every entry, by ascending address.
    pub fn entries(&self) -> &[Entry] {
        &self.sheet.entries
    }

    /// The entries of the objects of these indices, by ascending address.
    pub fn entries_in(&self, indices: RangeInclusive<u16>) -> &[Entry] {
        &self.sheet.entries[self.places_in(indices)]
    }

    /// Whether there is an object at `index`.
    pub fn has_object(&self, index: u16) -> bool {
        !self.entries_in(index..=index).is_empty()
    }

    /// The address's value as a typed value.
    pub fn value(&self, mux: Mux) -> Option<Value> {
        let place = self.find(mux)?;
        self.sheet.entries[place].data_type.decode(&self.values[place]).ok()
    }

    fn store(&mut self, place: usize, bytes: &[u8]) {
        let value = &mut self.values[place];
        if value.as_slice() != bytes {
            value.clear();
            value.extend_from_slice(bytes);
            self.recent[self.changes as usize % RECENT] = place as u32;
            self.changes += 1;
        }
    }

    fn find(&self, mux: Mux) -> Option<usize> {
        self.sheet.places.find(mux)
    }

    fn places_in(&self, indices: RangeInclusive<u16>) -> Range<usize> {
        let (first, last) = indices.into_inner();
        let entries = &self.sheet.entries;
        let from = entries.partition_point(|entry| entry.mux.index < first);
        from..entries.partition_point(|entry| entry.mux.index <= last).max(from)
    }

    fn place(&self, mux: Mux) -> Result<usize, Abort> {
        self.find(mux).ok_or_else(|| match self.has_object(mux.index) {
            true => Abort::NO_SUB_INDEX,
            false => Abort::NO_OBJECT,
        })
    }
}

/// The value of an entry on an unchanged device with this node id.
fn default(entry: &Entry, node: u8) -> Result<Bytes, (Mux, ValueError)> {
    entry.default_bytes(node).map(Bytes::from_vec).map_err(|error| (entry.mux, error))
}

fn check_length(data_type: DataType, len: usize) -> Result<(), Abort> {
    match data_type.size() {
        Some(size) if len > size => Err(Abort::TOO_LONG),
        Some(size) if len < size => Err(Abort::TOO_SHORT),
        _ => Ok(()),
    }
}

fn check_range(entry: &Entry, bytes: &[u8]) -> Result<(), Abort> {
    if entry.data_type == DataType::BOOLEAN && bytes[0] > 1 {
        return Err(Abort::VALUE);
    }
    if entry.low.is_none() && entry.high.is_none() {
        return Ok(());
    }
    let value = entry.data_type.decode(bytes).ok().and_then(|value| value.as_real());
    let bound = |term: &Option<crate::eds::Term>| term.as_ref().and_then(|t| t.value.as_real());
    match (value, bound(&entry.low), bound(&entry.high)) {
        (Some(value), _, Some(high)) if value > high => Err(Abort::TOO_HIGH),
        (Some(value), Some(low), _) if value < low => Err(Abort::TOO_LOW),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eds::{Access, Object, ObjectKind, Term};

    fn entry(mux: Mux, data_type: DataType, access: Access) -> Entry {
        let name = String::new();
        let (default, low, high) = (None, None, None);
        Entry { mux, name, data_type, access, mappable: false, default, low, high, line: 0 }
    }

    fn dictionary() -> Dictionary {
        let var = |entry: Entry| Object {
            index: entry.mux.index,
            name: String::new(),
            kind: ObjectKind::VAR,
            flags: None,
            entries: vec![entry],
            line: 0,
        };
        let period = Entry {
            low: Some(Term::fixed(10.into())),
            high: Some(Term::fixed(1000.into())),
            default: Some(Term { value: 100.into(), plus_node: true }),
            ..entry(Mux::new(0x1017, 0), DataType::UNSIGNED16, Access::Rw)
        };
        let objects = vec![
            var(entry(Mux::new(0x1000, 0), DataType::UNSIGNED32, Access::Ro)),
            var(period),
            var(entry(Mux::new(0x2000, 0), DataType::UNSIGNED8, Access::Wo)),
            var(entry(Mux::new(0x2001, 0), DataType::BOOLEAN, Access::Rw)),
        ];
        Dictionary::new(&Eds { objects, ..Eds::default() }, 5).unwrap()
    }

    #[test]
    fn every_refusal_has_its_code() {
        let mut od = dictionary();
        assert_eq!(od.read(Mux::new(0x1001, 0)), Err(Abort::NO_OBJECT));
        assert_eq!(od.read(Mux::new(0x1000, 1)), Err(Abort::NO_SUB_INDEX));
        assert_eq!(od.read(Mux::new(0x2000, 0)), Err(Abort::WRITE_ONLY));
        assert_eq!(od.write(Mux::new(0x1000, 0), &[0; 4]), Err(Abort::READ_ONLY));
        assert_eq!(od.write(Mux::new(0x1017, 0), &[0; 4]), Err(Abort::TOO_LONG));
        assert_eq!(od.write(Mux::new(0x1017, 0), &[0]), Err(Abort::TOO_SHORT));
        assert_eq!(od.write(Mux::new(0x1017, 0), &[0xE9, 3]), Err(Abort::TOO_HIGH));
        assert_eq!(od.write(Mux::new(0x1017, 0), &[9, 0]), Err(Abort::TOO_LOW));
        assert_eq!(od.write(Mux::new(0x2001, 0), &[2]), Err(Abort::VALUE));
        assert_eq!(od.read(Mux::new(0x1017, 0)), Ok(&[105, 0][..]));
    }

    #[test]
    fn a_reset_takes_back_the_objects_of_its_range_only() {
        let initial = dictionary();
        let mut od = initial.clone();
        od.set(Mux::new(0x1017, 0), &[1, 0]);
        od.set(Mux::new(0x2001, 0), &[1]);
        od.restore(&initial, 0x1000..=0x1FFF);
        assert_eq!(od.int(Mux::new(0x1017, 0)), Some(105));
        assert_eq!(od.get(Mux::new(0x2001, 0)), Some(&[1][..]));
    }

    #[test]
    fn another_node_id_has_other_defaults() {
        let mut od = dictionary();
        od.set_int(Mux::new(0x2001, 0), 1);
        let other = od.of_node(6).unwrap();
        assert_eq!(other.int(Mux::new(0x1017, 0)), Some(106));
        assert_eq!(other.get(Mux::new(0x2001, 0)), Some(&[0][..]));
        assert!(od.of_node(7).is_ok());
    }

    #[test]
    fn entries_are_found_by_the_indices_of_their_objects() {
        let od = dictionary();
        let indices = |range| od.entries_in(range).iter().map(|entry| entry.mux.index);
        assert!(indices(0x1001..=0x2000).eq([0x1017, 0x2000]));
        assert_eq!(indices(0x2002..=0xFFFF).count(), 0);
        assert_eq!(indices(0..=0x0FFF).count(), 0);
        assert!(od.has_object(0x1017) && !od.has_object(0x1018));
    }

    #[test]
    fn changes_are_told_as_long_as_they_are_few() {
        let initial = dictionary();
        let mut od = initial.clone();
        let told =
            |od: &Dictionary, count| od.changed_since(count).map(Iterator::collect::<Vec<_>>);
        let [period, on] = [Mux::new(0x1017, 0), Mux::new(0x2001, 0)];
        od.set(period, &[1, 0]);
        od.set(on, &[0]);
        assert_eq!(told(&od, 0), Some(vec![period]));
        od.set(on, &[1]);
        assert_eq!(told(&od, 0), Some(vec![period, on]));
        assert_eq!(told(&od, od.changes()), Some(vec![]));
        od.restore(&initial, 0x1000..=0x1FFF);
        assert_eq!(told(&od, 1), Some(vec![on, period]));
        for value in 0..RECENT as i64 {
            od.set_int(period, value);
        }
        assert_eq!(told(&od, 3).map(|all| all.len()), Some(RECENT));
        assert_eq!(told(&od, 2), None);
        assert_eq!(told(&od.of_node(6).unwrap(), od.changes()), None);
    }

    #[test]
    fn a_legal_write_is_read_back() {
        let mut od = dictionary();
        assert_eq!(od.write(Mux::new(0x1017, 0), &[0xE8, 3]), Ok(()));
        assert_eq!(od.int(Mux::new(0x1017, 0)), Some(1000));
    }
}
