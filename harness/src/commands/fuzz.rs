//! `harness fuzz`: sessions of typed actions on a device, judged by a model of it.
//!
//! Sessions, model and judgement belong to [`campaign`]. Here are the bus, the files and what is
//! printed. A campaign leaves what a run leaves: see [`record`].

mod case;
mod causes;
mod file;
pub(super) mod known;
mod may;
mod model;
mod outcome;
mod prepared;
mod promote;
mod record;
pub(super) mod stage;

use std::fs;
use std::path::PathBuf;

use campaign::session::{Played, Script, Session};
use campaign::{Campaign, Finding, Stage, Tally, bytes, shrink};
use canopen::BusError;
use runner::parallel::{self, processors};
use runner::stop::Stop;

use super::counted::counted;
use crate::bus::load::Load;
use crate::cli::{CampaignArgs, FindingArgs, FuzzArgs, FuzzCommand, MAX_FINDINGS, RunArgs};
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::reporter::{Reporter, harmless, say};

pub(super) use causes::{Cause, group};
use file::FindingFile;
use may::may_do;
pub(super) use model::Modelled;
use outcome::{Outcome, found, notes_of, words_of};
use prepared::Prepared;
use record::{Record, Shown};
use stage::{Clock, Place, target_of};

/// Runs a campaign, or what is wanted with a finding.
///
/// # Errors
/// When the target cannot be used, or a file cannot be read.
pub(super) fn run(args: &FuzzArgs, stop: &Stop) -> Result<Exit, Refused> {
    match &args.command {
        None => campaign(&args.campaign, stop),
        Some(FuzzCommand::Repro(again)) => repro(again, stop),
        Some(FuzzCommand::Shrink(again)) => shorten(again, stop),
        Some(FuzzCommand::Promote(args)) => promote::run(args, stop),
    }
}

fn campaign(args: &CampaignArgs, stop: &Stop) -> Result<Exit, Refused> {
    let typed = args.as_run();
    let with_file = typed.only();
    if args.dry_run {
        say(&may_do(&target_of(&with_file?.selection, stop)?));
        return Ok(Exit::Green);
    }
    let run = with_file.as_ref().unwrap_or(&typed);
    let mut reporter = Reporter::new(run)?.without_text();
    let _held = stop.hold();
    let target = match &with_file {
        Ok(run) => target_of(&run.selection, stop),
        Err(refused) => Err(refused.clone()),
    };
    if let Some(target) = target.as_ref().ok().filter(|target| target.outlives_the_program()) {
        may_do(target).lines().for_each(|line| complain!("{}", harmless(line)));
    }
    let prepared = match &target {
        Ok(target) => Prepared::new(args, run, target, stop),
        Err(refused) => Err(refused.clone()),
    };
    match prepared {
        Ok((prepared, place)) => carry_out(args, run, stop, &prepared, place, &mut reporter),
        Err(refused) => {
            reporter.refused(run, &refused);
            Err(refused)
        }
    }
}

fn carry_out(
    args: &CampaignArgs,
    run: &RunArgs,
    stop: &Stop,
    prepared: &Prepared<'_>,
    mut place: Place<'_>,
    reporter: &mut Reporter,
) -> Result<Exit, Refused> {
    let modelled = &prepared.modelled;
    let mut campaign = Campaign::new(&modelled.blueprint, prepared.belief()?, args.seed);
    let mut record = Record::begin(reporter, prepared, run, modelled.identity);
    let (mut findings, stopped) = play(args, stop, &mut campaign, &mut place, &mut record);
    if modelled.blueprint.surface().is_some() {
        // A session of an exploration is long: mutants are held against what is left of it.
        let first = if place.repeats() > 0 { SHRUNK_ON_BUS } else { SHRUNK_FIRST };
        for finding in findings.iter_mut().take(first) {
            *finding = modelled.shortest(&campaign, &mut place, None, finding);
        }
    }
    let mut outcome = Outcome::new(&campaign);
    let why = stopped.as_ref().map(ToString::to_string);
    let load = prepared.target.load.as_ref().and_then(Load::came);
    record.sessions_over(outcome.notes().into_iter().chain(load.clone()).collect(), why.as_deref());
    for cause in group(&campaign, &modelled.blueprint, &findings) {
        let kept = kept(args, prepared, &campaign, &mut place, &cause, &findings)?;
        let surface = modelled.blueprint.surface();
        let mut found = found(&cause, &findings, &kept.finding, surface, kept.file.as_deref());
        let requirements = cause.mutants.first().map(|it| &modelled.blueprint.mutants()[*it]);
        found.waived = record.cause(&Shown {
            cause: &cause.name,
            requirements: requirements.map_or(&[], |mutant| &mutant.clauses),
            finding: &kept.finding,
            notes: notes_of(&found),
            file: kept.file.as_deref(),
        });
        outcome.0.causes.push(found);
    }
    place.give_back();
    say(&outcome.text(args.goals));
    load.iter().for_each(|said| complain!("note: {said}"));
    // Where the limit was typed, it is known.
    if stopped.is_none() && findings.len() >= args.max_findings.max(MAX_FINDINGS) {
        complain!(
            "note: it stopped after {} in which something was wrong, which is the limit; \
             `--max-findings N` sets another one",
            counted(findings.len(), "session"),
        );
    }
    record.showed(outcome.0);
    let exit = match &stopped {
        None => Exit::Green,
        Some(BusError::Interrupted) => Exit::Interrupted,
        Some(error) => {
            complain!("error: {}", harmless(&error.to_string()));
            if place.lost().is_some() { Exit::DeviceGone } else { Exit::Bus }
        }
    };
    Ok(record.end(exit, why))
}

