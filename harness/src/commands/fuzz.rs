//! `harness fuzz`: sessions of typed actions on a device, judged by a model of it.
//!
//! Sessions, model and judgement belong to [`campaign`]. Here are the bus, the files and what is
//! printed.

mod causes;
mod file;
mod model;
pub(super) mod stage;

use std::collections::BTreeMap;
use std::fs;

use campaign::{Campaign, Finding, Kind, Tally, session::Session, shrink};
use canopen::BusError;
use indicatif::{ProgressBar, ProgressDrawTarget};
use runner::stop::Stop;

use super::counted::counted;
use crate::cli::{CampaignArgs, DeviceArgs, FindingArgs, FuzzArgs, FuzzCommand};
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::reporter::say;
use crate::target::{self, Target};

use causes::{Cause, group};
use file::FindingFile;
pub(super) use model::Modelled;
use stage::Clock;

/// Runs a campaign, or what is wanted with a finding.
///
/// # Errors
/// When the target cannot be used, or a file cannot be read.
pub(super) fn run(args: &FuzzArgs, stop: &Stop) -> Result<Exit, Refused> {
    match &args.command {
        None => campaign(&args.campaign, stop),
        Some(FuzzCommand::Repro(again)) => repro(again, stop),
        Some(FuzzCommand::Shrink(again)) => shorten(again, stop),
    }
}

/// The device that is meant; a campaign is about one.
fn target(device: &DeviceArgs, stop: &Stop) -> Result<Target, Refused> {
    let selection = device.selection()?;
    if selection.target.is_none() {
        return Err(Refused::usage(
            "a campaign is about one device: --target names it, such as `--target sim:generic` or \
             `--target sim:FOLDER`",
        ));
    }
    let catalogue = selection.folders.catalogue.load()?;
    let mut targets = target::resolve(&selection, &catalogue, stop)?;
    Ok(targets.remove(0))
}

fn campaign(args: &CampaignArgs, stop: &Stop) -> Result<Exit, Refused> {
    let target = target(&args.device, stop)?;
    let _held = stop.hold();
    let mut stage = stage::open(&target)?;
    let modelled = Modelled::of(&target, &mut stage)?;
    let belief = modelled.belief()?;
    let mut campaign = Campaign::new(&modelled.blueprint, belief, args.seed);
    let clock = Clock::start(args.time);
    let bar = progress(args);
    let mut findings: Vec<Finding> = Vec::new();
    let mut stopped = None;
    let shard = args.shard.map_or((0, 1), |shard| (shard.place as u64, shard.of as u64));
    let most = args.sessions.or_else(|| args.time.map(|_| u64::MAX)).unwrap_or(SESSIONS);
    for number in (0..most).map(|count| shard.0 + count * shard.1) {
        if clock.is_over() || findings.len() >= args.max_findings {
            break;
        }
        if stop.asked() {
            stopped = Some(BusError::Interrupted);
            break;
        }
        match campaign.session(&mut stage, number) {
            Ok(found) => findings.extend(found),
            Err(error) => {
                stopped = Some(error);
                break;
            }
        }
        bar.set_message(line(campaign.tally(), findings.len(), &clock));
        bar.tick();
    }
    bar.finish_and_clear();
    let causes = group(&campaign, &modelled.blueprint, &findings);
    let mut text = String::new();
    for cause in &causes {
        text.push_str(&told(args, &target, &modelled, &campaign, cause, &findings)?);
    }
    text.push_str(&summary(&campaign, findings.len(), causes.len(), args.goals));
    say(&text);
    Ok(ending(stopped.as_ref(), !findings.is_empty()))
}

/// The sessions of a campaign that has no other limit.
const SESSIONS: u64 = 1_000;

fn ending(stopped: Option<&BusError>, found: bool) -> Exit {
    let stopped = match stopped {
        None => Exit::Green,
        Some(BusError::Interrupted) => Exit::Interrupted,
        Some(error) => {
            complain!("error: {error}");
            Exit::Bus
        }
    };
    stopped.max(if found { Exit::Findings } else { Exit::Green })
}

fn progress(args: &CampaignArgs) -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    if args.quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar
}

fn line(tally: &Tally, findings: usize, clock: &Clock) -> String {
    let seconds = clock.seconds().max(0.001);
    format!(
        "{}, {:.0} actions/s, {}, {}",
        counted(tally.sessions as usize, "session"),
        tally.actions as f64 / seconds,
        counted(tally.goals.len(), "goal"),
        counted(findings, "finding"),
    )
}

