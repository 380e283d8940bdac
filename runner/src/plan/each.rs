//! The subjects of `each`, one per instance: entries of the data sheet, alone or with a PDO, and
//! PDOs.

use std::ops::RangeInclusive;

use canopen::eds::{Access, Direction, Entry, Object, ObjectKind, Term};
use canopen::{DataType, Mux, Value};

use super::bytes::entry_word;
use super::pdo::{is_mapped, mapping_scope, pdo_scopes};
use super::profile::block_scopes;
use super::scope::{Binding, Bound, Scope};
use crate::dut::Dut;
use crate::source::At;
use crate::suite::Suite;
use crate::suite::each::{AccessName, Each, Has, Objects, Pdos};
use crate::suite::literal::{Literal, ObjectRef};

/// The instances that `each` makes.
///
/// # Errors
/// As [`matching_entries`] and [`block_scopes`].
pub(super) fn each_scope(each: &Each, suite: &Suite, dut: &Dut) -> Result<Vec<Bound>, At<String>> {
    match each {
        Each::Objects(objects) => {
            let mut entries = matching_entries(objects, dut)?;
            let names = names_of_pdo(objects, dut);
            if objects.has.contains(&Has::Mapped) {
                entries.retain(|entry| names(entry).is_some());
            }
            if objects.longest {
                let longest = entries.iter().map(|entry| dut.length(entry)).max();
                entries.retain(|entry| Some(dut.length(entry)) == longest);
                entries.truncate(1);
            }
            let most = objects.most.unwrap_or(usize::MAX).max(1);
            let step = entries.len().div_ceil(most).max(1);
            let scope = |entry| Some(entry_scope(entry, dut, names(entry)?));
            Ok(entries.into_iter().step_by(step).filter_map(scope).collect())
        }
        Each::Pdos(pdos) => Ok(pdo_scopes(pdos, dut)),
        Each::Block(blocks) => match with_pdo(blocks.pdo.as_ref(), dut) {
            Some(pdo) => block_scopes(blocks, &pdo, suite, dut),
            None => Ok(Vec::new()),
        },
    }
}

/// The names of the first PDO that fits, when there is one; no names where none is asked for.
fn with_pdo(pdos: Option<&Pdos>, dut: &Dut) -> Option<Scope> {
    match pdos {
        None => Some(Scope::default()),
        Some(pdos) => pdo_scopes(pdos, dut).into_iter().next().map(|(_, scope)| scope),
    }
}

/// The names of the PDO that an entry comes with, as [`with_pdo`] has them; of an entry that is to
/// be mapped by default, of the first PDO that fits and maps it.
fn names_of_pdo(objects: &Objects, dut: &Dut) -> impl Fn(&Entry) -> Option<Scope> {
    let first = with_pdo(objects.pdo.as_ref(), dut);
    let mapping = objects.pdo.as_ref().filter(|_| objects.has.contains(&Has::Mapped));
    move |entry| match mapping {
        Some(pdos) => mapping_scope(entry.mux, pdos, dut),
        None => first.clone(),
    }
}

