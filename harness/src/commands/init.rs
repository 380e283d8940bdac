//! `harness init`: looks at a device and writes a first device file about it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canopen::Bus;
use canopen::eds::Eds;
use reports::Identity;
use runner::protect::Protection;
use runner::stop::Stop;

use crate::bus::Interface;
use crate::cli::InitArgs;
use crate::exit::{Exit, Refused};
use crate::files::{is_there, write_new};
use crate::reporter::say;
use crate::target::{
    self, Address, DEFAULT_BIT_RATE, Found, Selection, compose, reference_device, scan,
};

/// Writes the device file, and a data sheet if there is none.
///
/// # Errors
/// When no single device answers, or a file is there already or cannot be written.
pub(super) fn run(args: &InitArgs, stop: &Stop) -> Result<Exit, Refused> {
    if args.out.exists() {
        return Err(is_there(&args.out, INSTEAD));
    }
    args.modules.beside(args.eds.as_deref())?;
    let catalogue = args.catalogue.load()?;
    let (mut bus, node, bit_rate) = open(args, &catalogue, stop)?;
    let found = target::only(
        scan(&mut *bus, node, target::rounds(&args.target), &catalogue)?,
        &args.target,
        args.node,
    )?;
    let (sheet, eds) = sheet(args, &found, &mut *bus, bit_rate, &catalogue)?;
    if let Sheet::Given(path) = &sheet {
        say_other_identity(&found.identity, &eds, path);
    }
    write_new(&args.out, &text(args, &found, &sheet, &eds, bit_rate), INSTEAD)?;
    let out = args.out.display();
    say(&format!(
        "{out}: read it, then\n  harness --dut {out} --dry-run            what would be written\n  \
         harness --dut {out} --journal run.jsonl  the run, for waivers and reports\n"
    ));
    Ok(Exit::Green)
}

/// A data sheet of another device makes a run red in many places, and none of them says why.
fn say_other_identity(identity: &Identity, eds: &Eds, path: &Path) {
    let of_sheet = [("vendor", eds.device.vendor_number), ("product", eds.device.product_number)];
    let of_device = [identity.vendor, identity.product];
    for ((what, declared), said) in of_sheet.into_iter().zip(of_device) {
        if let Some(said) = said.filter(|said| declared != 0 && *said != declared) {
            complain!(
                "note: the device says {what} {said:08X}h (1018h), and {} {declared:08X}h: is this \
                 its data sheet?",
                path.display()
            );
        }
    }
}

/// A bus, the node id to ask for, and the bit rate.
type Opened = (Box<dyn Bus>, Option<u8>, Option<u32>);

fn open(
    args: &InitArgs,
    catalogue: &canopen::catalogue::Catalogue,
    stop: &Stop,
) -> Result<Opened, Refused> {
    match args.target.parse()? {
        Address::Simulation { .. } => {
            let selection = Selection {
                node: args.node,
                bitrate: args.bitrate,
                ..Selection::of_target(Some(&args.target))
            };
            let targets = target::resolve(&selection, catalogue, stop)?;
            let target = targets.first().ok_or_else(|| target::nobody(&args.target, args.node))?;
            Ok((target.open(stop)?, Some(target.dut.node), target.dut.bit_rate))
        }
        Address::Interface(interface) => {
            let interface = interface.at_bit_rate(args.bitrate);
            let bit_rate = args.bitrate.or_else(|| interface.own_bit_rate());
            Ok((target::open_interface(&interface, stop)?, args.node, bit_rate))
        }
    }
}

/// The data sheet that the file names, if it must name one, and what it says.
fn sheet(
    args: &InitArgs,
    found: &Found,
    bus: &mut dyn Bus,
    bit_rate: Option<u32>,
    catalogue: &canopen::catalogue::Catalogue,
) -> Result<(Sheet, Eds), Refused> {
    if let Some(path) = &args.eds {
        let (_, eds) = target::read_eds(path, &args.modules)?;
        return Ok((Sheet::Given(path.clone()), eds));
    }
    if let Some(name) = &found.device {
        let device = reference_device(name, catalogue)?;
        let eds = Eds::clone(&device.description.eds);
        return Ok((Sheet::OfProgram(name.clone()), eds));
    }
    let path = args.out.with_extension("eds");
    let (sheet, eds) = compose(bus, found, bit_rate.unwrap_or(DEFAULT_BIT_RATE), catalogue)?;
    write_new(&path, &sheet.source.text, "name it with `--eds`, or remove it")?;
    Ok((Sheet::Generated(path), eds))
}

/// Where the data sheet is from.
enum Sheet {
    /// The user's file.
    Given(PathBuf),
    /// Of the reference device with this name.
    OfProgram(String),
    /// Generated into this file.
    Generated(PathBuf),
}

// Writing to a string cannot fail.

