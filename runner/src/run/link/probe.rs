//! Asks a device without data sheet which objects of its profiles it has.
//!
//! Nothing is changed: to find out whether an object can be written, the value read from it is
//! written back.

mod mapped;

use std::ops::RangeInclusive;
use std::time::Duration;

use canopen::catalogue::{CatalogueObject, Facts, Mapping, Profile, Shape};
use canopen::eds::{Access, Entry, Object, Term};
use canopen::pdo::CobId;
use canopen::sdo::{Failure, Transfer};
use canopen::{Abort, BusError, DataType, Mux, Value};

use super::sdo;
use super::trace::Link;
use crate::run::policy::Policy;

/// How asking for objects ended early.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The device does not answer any more.
    Silent {
        /// The first request without an answer: the object, and whether its own value was written
        /// to it.
        first: (Mux, bool),
        /// The object to which its own value was written last.
        written: Option<Mux>,
    },
    /// The bus failed.
    Bus(BusError),
}

impl From<BusError> for Lost {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// The objects of the profiles that the device answers for, by ascending index, with type and
/// access as the profiles have them. An object that the communication profile says is writable, but
/// is not, becomes ro. Defaults are the present values, and only of the communication area, of
/// texts that cannot be written, and of `constants`. All others are unknown.
///
/// # Errors
/// When the device falls silent or the bus fails.
pub fn objects(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    profiles: &[&Profile],
    constants: &[Mux],
) -> Result<Vec<Object>, Lost> {
    let policy = Policy { sdo_timeout: PATIENCE, ..*policy };
    let (absent, written) = (Vec::new(), None);
    let mut probe = Probe { link, policy, node, constants, absent, written };
    probe.learn_absence()?;
    let mut found: Vec<Object> = Vec::new();
    let objects = profiles.iter().flat_map(|profile| profile.objects());
    for (indices, known) in objects.filter(|(_, known)| known.is_described()) {
        found.extend(probe.range(indices.clone(), known)?);
        probe.link.take_trace();
    }
    let mapped = probe.mapped(&found)?;
    found.extend(mapped);
    found.sort_by_key(|object| object.index);
    found.dedup_by_key(|object| object.index);
    Ok(found)
}

/// How long an answer may take: devices that have an object answer in a few milliseconds.
const PATIENCE: Duration = Duration::from_millis(300);
/// After this many absent indices in a row, a range of equal objects has ended.
const GAP: usize = 16;
/// An index that no device can have: it is reserved (CiA 301, 7.4.1).
const IMPOSSIBLE: Mux = Mux::new(0x0FFF, 0);
const HISTORY: u16 = 0x1003;
const MOST_SUBS: u8 = 0xFE;

struct Probe<'p, 'b> {
    link: &'p mut Link<'b>,
    policy: Policy,
    node: u8,
    constants: &'p [Mux],
    /// The device's abort codes for objects that it does not have.
    absent: Vec<Abort>,
    /// The object that was written last.
    written: Option<Mux>,
}

/// The device's answer for an address.
enum Answer {
    Value(Vec<u8>),
    /// It exists, and cannot be read, or not now.
    Refused,
    Absent,
}

impl Probe<'_, '_> {
    /// Devices exist that refuse what they do not have with another code.
    fn learn_absence(&mut self) -> Result<(), Lost> {
        self.absent = vec![Abort::NO_OBJECT, Abort::NO_SUB_INDEX];
        let ended = sdo::upload(self.link, &self.policy, self.node, IMPOSSIBLE)?;
        if let Err(Failure::Aborted(code)) = ended.result {
            self.absent.push(code);
        }
        Ok(())
    }

    fn range(
        &mut self,
        indices: RangeInclusive<u16>,
        known: &CatalogueObject,
    ) -> Result<Vec<Object>, Lost> {
        let (mut found, mut missing) = (Vec::new(), 0);
        for index in indices {
            match self.object(index, known)? {
                Some(object) => {
                    found.push(object);
                    missing = 0;
                }
                None => missing += 1,
            }
            if missing == GAP {
                break;
            }
        }
        Ok(found)
    }

    fn object(&mut self, index: u16, known: &CatalogueObject) -> Result<Option<Object>, Lost> {
        let first = Mux::new(index, 0);
        let answer = self.ask(first)?;
        let (Some(shape), false) = (known.object, matches!(answer, Answer::Absent)) else {
            return Ok(None);
        };
        let name = known.name.clone().unwrap_or_else(|| format!("Object {index:04X}"));
        let mut entries = Vec::new();
        match shape {
            Shape::Var | Shape::Domain => {
                entries.extend(self.entry(first, &known.of_var(), answer, None)?);
            }
            Shape::Array | Shape::Record => {
                let count = match &answer {
                    Answer::Value(bytes) => bytes.first().copied().unwrap_or_default(),
                    _ => 0,
                };
                let highest = Facts {
                    name: Some("Highest sub-index supported".to_owned()),
                    data_type: Some(DataType::UNSIGNED8),
                    access: Some(Access::Ro),
                    ..Facts::default()
                };
                let facts = known.of_sub(0).or(&highest);
                // A writable number of entries says how many are in use, not how many exist.
                let in_use = facts.access.is_some_and(Access::writable);
                entries.extend(self.entry(first, &facts, answer, None)?);
                if let (false, Some(entry)) = (in_use, entries.first_mut()) {
                    entry.default = Some(Term::fixed(Value::Int(count.into())));
                }
                let fixed = entries.first().is_some_and(|count: &Entry| !count.access.writable());
                for sub in 1..=if in_use { MOST_SUBS } else { count } {
                    let mux = Mux::new(index, sub);
                    let answer = self.ask(mux)?;
                    if in_use && sub > count && matches!(answer, Answer::Absent) {
                        break;
                    }
                    let item = known.item.as_ref().unwrap_or(&name).clone();
                    let mut facts = known.of_sub(sub);
                    if in_use && fixed {
                        facts.access = Some(Access::Ro);
                    }
                    entries.extend(self.entry(mux, &facts, answer, Some(item))?);
                }
            }
        }
        let flags = known.flags;
        Ok(Some(Object { index, name, kind: shape.kind(), flags, entries, line: 0 }))
    }

