//! Entries by their addresses, `3000:0A`, as a failure shows them: what they are in each reference
//! device.

use std::collections::BTreeMap;

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
        let eds = &device.description.eds;
        if let Some(entry) = eds.entry(mux) {
            same.entry(described(entry, eds)).or_default().push(name);
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

/// Explains an object by its name in each reference device that has it.
pub(super) fn of_devices(index: u16) -> Option<String> {
    let mut same = BTreeMap::<String, Vec<&str>>::new();
    for device in devices::all() {
        let description = &device.description;
        if let Some(object) = description.eds.object(index) {
            same.entry(object.name.clone()).or_default().push(&description.device);
        }
    }
    let mut page = Page::new(format!("object {index:04X}h of reference devices"));
    by_device(&mut page, &same);
    page.field("entries", &format!("harness explain {index:04X}:00"));
    (!same.is_empty()).then_some(page.0)
}

/// Each text with the devices of which it is true.
fn by_device(page: &mut Page, same: &BTreeMap<String, Vec<&str>>) {
    for (text, devices) in same {
        let (first, others) = devices.split_first().unwrap_or((&"", &[]));
        page.field(first, text);
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