fn text(args: &InitArgs, found: &Found, sheet: &Sheet, eds: &Eds, bit_rate: Option<u32>) -> String {
    let mut text = format!(
        "# Device file, written by `harness init --target {}`.\n\
         # `harness --dut FILE --dry-run` prints what a run would write, reset and store, and\n\
         # `harness --dut FILE` runs it. `harness schema dut` prints the JSON schema of these\n\
         # files. Paths are relative to the file.\n\n",
        args.target
    );
    _ = writeln!(text, "target: {}", quoted(&args.target));
    _ = writeln!(text, "node: {}  # {}", found.node, identity(found));
    say_sheet(&mut text, args, sheet, eds);
    match bit_rate {
        Some(bit_rate) => _ = writeln!(text, "bit-rate: {bit_rate}  # bit/s"),
        None => {
            _ = writeln!(text, "# The bit rate in bit/s, which the interface does not say:");
            _ = writeln!(text, "# bit-rate: 500000");
        }
    }
    text.push_str(USUAL);
    text.push_str("\nprotect:\n");
    text.push_str(
        "  # Objects that are never written: \"2000\", \"2000:01\", \"2000..20FF\".\n  \
         objects: []\n",
    );
    let mut domains = Protection::default();
    domains.protect_domains(eds, &Arc::from(""));
    say_objects(&mut text, "Objects that the data sheet calls DOMAIN", &domains, eds);
    text.push_str("  domains: true\n");
    text.push_str(STORES);
    // With a node id, there may be others, but not behind the pipes of a program.
    let interface = args.target.parse::<Interface>();
    let is_a_bus = interface.is_ok_and(|interface| interface.is_shared());
    let nmt = if args.node.is_some() && is_a_bus { "all-nodes" } else { "" };
    text.push_str(
        "  # NMT commands that are not sent: reset-node, reset-communication, all-nodes.\n",
    );
    _ = writeln!(text, "  nmt: [{nmt}]");
    text.push_str("\nallow:\n");
    let mut outputs = Protection::default();
    outputs.protect_outputs(eds, found.is_generic_io(), &Arc::from(""));
    say_objects(&mut text, "Objects that drive outputs, by the data sheet", &outputs, eds);
    text.push_str(
        "  # While one of them is on, cases that may move it are not run.\n  \
         # Set this to true where nothing can come to harm.\n  outputs: false\n",
    );
    text
}

/// The settings that most devices need, commented out.
const USUAL: &str = "
# Suites of your own beside those in the program, and the suites and cases that run.
# suites: [my-suites]
# select: [cia301, cia305]

# Options of the profile that the device does not have.
# without: [suction]

# LENIENT is not good enough; causes that are known.
# grade: strict
# waivers: waivers.yaml

# A program or a socket that operates the inputs and outputs of the device, and programs that bring
# it back: `reset` resets it, `power off` and `power on` switch its supply.
# bench: ./rig.py
# reset: ./reset.sh
# power: ./power.sh
";

/// How memory is protected at first.
const STORES: &str = "  \
    # How often 1010h (store) and 1011h (restore defaults) may be written in a run.\n  \
    stores: 0\n  \
    loads: 0\n  \
    # Layer setting services that are not used: bit-timing, node-id, store.\n  \
    lss: [bit-timing, store]\n";

fn say_sheet(text: &mut String, args: &InitArgs, sheet: &Sheet, eds: &Eds) {
    let relative = |path: &Path| {
        let folder = args.out.parent().filter(|folder| !folder.as_os_str().is_empty());
        let inside = folder.and_then(|folder| path.strip_prefix(folder).ok());
        let path = match (inside, folder) {
            (Some(inside), _) => inside.to_owned(),
            (None, None) => path.to_owned(),
            (None, Some(_)) => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
        };
        quoted(&path.display().to_string())
    };
    let count = eds.objects.len();
    let named = |text: &mut String, path: &Path| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        text.push_str("# Its name in reports, and for `device:` in suites of your own.\n");
        _ = writeln!(text, "# device: {name}");
    };
    match sheet {
        Sheet::Given(path) => {
            _ = writeln!(text, "eds: {}  # {count} objects", relative(path));
            if args.modules.is_said() {
                _ = writeln!(text, "modules: {:?}", args.modules.numbers());
            }
            named(text, path);
        }
        Sheet::OfProgram(name) => {
            _ = writeln!(text, "# The data sheet of this device is part of the program.");
            _ = writeln!(text, "# eds: my.eds");
            _ = writeln!(text, "device: {name}");
        }
        Sheet::Generated(path) => {
            text.push_str("# Generated from the answers of the device: the vendor's is better.\n");
            _ = writeln!(text, "eds: {}  # {count} objects", relative(path));
            named(text, path);
        }
    }
}

/// A comment that lists objects, the first of them by name.
fn say_objects(text: &mut String, what: &str, of: &Protection, eds: &Eds) {
    const MOST: usize = 8;
    let objects: Vec<_> =
        eds.objects.iter().filter(|object| of.has_entries_of(object.index)).collect();
    let Some((first, rest)) = objects.split_at_checked(objects.len().min(MOST)) else { return };
    if first.is_empty() {
        _ = writeln!(text, "  # {what}: none.");
        return;
    }
    _ = writeln!(text, "  # {what}:");
    for object in first {
        _ = writeln!(text, "  #   {:04X}h  {}", object.index, printable(&object.name));
    }
    if !rest.is_empty() {
        _ = writeln!(text, "  #   and {} more", rest.len());
    }
}

fn identity(found: &Found) -> String {
    let hex = |number: Option<u32>| number.map_or_else(|| "-".to_owned(), |n| format!("{n:08X}h"));
    let Identity { vendor, product, revision, .. } = found.identity;
    let name = found.name.as_deref().map(printable).unwrap_or_default();
    let follows = found.follows().map(|follows| format!(", {follows}")).unwrap_or_default();
    let numbers =
        format!("vendor {}, product {}, revision {}", hex(vendor), hex(product), hex(revision));
    let what = [name.as_str(), &numbers].into_iter().filter(|word| !word.trim().is_empty());
    what.collect::<Vec<_>>().join(", ") + &follows
}

/// Text from a device or a file, made safe for a comment.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A text of YAML.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    match text.chars().all(plain) && text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => text.to_owned(),
        false => serde_json::Value::from(text).to_string(),
    }
}

/// What to do where the file is there.
const INSTEAD: &str = "give `--out` another name, or remove it";
