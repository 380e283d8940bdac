//! `harness scan`: shows who is on the bus.

use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use reports::Identity;

use crate::cli::{ScanArgs, Selection};
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::scan::scan;
use crate::target;

/// Prints the nodes on a bus.
///
/// # Errors
/// When the bus cannot be used or nobody answers.
pub(crate) fn run(args: &ScanArgs, stop: &Arc<AtomicBool>) -> Result<Exit, Refused> {
    let found = if args.target.starts_with("sim:") {
        let selection = Selection::of_target(Some(&args.target));
        let mut found = Vec::new();
        for target in target::resolve(&selection, stop)? {
            let mut bus = target.open(stop)?;
            found.extend(scan(&mut *bus, None)?);
        }
        found
    } else {
        let mut bus = target::open_interface(&args.target, stop)?;
        scan(&mut *bus, None)?
    };
    if found.is_empty() {
        return Err(target::nobody(&args.target, None));
    }
    let mut text =
        String::from("node  vendor    product   revision  name                  data sheet\n");
    for found in found {
        let hex =
            |number: Option<u32>| number.map_or_else(|| "-".to_owned(), |n| format!("{n:08X}h"));
        let Identity { vendor, product, revision, .. } = found.identity;
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{:<4}  {:<8} {:<8} {:<8} {:<20}  {}",
            found.node,
            hex(vendor),
            hex(product),
            hex(revision),
            found.name.as_deref().unwrap_or("-"),
            found.device.as_deref().unwrap_or("none in this program: use --eds FILE"),
        );
    }
    say(&text);
    Ok(Exit::Green)
}
