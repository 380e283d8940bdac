//! `harness decode`: a trace in words.

mod lines;
mod printed;

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::catalogue::{Catalogue, Facts};
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
    let mut printed = Printed::new(&catalogue, described.into_iter().collect(), args.case.clone());
    while let Some(said) = lines.next()? {
        printed.take(&said);
    }
    printed.end(&args.file)
}

/// The device of which the user names the data sheet.
fn described(args: &DecodeArgs, catalogue: &Catalogue) -> Result<Option<Described>, Refused> {
    args.modules.beside(args.eds.as_deref())?;
    Ok(match (&args.eds, &args.device) {
        (Some(path), _) => {
            let (sheet, eds) = read_eds(path, &args.modules)?;
            let node = args.node.ok_or_else(|| {
                Refused::usage("--eds describes one device: --node says which node it is")
            })?;
            Some(Described::new(node, &sheet, eds))
        }
        (None, Some(name)) => {
            let device = reference_device(name, catalogue)?;
            let (sheet, eds) = Sheet::read(device.beside("eds"), device.eds_text().as_bytes());
            let node = args.node.unwrap_or(device.description.default_node);
            Some(Described::new(node, &sheet, eds))
        }
        (None, None) => None,
    })
}

/// A decoder that knows a data sheet.
pub(super) fn decoder(node: u8, eds: &Arc<Eds>, catalogue: &Catalogue) -> Decoder {
    Decoder::of_device(node, eds, units(node, eds, catalogue))
}

/// The units of the values of a device, by CiA 301 and its profile.
fn units(node: u8, eds: &Eds, catalogue: &Catalogue) -> BTreeMap<Mux, Unit> {
    let device_type = eds.entry(Mux::new(0x1000, 0)).and_then(|entry| entry.default.as_ref());
    let number = device_type.and_then(|term| term.resolve(node).as_int()).unwrap_or(0) as u16;
    let mut names = vec![format!("cia{number}"), "cia301".to_owned()];
    let eds_profile = catalogue
        .profiles()
        .iter()
        .find(|profile| profile.recognised.is_some_and(|known| eds.entry(known.object).is_some()));
    names.extend(eds_profile.map(|profile| profile.name.clone()));
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
