//! `harness decode`: a trace in words.

mod lines;
mod printed;

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::catalogue::{Catalogue, Facts, Profile};
use canopen::decoder::Unit;
use canopen::eds::{Eds, Object};
use canopen::{Decoder, Mux};
use runner::dut::Sheet;

use crate::cli::DecodeArgs;
use crate::exit::{Exit, Refused};
use crate::target::{read_eds, reference_device};

pub(super) use lines::{Lines, Said};
pub(super) use printed::{Described, Printed};

/// Prints the trace in words, line by line as it comes.
///
/// # Errors
/// When the file or the data sheet cannot be read, or no line is a frame.
pub(super) fn run(args: &DecodeArgs) -> Result<Exit, Refused> {
    let catalogue = args.catalogue.load()?;
    let mut lines = Lines::of(&args.file)?;
    let described = described(args, &catalogue)?;
    let mut printed = Printed::new(&catalogue, described, args.case.clone());
    while let Some(said) = lines.next()? {
        printed.take(&said);
    }
    printed.end(&args.file)
}

/// The devices of which the user names the data sheets.
fn described(args: &DecodeArgs, catalogue: &Catalogue) -> Result<Vec<Described>, Refused> {
    args.modules.beside(args.eds.as_deref())?;
    let mut all = Vec::new();
    // What --node is about: the data sheet, or the only device.
    let mut node = args.node;
    if let Some(path) = &args.eds {
        let (sheet, eds) = read_eds(path, &args.modules)?;
        let node = node.take().ok_or_else(|| {
            Refused::usage("--eds describes one device: --node says which node it is")
        })?;
        all.push(Described::new(node, &sheet, eds));
    }
    for text in &args.device {
        let (name, id) = named(text)?;
        let device = reference_device(name, catalogue)?;
        let (sheet, eds) = Sheet::read(device.beside("eds"), device.eds_text().as_bytes());
        let id = match (id, &args.device[..]) {
            (None, [_]) => node.take(),
            (id, _) => id,
        };
        let node = id.unwrap_or(device.description.default_node);
        all.push(Described::new(node, &sheet, eds));
    }
    match (node, all.is_empty()) {
        (Some(node), false) => Err(Refused::usage(format!(
            "it is not clear which device is node {node}: each has its node id behind an @, as in \
             `--device drr460@5`"
        ))),
        _ => Ok(all),
    }
}

/// The name of a reference device with the node id behind it, if it is there.
pub(super) fn named(text: &str) -> Result<(&str, Option<u8>), Refused> {
    let Some((name, node)) = text.rsplit_once('@') else { return Ok((text, None)) };
    let id = node.parse().ok().filter(|id| (1..=127).contains(id));
    let id = id.ok_or_else(|| {
        Refused::usage(format!("`{node}` in `--device {text}` is not a node id from 1 to 127"))
    })?;
    Ok((name, Some(id)))
}

/// A decoder that knows a data sheet.
pub(super) fn decoder(node: u8, eds: &Arc<Eds>, catalogue: &Catalogue) -> Decoder {
    Decoder::of_device(node, eds, units(node, eds, catalogue))
}

/// The units of the values of a device, by CiA 301 and its profile.
fn units(node: u8, eds: &Eds, catalogue: &Catalogue) -> BTreeMap<Mux, Unit> {
    let device_type = eds.entry(Mux::new(0x1000, 0)).and_then(|entry| entry.default.as_ref());
    let number = device_type.and_then(|term| term.resolve(node).as_int()).unwrap_or(0) as u16;
    // A profile that is recognised by an object says more than that on which it builds.
    let recognised = catalogue.profiles().iter().filter(|profile| is_of(eds, node, profile));
    let mut names: Vec<String> = recognised.map(|profile| profile.name.clone()).collect();
    names.extend([format!("cia{number}"), "cia301".to_owned()]);
    let mut units = BTreeMap::new();
    for object in &eds.objects {
        let Some(known) = catalogue.lookup(&names, object.index) else { continue };
        for entry in &object.entries {
            let facts =
                if is_variable(object) { known.of_var() } else { known.of_sub(entry.mux.sub) };
            units.extend(unit(&facts).map(|unit| (entry.mux, unit)));
        }
    }
    units
}

/// Whether a data sheet has the value by which a profile is recognised.
fn is_of(eds: &Eds, node: u8, profile: &Profile) -> bool {
    let value = |mux| eds.entry(mux)?.default.as_ref()?.resolve(node).as_int();
    profile
        .recognised
        .is_some_and(|known| value(known.object).is_some_and(|value| known.fits(value as u32)))
}

fn is_variable(object: &Object) -> bool {
    !object.kind.has_subs()
}

/// `100 us` is a unit of its own in a catalogue: it counts multiples, here 100, of the unit that
/// follows.
fn unit(facts: &Facts) -> Option<Unit> {
    let text = facts.unit.as_deref()?;
    let scale = facts.scale.unwrap_or(1.0);
    let (factor, name) = match text.split_once(' ') {
        Some((number, name)) => match number.parse::<f64>() {
            Ok(factor) => (factor, name),
            Err(_) => (1.0, text),
        },
        None => (1.0, text),
    };
    Some(Unit { scale: scale * factor, name: name.to_owned() })
}
