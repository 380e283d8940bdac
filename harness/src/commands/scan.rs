//! `harness scan`: lists the devices on the bus.

mod adapters;

use std::fmt::Write;
use std::sync::mpsc;
use std::time::Duration;

use canopen::catalogue::Catalogue;
use reports::Identity;
use runner::stop::Stop;

use crate::cli::ScanArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::{self, Address, Found, Selection, scan};

/// Prints the nodes on a bus.
///
/// # Errors
/// When the bus cannot be used or no node answers; with `--wait` only when the user gives up.
pub(crate) fn run(args: &ScanArgs, stop: &Stop) -> Result<Exit, Refused> {
    // Without `--adapters` there is one.
    let Some(name) = args.target.as_ref().filter(|_| !args.adapters) else {
        let found = awaited(args, stop, || Ok(adapters::plugged_in()))?;
        say(&adapters::table(&found));
        return Ok(Exit::Green);
    };
    let catalogue = args.catalogue.load()?;
    let found = awaited(args, stop, || nodes(args, name, &catalogue, stop))?;
    if found.is_empty() {
        return Err(target::nobody(name, None));
    }
    say(&table(&found));
    Ok(Exit::Green)
}

/// What `look` finds; with `--wait` when there is something.
fn awaited<T>(
    args: &ScanArgs,
    stop: &Stop,
    look: impl Fn() -> Result<Vec<T>, Refused>,
) -> Result<Vec<T>, Refused> {
    const PAUSE: Duration = Duration::from_millis(500);
    // Nothing is ever sent on this channel, so receiving from it only waits.
    let (_silent, never) = mpsc::channel::<()>();
    let mut is_told = false;
    loop {
        let why = match look() {
            Ok(found) if !args.wait || !found.is_empty() => return Ok(found),
            Ok(_) => "nothing is there yet".to_owned(),
            // An adapter that is not plugged in.
            Err(refused) if args.wait && refused.exit == Exit::Bus => refused.message,
            Err(refused) => return Err(refused),
        };
        if stop.asked() {
            return Err(Refused::interrupted());
        }
        if !std::mem::replace(&mut is_told, true) {
            complain!("waiting, Ctrl-C ends it: {}", why.trim_start_matches("error: "));
        }
        _ = never.recv_timeout(PAUSE);
    }
}

/// The nodes that answer on the target.
fn nodes(
    args: &ScanArgs,
    name: &str,
    catalogue: &Catalogue,
    stop: &Stop,
) -> Result<Vec<Found>, Refused> {
    match name.parse()? {
        Address::Simulation { .. } => {
            let selection = Selection::of_target(Some(name));
            let mut found = Vec::new();
            for target in target::resolve(&selection, catalogue, stop)? {
                let mut bus = target.open(stop)?;
                found.extend(scan(&mut *bus, None, target::rounds(name), catalogue)?);
            }
            Ok(found)
        }
        Address::Interface(interface) => {
            let interface = interface.at_bit_rate(args.bitrate);
            let mut bus = target::open_interface(&interface, stop)?;
            scan(&mut *bus, None, target::rounds(name), catalogue)
        }
    }
}

/// A line for each node, and what is odd about it.
fn table(found: &[Found]) -> String {
    let follows = |found: &Found| found.follows().unwrap_or_else(|| "-".to_owned());
    let width = found.iter().map(|found| follows(found).chars().count());
    let width = width.max().unwrap_or_default().max("profile".len());
    let mut text = format!(
        "node  vendor    product   revision  name                  {:<width$}  data sheet\n",
        "profile"
    );
    for found in found {
        let profile = follows(found);
        let hex =
            |number: Option<u32>| number.map_or_else(|| "-".to_owned(), |n| format!("{n:08X}h"));
        let Identity { vendor, product, revision, .. } = found.identity;
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{:<4}  {:<8} {:<8} {:<8} {:<20}  {profile:<width$}  {}",
            found.node,
            hex(vendor),
            hex(product),
            hex(revision),
            found.name.as_deref().unwrap_or("-"),
            found
                .device
                .as_deref()
                .unwrap_or("none in this program: use --eds FILE, or one is generated"),
        );
    }
    for found in found {
        for odd in &found.odd {
            _ = writeln!(text, "node {}: {odd}", found.node);
        }
    }
    text
}