    /// The entry at an address that the device answered for; `None` when it is absent.
    fn entry(
        &mut self,
        mux: Mux,
        facts: &Facts,
        answer: Answer,
        item: Option<String>,
    ) -> Result<Option<Entry>, Lost> {
        let bytes = match answer {
            Answer::Value(bytes) => Some(bytes),
            Answer::Refused => None,
            Answer::Absent => return Ok(None),
        };
        // A sub that the profile does not define has the length of the answer.
        let data_type = facts.data_type.unwrap_or_else(|| match bytes.as_ref().map(Vec::len) {
            Some(1) => DataType::UNSIGNED8,
            Some(2) => DataType::UNSIGNED16,
            Some(4) => DataType::UNSIGNED32,
            _ => DataType::OCTET_STRING,
        });
        let mut access = facts.access.unwrap_or(Access::Ro);
        if let Some(bytes) = bytes.as_ref().filter(|_| access.writable() && may_be_fixed(mux)) {
            access = if self.is_fixed(mux, bytes)? { Access::Ro } else { access };
        }
        let mapping = facts.pdo.unwrap_or(Mapping::No);
        let mapped = mapping.access(access);
        // Settings of communication, and texts that identify the device.
        let changing = matches!(mux.index, 0x1001..=HISTORY);
        let is_default = matches!(mux.index, 0x1000..=0x1FFF) && !changing
            || data_type == DataType::VISIBLE_STRING && !access.writable()
            || self.constants.contains(&mux);
        let value = bytes.filter(|_| is_default).and_then(|bytes| data_type.decode(&bytes).ok());
        let numbered = || item.map(|item| format!("{item} {}", mux.sub));
        Ok(Some(Entry {
            mux,
            name: facts.name.clone().or_else(numbered).unwrap_or_default(),
            data_type,
            access: mapped.unwrap_or(access),
            mappable: mapping != Mapping::No && mapped.is_some(),
            default: value.map(|value| self.term(mux, value)),
            low: None,
            high: None,
            line: 0,
        }))
    }

    /// A default value, of identifiers that come with the node id as such. Those of the
    /// pre-defined connection set have 11 bits (CiA 301, 7.3.3).
    fn term(&self, mux: Mux, value: Value) -> Term {
        let node = i128::from(self.node);
        match value {
            Value::Int(cob_id)
                if comes_with_node_id(mux)
                    && !CobId(cob_id as u32).extended()
                    && cob_id & 0x7F == node =>
            {
                Term { value: Value::Int(cob_id - node), plus_node: true }
            }
            value => Term::fixed(value),
        }
    }

    fn ask(&mut self, mux: Mux) -> Result<Answer, Lost> {
        let ended = sdo::upload_if_there(self.link, &self.policy, self.node, mux)?;
        let ended = ended.ok_or_else(|| self.silent((mux, false)))?;
        Ok(match ended.result {
            Ok(bytes) => Answer::Value(bytes),
            Err(Failure::Aborted(code)) if !self.absent.contains(&code) => Answer::Refused,
            Err(_) => Answer::Absent,
        })
    }

    /// That the device does not answer any more.
    const fn silent(&self, first: (Mux, bool)) -> Lost {
        Lost::Silent { first, written: self.written }
    }

    /// Whether the device refuses what it holds as read only.
    fn is_fixed(&mut self, mux: Mux, bytes: &[u8]) -> Result<bool, Lost> {
        let flow = Transfer::usual(bytes.len());
        self.written = Some(mux);
        let ended = sdo::download(self.link, &self.policy, self.node, mux, bytes, flow)?;
        if ended.raw.is_none() && sdo::is_there(self.link, &self.policy, self.node, mux)?.is_none()
        {
            return Err(self.silent((mux, true)));
        }
        Ok(ended.result == Err(Failure::Aborted(Abort::READ_ONLY)))
    }
}

/// The COB-IDs of the predefined connection set (CiA 301, 7.3.5).
const fn comes_with_node_id(mux: Mux) -> bool {
    matches!(
        (mux.index, mux.sub),
        (0x1014, 0) | (0x1200, 1 | 2) | (0x1400..=0x1403 | 0x1800..=0x1803, 1)
    )
}

/// Where the communication profile lets a device have a constant instead of a setting, and writing
/// the value is not a command.
const fn may_be_fixed(mux: Mux) -> bool {
    matches!(
        mux.index,
        0x1005..=0x1007 | 0x100C | 0x100D | 0x1012 | 0x1014..=0x1017 | 0x1019 | 0x1028 | 0x1029
    ) || matches!(mux.index, 0x1400..=0x15FF | 0x1800..=0x19FF)
        // The entries of a mapping are as its count is, and refused while they are in use.
        || matches!((mux.index, mux.sub), (0x1600..=0x17FF | 0x1A00..=0x1BFF, 0))
}
