//! Entries by their addresses, `3000:0A`, as a failure shows them: what they are in each reference
//! device.

use std::collections::{BTreeMap, BTreeSet};

use canopen::Mux;
use canopen::catalogue::Catalogue;
use canopen::eds::{Eds, Entry, Term};
use reference_devices::devices;

use super::{Page, object};
use crate::target::reference_device;

/// Explains an address; `None` when the text is none, or nothing is known there.
pub(super) fn entry(name: &str, catalogue: &Catalogue) -> Option<String> {
    let mux: Mux = name.parse().ok()?;
    let mut same = BTreeMap::<String, Vec<&str>>::new();
    for name in devices::names() {
        let Ok(device) = reference_device(name, Catalogue::built_in()) else { continue };
        let description = &device.description;
        if let Some(entry) = description.eds.entry(mux) {
            let means = description.notes.get(&mux).and_then(|note| note.doc.as_ref());
            let means = means.map(|doc| format!("\n{}", doc.trim())).unwrap_or_default();
            same.entry(described(entry, &description.eds) + &means).or_default().push(name);
        }
    }
    let mut page = Page::new(format!("object {mux}"));
    by_device(&mut page, &same);
    let of_object = object(mux.index, catalogue);
    match (same.is_empty(), of_object) {
        (true, object) => object,
        (false, None) => Some(page.0),
        (false, Some(object)) => Some(page.0 + "\n" + &object),
    }
}

/// What a data sheet says of an object, `2001h`, or of one of its entries, `2001:01`, and whether
/// that is specific to the manufacturer; `None` when it does not have it.
pub(super) fn of_sheet(name: &str, file: &str, eds: &Eds) -> Option<(String, bool)> {
    let mut page = Page::new(format!("object {name} in {file}"));
    let is_specific = |index: u16| (0x2000..0x6000).contains(&index);
    if let Ok(mux) = name.parse::<Mux>() {
        page.field("entry", &described(eds.entry(mux)?, eds));
        return Some((page.0, is_specific(mux.index)));
    }
    let digits = name.trim_start_matches("0x").trim_end_matches(['h', 'H']);
    let index = u16::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 4)?;
    for entry in &eds.object(index)?.entries {
        page.field(&entry.mux.to_string(), &described(entry, eds));
    }
    Some((page.0, is_specific(index)))
}

/// What the descriptions of reference devices say of an object beyond its profile, or its name
/// where no profile has it; `None` when they say nothing.
pub(super) fn of_devices(index: u16, catalogue: &Catalogue) -> Option<String> {
    let (mut known, mut is_known) = (BTreeSet::new(), false);
    for facts in catalogue.profiles().iter().filter_map(|profile| profile.lookup(index)) {
        is_known = true;
        let subs = facts.subs.values().filter_map(|facts| facts.doc.as_ref());
        known.extend(facts.doc.iter().chain(subs).map(|doc| doc.trim().to_owned()));
    }
    let mut said = BTreeMap::<Vec<String>, Vec<&str>>::new();
    for name in devices::names() {
        let Ok(device) = reference_device(name, Catalogue::built_in()) else { continue };
        let description = &device.description;
        let head = description.heads.get(&index).and_then(|note| note.doc.clone());
        let of_object = |mux: &Mux| mux.index == index;
        let notes = description.notes.iter().filter(|(mux, _)| of_object(mux));
        let has_subs = description.eds.object(index).is_some_and(|it| it.kind.has_subs());
        let docs = notes.filter_map(|(mux, note)| {
            let doc = note.doc.as_ref().filter(|doc| !known.contains(doc.trim()))?;
            // The number as the device's document writes it, and as an address has it.
            let sub = match mux.sub {
                sub @ 0..10 => format!("sub {sub}"),
                sub => format!("sub {sub} ({sub:02X}h)"),
            };
            Some(if has_subs { format!("{sub}: {}", doc.trim()) } else { doc.clone() })
        });
        let head = head.filter(|doc| !known.contains(doc.trim()));
        let object = description.eds.object(index).filter(|_| !is_known);
        let named = object.map(|object| object.name.clone());
        let texts: Vec<String> = named.into_iter().chain(head).chain(docs).collect();
        if !texts.is_empty() {
            said.entry(texts).or_default().push(name);
        }
    }
    let mut page = Page::new(format!("object {index:04X}h in reference devices"));
    for (texts, devices) in &said {
        page.field("in", &devices.join(", "));
        texts.iter().for_each(|text| page.more(text.trim()));
    }
    if !is_known {
        page.field("entries", &format!("harness explain {index:04X}:00"));
    }
    (!said.is_empty()).then_some(page.0)
}

/// Each text with the devices of which it is true.
fn by_device(page: &mut Page, same: &BTreeMap<String, Vec<&str>>) {
    for (text, devices) in same {
        let (first, others) = devices.split_first().unwrap_or((&"", &[]));
        let mut lines = text.lines();
        page.field(first, lines.next().unwrap_or_default());
        lines.for_each(|line| page.more(line));
        if !others.is_empty() {
            page.more(&format!("the same in {}", others.join(", ")));
        }
    }
}

/// Names, type, access, default and limits of an entry.
fn described(entry: &Entry, eds: &Eds) -> String {
    let of = eds.object(entry.mux.index).map(|object| object.name.clone());
    let name = of.filter(|name| *name != entry.name);
    let kind = format!("{}, {}", entry.data_type, entry.access.name());
    let shown = |what: &str, term: &Option<Term>| {
        let Term { value, plus_node } = term.as_ref()?;
        let node = if *plus_node { "node id + " } else { "" };
        Some(format!("{what} {node}{value}"))
    };
    let limits = [shown("by default", &entry.default), shown("from", &entry.low)];
    let parts = [name, Some(entry.name.clone()), Some(kind)].into_iter().chain(limits);
    let parts: Vec<String> = parts.chain([shown("to", &entry.high)]).flatten().collect();
    parts.join(", ")
}