/// The sessions of a campaign that has no other limit.
const SESSIONS: u64 = 1_000;
/// How many sessions each worker plays before all of them are judged. Those that were played for
/// nothing, since something was learnt, are few when this is small.
const AHEAD: usize = 16;
/// The same for an exploration, however many workers there are.
const GENERATION: usize = 32;

/// Plays sessions until something ends the campaign: returns what was found, and what stopped it
/// before its end. Workers play sessions ahead of the one that is judged, with the same belief; the
/// outcome is that of one after the other.
fn play(
    args: &CampaignArgs,
    stop: &Stop,
    campaign: &mut Campaign<'_>,
    place: &mut Place<'_>,
    record: &mut Record<'_>,
) -> (Vec<Finding>, Option<BusError>) {
    let clock = Clock::start(args.time);
    let workers = match place {
        Place::Virtual(_) if !record.is_budgeted() => args.jobs.map_or_else(processors, Into::into),
        // What may be done a number of times is done by one after the other.
        Place::Virtual(_) | Place::Bus(_) => 1,
    };
    let ahead = match place {
        // Its time is real: none is spent on a session that may not count.
        Place::Bus(_) => 1,
        // What was tried before steers an exploration, so the number of workers must not decide how
        // much that is.
        Place::Virtual(_) if campaign.blueprint().surface().is_some() => GENERATION,
        Place::Virtual(_) if workers == 1 => 1,
        Place::Virtual(_) => workers * AHEAD,
    };
    let (first, of) = args.shard.map_or((0, 1), |shard| (shard.place as u64, shard.of as u64));
    let most = args.sessions.or_else(|| args.time.map(|_| u64::MAX)).unwrap_or(SESSIONS);
    let mut findings: Vec<Finding> = Vec::new();
    let mut done = 0;
    while done < most {
        let last = done.saturating_add(ahead as u64).min(most);
        let numbers = (done..last).map(|count| first + count * of);
        let lessons = campaign.lessons();
        for (number, played) in played(campaign, place, numbers.collect(), args.seed, workers) {
            if stop.asked() {
                return (findings, Some(BusError::Interrupted));
            }
            let found = match played.and_then(|played| campaign.take(place, number, played)) {
                Ok(found) => found,
                Err(error) => return (findings, Some(error)),
            };
            found.iter().for_each(|finding| record.finds(finding));
            findings.extend(found);
            done += 1;
            let (part, of) = clock.part().unwrap_or((done, most));
            record.progress(part as usize, of as usize, || {
                line(campaign.tally(), findings.len(), &clock)
            });
            // Only now, since a session that was played counts.
            if clock.is_over() || findings.len() >= args.max_findings {
                return (findings, None);
            }
            if campaign.lessons() != lessons {
                break;
            }
        }
    }
    (findings, None)
}

