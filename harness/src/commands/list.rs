//! `harness list`: lists the cases that would run, and why the others would not.

use std::collections::BTreeMap;
use std::fmt::Write;

use canopen::catalogue::Catalogue;
use reference_devices::devices::ReferenceDevice;
use reference_devices::{devices, freedom, mutant};
use runner::plan::{Plan, is_named};
use runner::stop::Stop;

use super::check::mutants_proved_on;
use super::counted::counted;
use super::own::is_of_program;
use super::planned::{Planned, plan_beside};
use super::select::select;
use crate::cli::ListArgs;
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::{self, Selection, reference_device};

/// Lists what the arguments select.
///
/// # Errors
/// What keeps a run from starting, too.
pub(super) fn run(args: &ListArgs, stop: &Stop) -> Result<Exit, Refused> {
    let each = args.each()?;
    if let [ListArgs { selection, .. }] = &each[..]
        && let [what, words @ ..] = selection.patterns.as_slice()
        && let Some(listed) = list_of(what, words, selection)
    {
        return listed;
    }
    let plans = each.iter().map(|args| plans_of(&args.selection, stop));
    let mut plans = plans.collect::<Result<Vec<_>, _>>()?;
    select(&mut plans, each.iter().map(|args| &args.selection))?;
    let plans: Vec<Plan> = plans.into_iter().flatten().collect();
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
                    "skip": instance.skip(),
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
        _ = match instance.skip() {
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

fn plans_of(selection: &Selection, stop: &Stop) -> Result<Vec<Plan>, Refused> {
    match (&selection.target, &selection.eds) {
        (None, Some(path)) => {
            let library = selection.folders.load()?;
            plan_beside(&library, &[&target::dut_of_file(selection, path)?], &selection.others)
        }
        _ => Ok(Planned::new(selection, false, stop)?.plans),
    }
}

/// The list that a word selects, of what the other words name; `None` if it is the name of a suite
/// or a case.
fn list_of(what: &str, words: &[String], selection: &Selection) -> Option<Result<Exit, Refused>> {
    match what {
        "suites" => Some(suites(words, selection)),
        "devices" => Some(devices_of(words)),
        "mutants" => Some(named(words, selection, |device| {
            // Those that any device can be stand in the list without a target.
            let mutants = match is_of_program(&device.description.device) {
                true => mutant::of(device)?,
                false => mutants_proved_on(device)?,
            };
            Ok(mutants.into_iter().map(|mutant| (mutant.name, mutant.why)).collect())
        })),
        "freedoms" => Some(named(words, selection, |device| {
            let freedoms = freedom::of(device)?;
            Ok(freedoms.into_iter().map(|freedom| (freedom.name, freedom.why)).collect())
        })),
        "personalities" => Some(named(words, selection, |device| {
            let all = freedom::personalities(device)?;
            Ok(all.into_iter().map(|known| (known.name, known.why)).collect())
        })),
        _ => None,
    }
}

/// Whether one of the words, or a glob, is in a name. Without words, every name counts.
fn is_wanted(name: &str, words: &[String]) -> bool {
    words.is_empty() || words.iter().any(|word| name.contains(word) || is_named(word, name))
}

/// Prints the lines, or complains that nothing has such a name.
fn listed(text: &str, words: &[String]) -> Result<Exit, Refused> {
    if text.is_empty() && !words.is_empty() {
        let words: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
        let words = words.join(" or ");
        let message = format!(
            "no name in this list has {words}; without `--target` it has those of all devices, and \
             of the stack"
        );
        return Err(Refused::usage(message));
    }
    say(text);
    Ok(Exit::Green)
}

/// The reference devices, with what they are.
fn devices_of(words: &[String]) -> Result<Exit, Refused> {
    let mut text = String::new();
    for name in devices::names().filter(|name| is_wanted(name, words)) {
        let device = reference_device(name, Catalogue::built_in())?;
        // Writing to a string cannot fail.
        _ = writeln!(text, "{name}  {}", device.description.title);
    }
    listed(&text, words)
}

/// The suites, with what they are about.
fn suites(words: &[String], selection: &Selection) -> Result<Exit, Refused> {
    let library = selection.folders.load()?;
    let mut text = String::new();
    for suite in library.suites.iter().filter(|suite| is_wanted(suite.name(), words)) {
        let about = suite.file.about.as_deref().map(|about| format!("  {about}"));
        let cases = counted(suite.file.cases.len(), "case");
        // Writing to a string cannot fail.
        _ = writeln!(text, "{}  {cases}{}", suite.name(), about.unwrap_or_default());
    }
    listed(&text, words)
}

/// The named items of the reference devices, such as their mutants, each once with its devices and
/// its reason. A variant lists only those that its device does not have.
fn named(
    words: &[String],
    selection: &Selection,
    of: impl Fn(&ReferenceDevice) -> Result<Vec<(String, String)>, Refused>,
) -> Result<Exit, Refused> {
    let catalogue = selection.folders.catalogue.load()?;
    let chosen = selection.target.as_deref().and_then(|target| target.strip_prefix("sim:"));
    let chosen = chosen.or(selection.device.as_deref());
    let names: Vec<&str> = chosen.map_or_else(|| devices::names().collect(), |name| vec![name]);
    let mut all = Vec::<(String, String, Vec<&str>)>::new();
    let mut places = BTreeMap::new();
    for name in &names {
        let device = reference_device(name, &catalogue)?;
        for (known, why) in of(&device)?.into_iter().filter(|(known, _)| is_wanted(known, words)) {
            let place = *places.entry((known.clone(), why.clone())).or_insert(all.len());
            if place == all.len() {
                all.push((known, why, Vec::new()));
            }
            all[place].2.push(name);
        }
    }
    let mut text = String::new();
    for (known, why, devices) in all {
        let of = match devices.as_slice() {
            [one] => (*one).to_owned(),
            some if some.len() == names.len() => "all".to_owned(),
            [first, others @ ..] => format!("{first} and {} more", others.len()),
            [] => continue,
        };
        _ = writeln!(text, "{of}  {known}  {why}");
    }
    listed(&text, words)
}
