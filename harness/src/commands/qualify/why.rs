//! `harness qualify --why`: what a mutant changes on the bus, and who noticed.

use std::collections::BTreeMap;
use std::fmt::Write;

use canopen::{Decoder, Instant, Stamped};
use reference_devices::change::Deviation;
use reference_devices::devices;
use reference_devices::mutant::{self, Mutant};
use reports::Event;
use runner::run::Ending;
use runner::suite::Library;
use runner::suite::model::Case;

use super::matrix::is_tried_on;
use super::trial::{Clean, Ran, Trial, Wanted};
use crate::cli::QualifyArgs;
use crate::commands::check::mutants_proved_on;
use crate::commands::decode::decoder;
use crate::exit::{Exit, Refused};
use crate::nearest::did_you_mean;
use crate::reporter::say;
use crate::target::{self, reference_device};

/// Prints what the mutant changes, the cases that were tried on it in their order, and the first
/// that noticed. Green when one did.
///
/// # Errors
/// When there is no such mutant, or the data of the device do not load.
pub(super) fn run(args: &QualifyArgs, library: &Library, name: &str) -> Result<Exit, Refused> {
    let (device, mutant) = find(args, library, name)?;
    let clean = Clean::planned(library, &device)?;
    let meets = |case: &Case| is_tried_on(&mutant, case);
    let wanted = Wanted::Cases(&meets);
    let without = Traces::of(&clean, Deviation::default(), &wanted)?;
    let with = Traces::of(&clean, mutant.deviation(), &wanted)?;

    let mut text = format!("mutant {name} on {device}\n");
    let mut field = |label: &str, said: &str| {
        // Writing to a string cannot fail.
        _ = writeln!(text, "{}", format!("  {label:<13}{said}").trim_end());
    };
    field("why", &mutant.why);
    for id in &mutant.breaks {
        let says = library.register.find(id).map(|known| known.entry.value.says.to_string());
        field("breaks", &format!("{id}: {}", says.unwrap_or_default()));
    }
    let killing = with.ran.trials.iter().filter(|trial| trial.kills);
    let (tried, kills) = (with.ran.trials.len(), killing.count());
    let noticed = match kills {
        0 => "nobody".to_owned(),
        _ => format!("{kills} of {tried} instances"),
    };
    field("noticed by", &noticed);
    with.skips(&mutant, &clean, &mut field);
    with.first_difference(&without, &clean, &mut field);
    field("tried", "in this order");
    tries(&with.ran.trials, args.verbose, &mut field);
    if let Some(end) = ended(&with.ran.ending) {
        field("then", &end);
    }
    say(&text);
    Ok(if kills == 0 && !mutant.canary { Exit::Failed } else { Exit::Green })
}

/// The mutant of that name and the device on which it is proved.
fn find(args: &QualifyArgs, library: &Library, name: &str) -> Result<(String, Mutant), Refused> {
    let names: Vec<String> = match &args.device {
        Some(device) => target::with_variants(device, &library.catalogue)?,
        None => devices::names().map(str::to_owned).collect(),
    };
    let mut known = Vec::new();
    for device in &names {
        let described = reference_device(device, &library.catalogue)?;
        // One of the stack, too, where the device is named.
        let mutants = match args.device {
            Some(_) => mutant::of(&described)?,
            None => mutants_proved_on(&described)?,
        };
        match mutants.into_iter().find(|mutant| mutant.name == name) {
            Some(mutant) => return Ok((device.clone(), mutant)),
            None => known.extend(mutant::of(&described)?.into_iter().map(|mutant| mutant.name)),
        }
    }
    let meant = did_you_mean(name, known.iter().map(String::as_str));
    Err(Refused::usage(format!("there is no mutant `{name}`{meant}")))
}

/// What was on the bus of a run.
struct Traces {
    ran: Ran,
    /// The frames of the whole run, with the place of the instance in which they came; none before
    /// the first one.
    all: Vec<(Option<usize>, Stamped)>,
    /// By the name of the instance: its place, and when it began.
    begun: BTreeMap<String, (usize, Instant)>,
}

impl Traces {
    fn of(clean: &Clean, deviation: Deviation, wanted: &Wanted) -> Result<Self, Refused> {
        let (mut all, mut begun) = (Vec::new(), BTreeMap::new());
        let mut running = None;
        let ran = clean.shown(deviation, wanted, &mut |event| match event {
            Event::CaseStarted(started) => {
                running = Some(begun.len());
                begun.insert(started.name(), (begun.len(), started.at));
            }
            Event::Frame(seen) => all.push((running, *seen)),
            _ => {}
        })?;
        Ok(Self { ran, all, begun })
    }

