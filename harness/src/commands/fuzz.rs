//! `harness fuzz`: sessions of typed actions on a device, judged by a model of it.
//!
//! Sessions, model and judgement belong to [`campaign`]. Here are the bus, the files and what is
//! printed.

mod causes;
mod file;
mod model;
mod outcome;
pub(super) mod stage;

use std::fs;

use campaign::{Campaign, Finding, Tally, session::Session, shrink};
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
use outcome::{Found, Outcome};
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
    let found =
        causes.iter().map(|cause| kept(args, &target, &modelled, &campaign, cause, &findings));
    let outcome = Outcome::new(&campaign, found.collect::<Result<_, _>>()?);
    say(&if args.json { outcome.json() } else { outcome.text(args.goals) });
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

/// A cause; its smallest session is written to a file.
fn kept(
    args: &CampaignArgs,
    target: &Target,
    modelled: &Modelled,
    campaign: &Campaign<'_>,
    cause: &Cause,
    findings: &[Finding],
) -> Result<Found, Refused> {
    let first = &findings[cause.findings[0]];
    let mut session = first.session.clone();
    let short = cause.mutants.first().and_then(|mutant| modelled.shrunk(campaign, *mutant, first));
    session.actions = short.unwrap_or(session.actions);
    let actions = session.actions.len();
    let mut path = None;
    if let Some(folder) = &args.findings {
        let refused = |error: &std::io::Error| Refused {
            exit: Exit::File,
            message: format!("error: {}: {}", folder.display(), words(error)),
        };
        let file = FindingFile::of(target, args, cause, first, session);
        fs::create_dir_all(folder).map_err(|error| refused(&error))?;
        let name = folder.join(format!("{}.json", cause.name));
        fs::write(&name, file.text()).map_err(|error| refused(&error))?;
        path = Some(name);
    }
    Ok(Found::new(cause, findings, actions, path))
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