/// The entries of the data sheet that fit.
///
/// # Errors
/// When a range or a data type is not written as one, and where.
pub(crate) fn matching_entries<'d>(
    objects: &Objects,
    dut: &'d Dut,
) -> Result<Vec<&'d Entry>, At<String>> {
    let range = match &objects.range {
        None => 0..=u16::MAX,
        Some(range) => index_range(&range.value).map_err(|wrong| At::new(wrong, range.place))?,
    };
    let mut types = Vec::new();
    for name in &objects.types {
        let known = DataType::named(&name.value);
        let wrong = || At::new(format!("`{}` is not a data type", name.value), name.place);
        types.push(known.ok_or_else(wrong)?);
    }
    let except =
        |mux: Mux| objects.except.iter().any(|object| object.value == ObjectRef::Fixed(mux));
    // A device that is asked for an object of its manufacturer does not say that it can be written.
    let access_is_known = |mux: Mux| !(dut.sheet.composed && (0x2000..0x6000).contains(&mux.index));
    let has_one_of = |entry: &Entry| {
        access_is_known(entry.mux)
            && objects.access.iter().any(|access| has_access(entry, access.value))
    };
    let fits = |object: &Object, entry: &Entry| {
        range.contains(&entry.mux.index)
            && (objects.access.is_empty() || has_one_of(entry))
            && (types.is_empty() || types.contains(&entry.data_type))
            && match objects.subs.is_empty() {
                // Sub-index 0 of a structured object is bookkeeping, not a value.
                true => entry.mux.sub != 0 || !object.kind.has_subs(),
                false => objects.subs.contains(&entry.mux.sub) && object.kind.has_subs(),
            }
            && objects.has.iter().all(|has| states(object, entry, *has, dut))
            && !except(entry.mux)
    };
    let values = |object: &&Object| object.kind != ObjectKind::DEFTYPE;
    Ok(dut
        .eds
        .objects
        .iter()
        .filter(values)
        .flat_map(|object| object.entries.iter().filter(|entry| fits(object, entry)))
        .collect())
}

/// The indices of `1000..1FFF`.
///
/// # Errors
/// When it is none.
pub(crate) fn index_range(text: &str) -> Result<RangeInclusive<u16>, String> {
    let hex = |text: &str| u16::from_str_radix(text.trim(), 16).ok();
    let bounds = text.split_once("..").and_then(|(a, b)| hex(a).zip(hex(b)));
    let bounds = bounds.ok_or_else(|| format!("`{text}`: write a range as `1000..1FFF`"))?;
    Ok(bounds.0..=bounds.1)
}

fn states(object: &Object, entry: &Entry, has: Has, dut: &Dut) -> bool {
    let node = dut.node;
    let limits = entry.data_type.limits();
    let bound = |term: &Option<Term>| term.as_ref()?.resolve(node).as_int();
    match has {
        Has::Low => limits.zip(bound(&entry.low)).is_some_and(|((lowest, _), low)| low > lowest),
        Has::High => {
            limits.zip(bound(&entry.high)).is_some_and(|((_, highest), high)| high < highest)
        }
        Has::Default => entry.default.is_some() && !is_fixed(entry, dut),
        Has::Size => entry.data_type.size().is_some(),
        Has::Long => dut.length(entry) > 4,
        Has::Segments => dut.length(entry) > 7,
        Has::Rpdo => entry.maps_into(Direction::Receive),
        Has::Tpdo => entry.maps_into(Direction::Transmit),
        Has::Mapped => is_mapped(entry.mux, dut),
        Has::NotMappable => !entry.mappable,
        Has::NotRpdo => !entry.maps_into(Direction::Receive),
        Has::NotTpdo => !entry.maps_into(Direction::Transmit),
        Has::Scan => object.flags.unwrap_or_default() & 2 == 0,
        Has::Download => object.flags.unwrap_or_default() & 1 == 0,
        Has::Free => object.flags.is_some_and(|flags| flags & 1 == 0),
    }
}

/// Whether the limits leave no value but the default, so that nothing can be changed by a download.
fn is_fixed(entry: &Entry, dut: &Dut) -> bool {
    let number = entry.default_bytes(dut.node).ok();
    let number = number.and_then(|bytes| entry.data_type.decode(&bytes).ok()?.as_int());
    let is_only = |number| another(number, entry, dut).is_none();
    entry.access.writable() && number.is_some_and(is_only)
}

/// A value beside this one that the data sheet allows.
fn another(number: i128, entry: &Entry, dut: &Dut) -> Option<i128> {
    let bound = |term: &Option<Term>| term.as_ref()?.resolve(dut.node).as_int();
    let Some((lowest, highest)) = entry.data_type.limits() else { return Some(number + 1) };
    let (low, high) = (bound(&entry.low).unwrap_or(lowest), bound(&entry.high).unwrap_or(highest));
    let allowed = |value: &i128| *value != number && (low..=high).contains(value);
    [number + 1, number - 1, low, high].into_iter().find(allowed)
}

