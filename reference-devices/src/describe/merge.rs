//! One object: the choices of the device on top of a profile's definition.

use std::sync::Arc;

use canopen::Mux;
use canopen::catalogue::{Catalogue, Facts, Mapping, ObjectFacts, Profile, Scalar};
use canopen::eds::{Access, Entry, Object, Term};

use super::wrong::Wrong;
use super::{Description, Note};

/// Adds the object at `index`, which must follow the existing ones, with its notes. `is_left_out`
/// is called for each sub-index, and those that it names are left out.
pub(super) fn object(
    described: &mut Description,
    catalogue: &Catalogue,
    index: u16,
    chosen: &ObjectFacts,
    is_left_out: impl FnMut(u8) -> bool,
) -> Result<(), Wrong> {
    let nothing = ObjectFacts::default();
    let known = match strangers(&described.profiles, catalogue, index) {
        Some(_) if is_whole(chosen) => None,
        Some([first, second]) => {
            let what = "say name, object, type and access here";
            let message =
                format!("{index:04X} is another object in {first} than in {second}: {what}");
            return Err(Wrong::object(index, message));
        }
        None => catalogue.lookup(&described.profiles, index),
    };
    let known = known.unwrap_or(&nothing);
    let shape = chosen.object.or(known.object).ok_or_else(|| {
        let why = "neither the device nor a profile gives its object code";
        Wrong::object(index, format!("{index:04X}: {why}"))
    })?;
    let name = chosen.name.as_ref().or(known.name.as_ref()).cloned();
    let name = name.ok_or_else(|| Wrong::object(index, format!("{index:04X} has no name")))?;
    let kind = shape.kind();

    let values = if kind.has_subs() {
        let whole = chosen.of_var().or(&known.of_var());
        Arc::make_mut(&mut described.heads).insert(index, note(&whole));
        subs(index, chosen, known, is_left_out)?
    } else {
        vec![(0, chosen.of_var().or(&known.of_var()))]
    };
    let mut entries = Vec::with_capacity(values.len());
    for (sub, facts) in values {
        let mux = Mux::new(index, sub);
        entries.push(entry(mux, &facts)?);
        Arc::make_mut(&mut described.notes).insert(mux, note(&facts));
    }
    let flags = chosen.flags.or(known.flags);
    let object = Object { index, name, kind, flags, entries, line: 0 };
    Arc::make_mut(&mut described.eds).objects.push(object);
    Ok(())
}

/// Two profiles of a device that do not build on each other and both have the index: only their
/// order would say which of them is meant.
fn strangers<'c>(
    profiles: &[String],
    catalogue: &'c Catalogue,
    index: u16,
) -> Option<[&'c str; 2]> {
    let known = profiles.iter().filter_map(|name| catalogue.profile(name));
    let known: Vec<_> = known.filter(|profile| profile.lookup(index).is_some()).collect();
    let builds_on =
        |one: &Profile, other: &Profile| one.chain().any(|base| base.name == other.name);
    let (first, others) = known.split_first()?;
    let related = |other: &Profile| builds_on(first, other) || builds_on(other, first);
    let stranger = others.iter().find(|other| !related(other))?;
    Some([&first.name, &stranger.name])
}

/// Whether a device says all that a profile would say.
fn is_whole(chosen: &ObjectFacts) -> bool {
    let typed = |facts: &Facts| facts.data_type.is_some() && facts.access.is_some();
    let all = typed(&chosen.of_var()) || chosen.subs.values().all(typed) && !chosen.subs.is_empty();
    all && chosen.name.is_some() && chosen.object.is_some()
}

/// The values of an array or record with all that is known of them, sub 0 first.
fn subs(
    index: u16,
    chosen: &ObjectFacts,
    known: &ObjectFacts,
    mut is_left_out: impl FnMut(u8) -> bool,
) -> Result<Vec<(u8, Facts)>, Wrong> {
    let mut present: Vec<u8> = match chosen.count.or(known.count) {
        Some(count) => (1..=count).collect(),
        None => chosen.subs.keys().copied().filter(|sub| *sub < STRUCTURE).collect(),
    };
    let left_out: Vec<u8> = present.iter().copied().filter(|sub| is_left_out(*sub)).collect();
    present.retain(|sub| !left_out.contains(sub));
    let Some(&highest) = present.last() else {
        let why = "neither `count` nor `subs` say how many sub-indices it has";
        return Err(Wrong::object(index, format!("{index:04X}: {why}")));
    };
    present.extend(chosen.subs.contains_key(&STRUCTURE).then_some(STRUCTURE));
    let known_to_be = |sub: &&u8| present.contains(sub) || left_out.contains(sub);
    if let Some(sub) = chosen.subs.keys().find(|sub| !known_to_be(sub)) {
        let mux = Mux::new(index, *sub);
        return Err(Wrong::entry(mux, format!("{mux} lies beyond `count: {highest}`")));
    }

    let item = chosen.item.as_ref().or(known.item.as_ref());
    let count = Facts {
        name: Some("Highest sub-index supported".into()),
        data_type: Some(canopen::DataType::UNSIGNED8),
        access: Some(Access::Ro),
        value: Some(Scalar::Int(highest.into())),
        clause: chosen.clause.clone(),
        ..Facts::default()
    };
    let mut values = vec![(0, chosen.of_sub(0).or(&known.of_sub(0)).or(&count))];
    values.extend(present.into_iter().map(|sub| {
        let numbered = Facts { name: item.map(|item| format!("{item} {sub}")), ..Facts::default() };
        (sub, chosen.of_sub(sub).or(&known.of_sub(sub)).or(&numbered))
    }));
    Ok(values)
}

fn entry(mux: Mux, facts: &Facts) -> Result<Entry, Wrong> {
    let missing = |what: &str| Wrong::entry(mux, format!("{mux} has no {what}"));
    let data_type = facts.data_type.ok_or_else(|| missing("type"))?;
    let chosen_access = facts.access.ok_or_else(|| missing("access"))?;
    let pdo = facts.pdo.unwrap_or(Mapping::No);
    let access = pdo.access(chosen_access).ok_or_else(|| {
        let (access, pdo) = (chosen_access.name(), pdo.name());
        let message = format!("{mux} has access {access}, with which `pdo: {pdo}` is not possible");
        Wrong::value(mux, "pdo", message)
    })?;
    let term = |key, scalar: &Option<Scalar>| -> Result<Option<Term>, Wrong> {
        let Some(scalar) = scalar else { return Ok(None) };
        // A value that depends on the node id has to fit with the smallest and the largest one.
        let fits = |term: &Term| {
            [1, 127].iter().all(|node| data_type.encode(&term.resolve(*node)).is_ok())
        };
        let why = || Wrong::value(mux, key, format!("{scalar} is not a value of type {data_type}"));
        scalar.term(data_type).filter(fits).map(Some).ok_or_else(why)
    };
    Ok(Entry {
        mux,
        name: facts.name.clone().ok_or_else(|| missing("name"))?,
        data_type,
        access,
        mappable: pdo != Mapping::No,
        default: term("value", &facts.value)?,
        low: term("low", &facts.low)?,
        high: term("high", &facts.high)?,
        line: 0,
    })
}

fn note(facts: &Facts) -> Note {
    Note {
        pdo: facts.pdo,
        unit: facts.unit.clone(),
        scale: facts.scale,
        doc: facts.doc.clone(),
        clause: facts.clause.clone(),
    }
}

/// The sub-index that describes its object and is none of its values (CiA 301, 7.4.2.3).
pub(super) const STRUCTURE: u8 = 0xFF;