/// A cause in words; its smallest session is written to a file.
fn told(
    args: &CampaignArgs,
    target: &Target,
    modelled: &Modelled,
    campaign: &Campaign<'_>,
    cause: &Cause,
    findings: &[Finding],
) -> Result<String, Refused> {
    let first = &findings[cause.findings[0]];
    let mut session = first.session.clone();
    let short = cause.mutants.first().and_then(|mutant| modelled.shrunk(campaign, *mutant, first));
    session.actions = short.unwrap_or(session.actions);
    let file = FindingFile::of(target, args, cause, first, session);
    let mut text = format!("FINDING {}\n", cause.name);
    let times = counted(cause.findings.len(), "session");
    text.push_str(&format!("  found in     {times}, first in session {}\n", first.number));
    text.push_str(&format!("  what         {}\n", first.violation));
    for (clause, why) in &cause.says {
        text.push_str(&format!("  like         {why} ({clause})\n"));
    }
    text.push_str(&format!("  actions      {}\n", file.actions.len()));
    if let Some(folder) = &args.findings {
        let refused = |error: &std::io::Error| Refused {
            exit: Exit::File,
            message: format!("error: {}: {}", folder.display(), words(error)),
        };
        fs::create_dir_all(folder).map_err(|error| refused(&error))?;
        let path = folder.join(format!("{}.json", cause.name));
        fs::write(&path, file.text()).map_err(|error| refused(&error))?;
        text.push_str(&format!("  repeat       harness fuzz repro {}\n", path.display()));
    }
    Ok(text + "\n")
}

fn summary(campaign: &Campaign<'_>, findings: usize, causes: usize, goals: bool) -> String {
    let tally = campaign.tally();
    let mut text = format!(
        "{} with {} actions, {} pairs of state and action; {} in {}\n",
        counted(tally.sessions as usize, "session"),
        tally.actions,
        tally.goals.len(),
        counted(causes, "cause"),
        counted(findings, "finding"),
    );
    for freedom in campaign.belief().freedoms() {
        let by = freedom.clauses.join(", ");
        text.push_str(&format!("learnt: {}: {} ({by})\n", freedom.name, freedom.why));
    }
    if !tally.followed.is_empty() {
        let objects: Vec<String> = tally.followed.iter().map(ToString::to_string).collect();
        text.push_str(&format!("the application changes {}\n", objects.join(", ")));
    }
    if tally.void > 0 {
        let void = counted(tally.void as usize, "session");
        text.push_str(&format!("{void} cut short by an error of the application\n"));
    }
    if goals {
        text.push_str(&never(tally));
    }
    text
}

/// How often each kind of action was tried in how many states, the rarest first.
fn never(tally: &Tally) -> String {
    let mut counts: BTreeMap<Kind, usize> = Kind::ALL.iter().map(|kind| (*kind, 0)).collect();
    tally.goals.iter().for_each(|(_, _, kind)| *counts.entry(*kind).or_default() += 1);
    let mut rows: Vec<(Kind, usize)> = counts.into_iter().collect();
    rows.sort_by_key(|(_, count)| *count);
    let row = |(kind, count): (Kind, usize)| {
        format!("  {:<24} {}\n", kind.word(), counted(count, "state"))
    };
    rows.into_iter().map(row).collect()
}

/// Plays the session of a file again.
fn repro(args: &FindingArgs, stop: &Stop) -> Result<Exit, Refused> {
    let file = FindingFile::read(&args.file)?;
    let target = target(&file.device(&args.device), stop)?;
    let _held = stop.hold();
    let mut stage = stage::open(&target)?;
    let modelled = Modelled::of(&target, &mut stage)?;
    let session = Session { actions: file.actions.clone() };
    let again = modelled.again(&mut stage, &session)?;
    match again {
        Some(violation) => {
            say(&format!("{}\n{violation}\n", file.words()));
            Ok(Exit::Findings)
        }
        None => {
            say(&format!("{}\nnothing is wrong this time\n", file.words()));
            Ok(Exit::Green)
        }
    }
}

/// Makes the session of a file shorter.
fn shorten(args: &FindingArgs, stop: &Stop) -> Result<Exit, Refused> {
    let mut file = FindingFile::read(&args.file)?;
    let target = target(&file.device(&args.device), stop)?;
    let _held = stop.hold();
    let mut stage = stage::open(&target)?;
    let modelled = Modelled::of(&target, &mut stage)?;
    let before = file.actions.len();
    let mut failed = None;
    file.actions = shrink(&file.actions, TRIES, &mut |actions| {
        let session = Session { actions: actions.to_vec() };
        match modelled.again(&mut stage, &session) {
            Ok(found) => found.is_some() && !stop.asked(),
            Err(refused) => {
                failed = Some(refused);
                false
            }
        }
    });
    if let Some(refused) = failed {
        return Err(refused);
    }
    fs::write(&args.file, file.text()).map_err(|error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {}", args.file.display(), words(&error)),
    })?;
    say(&format!("{before} actions, now {}\n{}\n", file.actions.len(), file.words()));
    Ok(Exit::Green)
}

/// How many sessions are tried to make one shorter.
const TRIES: usize = 400;