fn entry_scope(entry: &Entry, dut: &Dut, mut scope: Scope) -> Bound {
    let typed = |value| Binding::Value(value, entry.data_type);
    scope.bind("mux", Binding::Mux(entry.mux));
    let bytes = entry.default_bytes(dut.node).unwrap_or_default();
    if let Ok(value) = entry.data_type.decode(&bytes) {
        if let Some(another) = value.as_int().and_then(|number| another(number, entry, dut)) {
            scope.bind("another", typed(Value::Int(another)));
        }
        scope.bind("value", typed(value));
    }
    if let Some(size) = entry.data_type.size() {
        scope.bind("size", Binding::Literal(Literal::Int(size as i128)));
    }
    if let Some(word) = entry_word(entry, dut) {
        scope.bind("entry", Binding::Literal(Literal::Int(word.into())));
    }
    if let Some(object) = dut.eds.object(entry.mux.index) {
        scope.bind("kind", Binding::Literal(Literal::Int(object.kind.0.into())));
        let entries = object.entries.iter().filter(|entry| !matches!(entry.mux.sub, 0 | 0xFF));
        scope.bind("subs", Binding::Literal(Literal::Int(entries.count() as i128)));
        let subs = object.entries.iter().map(|entry| entry.mux.sub).filter(|sub| *sub != 0xFF);
        let beyond = subs.max().unwrap_or(0).saturating_add(1);
        scope.bind("beyond", Binding::Mux(Mux::new(entry.mux.index, beyond)));
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    scope.bind("shorter", Binding::Bytes(longer[..bytes.len().saturating_sub(1)].to_vec()));
    scope.bind("longer", Binding::Bytes(longer));
    for (term, at, beyond, step) in
        [(&entry.low, "low", "below", -1), (&entry.high, "high", "above", 1)]
    {
        if let Some(limit) = term.as_ref().and_then(|term| term.resolve(dut.node).as_int()) {
            scope.bind(at, typed(Value::Int(limit)));
            scope.bind(beyond, typed(Value::Int(limit + step)));
        }
    }
    (vec![entry.mux.to_string()], scope)
}

/// Whether an entry may be accessed like that.
pub(super) fn has_access(entry: &Entry, access: AccessName) -> bool {
    match access {
        AccessName::Ro => entry.access == Access::Ro,
        AccessName::Wo => entry.access == Access::Wo,
        AccessName::Const => entry.access == Access::Const,
        AccessName::Rw => entry.access.readable() && entry.access.writable(),
    }
}

#[cfg(test)]
mod tests {
    use canopen::eds::Eds;

    use super::*;

    /// What is written in place of a default of 5, within these limits.
    fn in_place_of_5(low: Option<i128>, high: Option<i128>) -> Option<i128> {
        let term = |value| Term::fixed(Value::Int(value));
        let entry = Entry {
            mux: Mux::new(0x2000, 0),
            name: String::new(),
            data_type: DataType::UNSIGNED8,
            access: Access::Rw,
            mappable: true,
            default: Some(term(5)),
            low: low.map(term),
            high: high.map(term),
            line: 0,
        };
        another(5, &entry, &Dut::new("", 1, Eds::default()))
    }

    #[test]
    fn another_value_is_within_the_limits() {
        assert_eq!(in_place_of_5(None, None), Some(6));
        assert_eq!(in_place_of_5(Some(0), Some(5)), Some(4));
        assert_eq!(in_place_of_5(Some(8), Some(9)), Some(8));
        assert_eq!(in_place_of_5(Some(0), Some(2)), Some(0));
        assert_eq!(in_place_of_5(Some(5), Some(5)), None);
    }
}
