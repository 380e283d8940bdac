//! The proof of `harness fuzz`: it finds mutants of the stack on the device with everything, and
//! names the requirements that they break.

use std::collections::BTreeMap;
use std::fmt::Write;

use campaign::{Campaign, Finding};
use reference_devices::devices::WITH_EVERYTHING;
use reference_devices::mutant::{self, Mutant};
use runner::parallel::{self, processors};
use runner::stop::Stop;

use crate::cli::QualifyArgs;
use crate::commands::counted::counted;
use crate::commands::fuzz::{Modelled, stage};
use crate::exit::{Exit, Refused};
use crate::reporter::say;
use crate::target::{self, Selection, Target};

/// The result of one mutant.
struct Fuzzed {
    mutant: Mutant,
    /// The number of the first session in which something was wrong.
    first: Option<u64>,
    /// Whether one of the first two guesses is a requirement that it breaks.
    named: bool,
    /// How many actions show the first finding.
    actions: Option<usize>,
}

/// How many sessions in which something is wrong lead to a guess.
const FINDINGS: usize = 4;
/// How many guesses count.
const GUESSES: usize = 2;

/// Fuzzes each mutant of the stack.
///
/// # Errors
/// When the data of the device or of a mutant do not load.
pub(super) fn run(args: &QualifyArgs, sessions: u64) -> Result<Exit, Refused> {
    let catalogue = args.folders.catalogue.load()?;
    let name = args.device.as_deref().unwrap_or(WITH_EVERYTHING);
    let selection = Selection::of_target(Some(&format!("sim:{name}")));
    let target = target::resolve(&selection, &catalogue, &Stop::default())?.remove(0);
    let mut mutants = mutant::of(&*target::reference_device(name, &catalogue)?)?;
    mutants.retain(|mutant| mutant.shared && !mutant.canary);
    let (mutants, left_out): (Vec<_>, Vec<_>) =
        mutants.into_iter().partition(|mutant| why_left_out(mutant).is_none());
    let fuzzed =
        parallel::map(mutants, processors(), |mutant| fuzzed(&target, mutant, args.seed, sessions));
    let fuzzed = fuzzed.into_iter().collect::<Result<Vec<_>, _>>()?;
    say(&(table(&fuzzed, args.verbose) + &rest(&left_out, args.verbose)));
    Ok(Exit::Green)
}

/// Why a mutant is none that messages and states of the stack show, by the way it is made; `None`
/// when they do.
fn why_left_out(mutant: &Mutant) -> Option<&'static str> {
    if mutant.is_of_data_sheet() {
        Some("the data sheet is wrong, and not the device")
    } else if mutant.deviation().of_stack().is_none() {
        Some("the application deviates, which is not known of a device")
    } else if !mutant.breaks.is_empty() && mutant.breaks.iter().all(|it| it.starts_with(PROFILE)) {
        Some("the requirement is one of the profile, about what the application does")
    } else {
        None
    }
}

/// The requirements of CiA 401.
const PROFILE: &str = "CIA401-";

/// The mutants that are left out, by the reasons.
fn rest(left_out: &[Mutant], verbose: bool) -> String {
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for mutant in left_out {
        let reason = why_left_out(mutant).unwrap_or_default();
        reasons.entry(reason).or_default().push(&mutant.name);
    }
    let mut text = String::new();
    for (reason, names) in reasons {
        // Writing to a string cannot fail.
        _ = writeln!(text, "left out: {}: {reason}", counted(names.len(), "mutant"));
        names.iter().filter(|_| verbose).for_each(|name| _ = writeln!(text, "  {name}"));
    }
    text
}

fn fuzzed(device: &Target, mutant: Mutant, seed: u64, sessions: u64) -> Result<Fuzzed, Refused> {
    let target = device.deviating(mutant.deviation())?;
    let mut stage = stage::simulated(&target)?;
    let modelled = Modelled::of(&target, &mut stage)?;
    let blueprint = &modelled.blueprint;
    let mut campaign = Campaign::new(blueprint, modelled.belief()?, seed);
    let mut findings: Vec<Finding> = Vec::new();
    for number in 0..sessions {
        // A mutant that lets no time pass is a defect of the mutant.
        let found = campaign.session(&mut stage, number);
        findings.extend(found.map_err(|error| Refused::bus(error.to_string()))?);
        if findings.len() >= FINDINGS {
            break;
        }
    }
    let first = findings.first().map(|finding| finding.number);
    let looked: Vec<&Finding> = findings.iter().collect();
    let suspects = if looked.is_empty() { Vec::new() } else { campaign.suspects(&looked) };
    let likeliest = suspects.first().map(|suspect| &suspect.mutant);
    let first_finding = findings.first();
    let short =
        first_finding.map(|found| modelled.shortest(&campaign, &mut stage, likeliest, found));
    let actions = short.map(|finding| finding.session.actions.len());
    let mut guesses: Vec<&str> = Vec::new();
    for suspect in suspects {
        let clauses = &blueprint.mutants()[suspect.mutant].clauses;
        let guess = clauses.first().map_or("", String::as_str);
        if !guesses.contains(&guess) {
            guesses.push(guess);
        }
    }
    let breaks = |guess: &&str| mutant.breaks.iter().any(|broken| broken == guess);
    let named = guesses.iter().take(GUESSES).any(breaks);
    Ok(Fuzzed { mutant, first, named, actions })
}

/// The numbers of each group of requirements, such as `CIA301-SEG`.
fn table(all: &[Fuzzed], verbose: bool) -> String {
    #[derive(Default)]
    struct Row {
        mutants: usize,
        found: usize,
        named: usize,
    }
    let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
    let mut text = String::new();
    for one in all {
        let first = one.mutant.breaks.first().map_or("", String::as_str);
        let group = first.rsplit_once('-').map_or(first, |(group, _)| group);
        for row in [group, "all"] {
            let row = rows.entry(row).or_default();
            row.mutants += 1;
            row.found += usize::from(one.first.is_some());
            row.named += usize::from(one.named);
        }
        if verbose {
            let found = match one.first {
                Some(number) => format!("found in session {number}"),
                None => "not found".to_owned(),
            };
            let named = if one.named { "named" } else { "not named" };
            // Writing to a string cannot fail.
            _ = writeln!(text, "  {}: {found}, {named} ({first})", one.mutant.name);
        }
    }
    for (group, row) in rows {
        let Row { mutants, found, named } = row;
        _ = writeln!(text, "{group:<14} {mutants:>4} mutants, {found:>4} found, {named:>4} named");
    }
    let mut actions: Vec<usize> = all.iter().filter_map(|one| one.actions).collect();
    actions.sort_unstable();
    if let Some(median) = actions.get(actions.len() / 2) {
        _ = writeln!(text, "{median} actions show the median of the findings");
    }
    text
}
