//! `harness list`: what would run, and why the rest would not.

use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::run::plan_all;
use super::select::select;
use crate::cli::ListArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::suite::Library;
use crate::target;

/// Lists what the arguments select.
///
/// # Errors
/// What keeps a run from starting, too.
pub(super) fn run(args: &ListArgs, stop: &Arc<AtomicBool>) -> Result<Exit, Refused> {
    let library = Library::load(&args.selection.folders)?;
    let targets = target::resolve(&args.selection, stop)?;
    let mut plans = plan_all(&library, &targets)?;
    select(&mut plans, &args.selection.patterns)?;
    let instances = plans
        .iter()
        .flat_map(|plan| plan.instances.iter().map(move |instance| (&plan.dut.name, instance)));
    if args.json {
        let rows: Vec<_> = instances
            .map(|(device, instance)| {
                let case = instance.case();
                serde_json::json!({
                    "device": device,
                    "name": instance.name(),
                    "title": case.title,
                    "checks": case.checks.iter().map(|id| &id.value).collect::<Vec<_>>(),
                    "file": instance.suite.source.name,
                    "line": case.id.place.line,
                    "skip": instance.skip,
                })
            })
            .collect();
        say(&format!("{:#}\n", serde_json::Value::from(rows)));
        return Ok(Exit::Green);
    }
    let (mut text, mut total, mut skipped) = (String::new(), 0, 0);
    for (device, instance) in instances {
        total += 1;
        // Writing to a string cannot fail.
        _ = match &instance.skip {
            None => writeln!(text, "{device}  {}", instance.name()),
            Some(reason) => {
                skipped += 1;
                writeln!(text, "{device}  {}  SKIP: {reason}", instance.name())
            }
        };
    }
    _ = writeln!(text, "\n{} would run, {skipped} would be skipped", total - skipped);
    for plan in &plans {
        if let Some(said) = plan.said_left_out() {
            _ = writeln!(text, "{}: {said}", plan.dut.name);
        }
    }
    say(&text);
    Ok(Exit::Green)
}
