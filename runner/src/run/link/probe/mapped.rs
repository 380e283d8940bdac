//! The objects that PDOs map: the device names them itself, whichever profile they are of.

use std::collections::BTreeMap;

use canopen::eds::{Access, Entry, Object, ObjectKind, Term};
use canopen::pdo::Mapping;
use canopen::{DataType, Mux, Value};

use super::{Answer, Lost, Probe};

/// Where an object is mapped, and how long it is there.
#[derive(Clone, Copy, Debug)]
struct Use {
    access: Access,
    bits: u8,
}

impl Probe<'_, '_> {
    /// The mapped objects that are not among those found.
    pub(super) fn mapped(&mut self, found: &[Object]) -> Result<Vec<Object>, Lost> {
        let mut uses = uses(found);
        uses.retain(|mux, _| found.iter().all(|object| object.index != mux.index));
        let mut indices: Vec<u16> = uses.keys().map(|mux| mux.index).collect();
        indices.dedup();
        let mut objects = Vec::new();
        for index in indices {
            objects.extend(self.mapped_object(index, &uses)?);
        }
        Ok(objects)
    }

    fn mapped_object(
        &mut self,
        index: u16,
        uses: &BTreeMap<Mux, Use>,
    ) -> Result<Option<Object>, Lost> {
        let first = Mux::new(index, 0);
        let answer = self.ask(first)?;
        if matches!(answer, Answer::Absent) {
            return Ok(None);
        }
        let entry = |mux: Mux, answer: &Answer, name: String| {
            let used = uses.get(&mux);
            let length = match (used, answer) {
                (Some(used), _) => usize::from(used.bits).div_ceil(8),
                (None, Answer::Value(bytes)) => bytes.len(),
                (None, _) => 0,
            };
            Entry {
                mux,
                name,
                data_type: unsigned(length),
                access: used.map_or(Access::Ro, |used| used.access),
                mappable: used.is_some(),
                default: None,
                low: None,
                high: None,
                line: 0,
            }
        };
        let name = format!("Object {index:04X}");
        let (mut entries, mut kind) = (vec![entry(first, &answer, name.clone())], ObjectKind::VAR);
        if !uses.contains_key(&first) {
            kind = ObjectKind::RECORD;
            let count = match &answer {
                Answer::Value(bytes) => bytes.first().copied().unwrap_or_default(),
                _ => 0,
            };
            entries[0].data_type = DataType::UNSIGNED8;
            entries[0].default = Some(Term::fixed(Value::Int(count.into())));
            for sub in 1..=count {
                let mux = Mux::new(index, sub);
                let answer = self.ask(mux)?;
                if !matches!(answer, Answer::Absent) {
                    entries.push(entry(mux, &answer, format!("{name} {sub}")));
                }
            }
        }
        Ok(Some(Object { index, name, kind, flags: None, entries, line: 0 }))
    }
}

/// What the mapping parameters map, without gaps, which have the index of a data type.
fn uses(found: &[Object]) -> BTreeMap<Mux, Use> {
    const FIRST_OBJECT: u16 = 0x1000;
    let mut uses = BTreeMap::<Mux, Use>::new();
    for object in found {
        let access = match object.index {
            0x1600..=0x17FF => Access::Rww,
            0x1A00..=0x1BFF => Access::Ro,
            _ => continue,
        };
        for entry in object.entries.iter().filter(|entry| entry.mux.sub > 0) {
            let word = entry.default.as_ref().and_then(|term| term.value.as_int());
            let Some(Mapping { mux, bits }) = word.map(|word| Mapping::decode(word as u32)) else {
                continue;
            };
            if mux.index < FIRST_OBJECT {
                continue;
            }
            let used = uses.entry(mux).or_insert(Use { access, bits });
            if used.access != access {
                // It is received and sent.
                used.access = Access::Rw;
            }
        }
    }
    uses
}

/// The type of whole numbers of so many bytes; bytes for other lengths.
fn unsigned(length: usize) -> DataType {
    match length {
        1 => DataType::UNSIGNED8,
        2 => DataType::UNSIGNED16,
        3 => DataType::UNSIGNED24,
        4 => DataType::UNSIGNED32,
        8 => DataType::UNSIGNED64,
        _ => DataType::OCTET_STRING,
    }
}