    /// The frames of an instance.
    fn frames(&self, place: usize) -> impl Iterator<Item = &Stamped> {
        self.all.iter().filter(move |(of, _)| *of == Some(place)).map(|(_, seen)| seen)
    }

    /// What a mutant of frames leaves alone first.
    fn skips(&self, mutant: &Mutant, clean: &Clean, field: &mut impl FnMut(&str, &str)) {
        for (when, received, skip) in mutant.deviation().frames(clean.target.dut.node) {
            let matching = |(_, seen): &&(Option<usize>, Stamped)| {
                seen.own == received && when.matches(&seen.frame)
            };
            let mut words = decoder_of(clean);
            let left: Vec<_> = self.all.iter().filter(matching).take(skip as usize).collect();
            for (number, (of, seen)) in left.into_iter().enumerate() {
                let of = of.and_then(|of| self.ran.trials.get(of));
                let of = of.map_or("before the first case", |trial| &trial.name);
                let meaning = words.see(&seen.frame);
                let count = format!("{} of {skip}", number + 1);
                field("skipped", &format!("{count}  {}  {meaning}, {of}", seen.frame));
            }
        }
    }

    /// Where the frames first differ from those of the device without deviation.
    fn first_difference(&self, without: &Self, clean: &Clean, field: &mut impl FnMut(&str, &str)) {
        for trial in &self.ran.trials {
            let (Some((here, begun)), Some((there, _))) =
                (self.begun.get(&trial.name), without.begun.get(&trial.name))
            else {
                continue;
            };
            let (here, there): (Vec<_>, Vec<_>) =
                (self.frames(*here).collect(), without.frames(*there).collect());
            let same = |(one, other): &(&&Stamped, &&Stamped)| {
                (one.own, one.frame) == (other.own, other.frame)
            };
            let alike = here.iter().zip(&there).take_while(same).count();
            if alike == here.len() && alike == there.len() {
                continue;
            }
            field("differs in", &trial.name);
            for (label, frames) in [("without it", &there), ("with it", &here)] {
                field(label, &shown(frames, alike, *begun, clean));
            }
            return;
        }
        field("differs in", "no frame of any case: what it changes does not reach the bus there");
    }
}

/// The frame at that place, in words.
fn shown(frames: &[&Stamped], place: usize, begun: Instant, clean: &Clean) -> String {
    let Some(seen) = frames.get(place) else { return "nothing more".to_owned() };
    let mut words = decoder_of(clean);
    for before in &frames[..place] {
        words.see(&before.frame);
    }
    let way = if seen.own { "TX" } else { "RX" };
    let after = seen.at.since(begun).as_secs_f64();
    let meaning = words.see(&seen.frame);
    format!("{way}  {}  {meaning}, {after:.6} s after the case began", seen.frame)
}

fn decoder_of(clean: &Clean) -> Decoder {
    let dut = &clean.target.dut;
    decoder(dut.node, &dut.eds, &clean.library.catalogue)
}

/// The instances by their verdicts; those that did not notice are counted unless all are asked for.
fn tries(trials: &[Trial], all: bool, field: &mut impl FnMut(&str, &str)) {
    const MOST: usize = 12;
    let mut left = trials.len();
    for trial in trials {
        let shown = trials.len() - left;
        if !all && shown >= MOST {
            field("", &format!("... and {left} more, which -v shows"));
            return;
        }
        left -= 1;
        let mark = if trial.kills { "noticed" } else { "" };
        field(mark, &format!("{:<8} {}", trial.verdict.to_string(), trial.name));
        if let Some(problem) = trial.problem.as_ref().filter(|_| trial.kills) {
            field("", &format!("         {problem}"));
        }
    }
}

/// How a run ended, when not with its last case.
fn ended(ending: &Ending) -> Option<String> {
    Some(match ending {
        Ending::Complete => return None,
        Ending::Nobody => "the device did not answer at all".to_owned(),
        Ending::Gone(why) => format!("the device stopped answering: {why}"),
        Ending::Bus(why) => format!("the bus failed: {why}"),
        Ending::Enough(left) => format!("{left} more were not run"),
    })
}