/// The sessions of these numbers as they are played on a device that is believed to be as it is
/// now.
fn played(
    campaign: &Campaign<'_>,
    place: &mut Place<'_>,
    numbers: Vec<u64>,
    seed: u64,
    workers: usize,
) -> Vec<(u64, Result<Played, BusError>)> {
    let Place::Virtual(stage) = place else {
        return numbers.into_iter().map(|it| (it, campaign.play(place, it))).collect();
    };
    let blueprint = campaign.blueprint();
    let coverage = &campaign.tally().coverage;
    let each = numbers.into_iter().map(|it| (it, stage.clone(), campaign.belief().model()));
    parallel::map(each.collect(), workers, |(number, mut stage, model)| {
        let bytes = bytes(seed, number);
        (number, stage.play(blueprint, model, &Script::Steered(&bytes, coverage)))
    })
}

fn line(tally: &Tally, findings: usize, clock: &Clock) -> String {
    let seconds = clock.seconds().max(1.0);
    format!(
        "{}, {:.0} actions/s, {}, {}",
        counted(tally.sessions as usize, "session"),
        tally.actions as f64 / seconds,
        counted(tally.goals.len(), "goal"),
        counted(findings, "finding"),
    )
}

/// What shows a cause best.
struct Kept {
    finding: Finding,
    /// The file of it.
    file: Option<PathBuf>,
}

/// The smallest session that shows a cause; it is written to a file.
fn kept(
    args: &CampaignArgs,
    prepared: &Prepared<'_>,
    campaign: &Campaign<'_>,
    place: &mut Place<'_>,
    cause: &Cause,
    findings: &[Finding],
) -> Result<Kept, Refused> {
    let first = &findings[cause.findings[0]];
    let finding = prepared.modelled.shortest(campaign, place, cause.mutants.first(), first);
    let mut path = None;
    if let Some(folder) = &args.findings {
        let refused = |error: &std::io::Error| Refused {
            exit: Exit::File,
            message: format!("error: {}: {}", folder.display(), words(error)),
        };
        let used = prepared.modelled.blueprint.freedoms_at(&finding.used);
        let believed = used.map(|freedom| freedom.name.clone());
        let file = FindingFile::of(prepared.target, args, cause, &finding, believed.collect());
        fs::create_dir_all(folder).map_err(|error| refused(&error))?;
        let name = folder.join(format!("{}.json", cause.name));
        fs::write(&name, file.text()).map_err(|error| refused(&error))?;
        path = Some(name);
    }
    Ok(Kept { finding, file: path })
}

/// Plays the session of a file again.
fn repro(args: &FindingArgs, stop: &Stop) -> Result<Exit, Refused> {
    let file = FindingFile::read(&args.file)?;
    let selection = file.device(&args.device).selection()?;
    let target = target_of(&selection, stop)?;
    let _held = stop.hold();
    let mut stage = Place::of(&target, &selection, stop)?;
    let modelled = Modelled::of(&target, &mut stage, file.oracle.as_deref())?;
    let session = Session { actions: file.actions.clone() };
    let again = modelled.again(&mut stage, &file.freedoms, &session)?;
    let lines = words_of(&file.actions, modelled.blueprint.surface());
    let done: String = lines.iter().map(|line| format!("  {line}\n")).collect();
    let (seen, exit) = match again {
        Some(finding) => (finding.violation.to_string(), Exit::Findings),
        None => ("nothing is wrong this time".to_owned(), Exit::Green),
    };
    say(&format!("{}\n{done}{seen}\n", file.words()));
    Ok(exit)
}

/// Makes the session of a file shorter.
fn shorten(args: &FindingArgs, stop: &Stop) -> Result<Exit, Refused> {
    let mut file = FindingFile::read(&args.file)?;
    let selection = file.device(&args.device).selection()?;
    let target = target_of(&selection, stop)?;
    let _held = stop.hold();
    let mut stage = Place::of(&target, &selection, stop)?;
    let modelled = Modelled::of(&target, &mut stage, file.oracle.as_deref())?;
    let before = file.actions.len();
    let mut failed = None;
    let believed = file.freedoms.clone();
    file.actions = shrink(&file.actions, TRIES, &mut |actions| {
        // The shortest one so far is what somebody gets who does not want to wait.
        if stop.asked() {
            return false;
        }
        let session = Session { actions: actions.to_vec() };
        match modelled.again(&mut stage, &believed, &session) {
            Ok(found) => found.is_some(),
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

/// How many findings of an exploration are made shorter before their causes are sought.
const SHRUNK_FIRST: usize = 12;
/// The same where time passes for everybody.
const SHRUNK_ON_BUS: usize = 4;
/// How many sessions are tried to make one shorter.
const TRIES: usize = 400;
