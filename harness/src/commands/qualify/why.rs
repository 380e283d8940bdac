//! `harness qualify --why`: how a mutant is made, its changes on the bus, and the step that
//! noticed.

mod compared;
mod recording;

use std::fmt::Write;

use canopen::Decoder;
use reference_devices::change::Deviation;
use reference_devices::devices;
use reference_devices::mutant::{self, Mutant};
use reports::{Outcome, Phase, Verdict};
use runner::plan::Wording;
use runner::run::Ending;
use runner::suite::Library;
use runner::suite::model::Case;

use super::matrix::is_tried_on;
use super::trial::{Clean, Wanted};
use crate::cli::QualifyArgs;
use crate::commands::check::mutants_proved_on;
use crate::commands::counted::counted;
use crate::commands::decode::decoder;
use crate::exit::{Exit, Refused};
use crate::nearest::did_you_mean;
use crate::reporter::say;
use crate::target::{self, reference_device};

use compared::{Difference, Kind, difference, differences};
use recording::{Moment, Recorded, Recording};

/// How many instances are listed unless all are asked for.
const MOST_TRIED: usize = 12;

/// How many frames that used a `skip` up are shown.
const MOST_SKIPPED: usize = 6;

/// How many frames are shown that led to the first difference.
const BEFORE: usize = 3;

/// Prints how the mutant is made, its changes, the cases that were tried on it in their order, and
/// the first that noticed. Green if one did.
///
/// # Errors
/// When there is no such mutant, or the data of the device do not load.
pub(super) fn run(args: &QualifyArgs, library: &Library, name: &str) -> Result<Exit, Refused> {
    let (device, mutant) = find(args, library, name)?;
    let clean = Clean::planned(library, &device)?;
    let meets = |case: &Case| is_tried_on(&mutant, case);
    let wanted = Wanted::Cases(&meets);
    let without = Recording::of(&clean, Deviation::default(), &wanted)?;
    let with = Recording::of(&clean, mutant.deviation(), &wanted)?;
    let differences = differences(&with, &without);
    let mut why =
        Why { clean: &clean, mutant: &mutant, with: &with, without: &without, text: String::new() };
    why.head(&device);
    why.skips(&differences);
    why.changes(&differences);
    why.tried(&differences, args.verbose);
    let killed = why.noticed(&differences);
    say(&why.text);
    Ok(if killed { Exit::Green } else { Exit::Failed })
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

/// The text about one mutant.
struct Why<'w> {
    clean: &'w Clean<'w>,
    mutant: &'w Mutant,
    with: &'w Recording,
    without: &'w Recording,
    text: String,
}

impl Why<'_> {
    fn line(&mut self, line: &str) {
        // Writing to a string cannot fail.
        _ = writeln!(self.text, "{}", line.trim_end());
    }

    fn field(&mut self, label: &str, said: &str) {
        self.line(&format!("  {label:<13}{said}"));
    }

    /// Describes the mutant and how it is made.
    fn head(&mut self, device: &str) {
        let Self { clean, mutant, .. } = *self;
        self.line(&format!("mutant {} on {device}", mutant.name));
        self.field("why", &mutant.why);
        for id in &mutant.breaks {
            let known = clean.library.register.find(id);
            let says = known.map_or("not in the register", |known| &known.entry.value.says);
            self.field("breaks", &format!("{id}: {says}"));
        }
        if !mutant.uses.is_empty() {
            self.field("uses", &mutant.uses.join(", "));
        }
        self.field("made by", &mutant.made());
        self.field("in", &mutant.stands_in());
    }

    /// The frames that a mutant skips first. Until then both sessions are the same.
    fn skips(&mut self, differences: &[Difference]) {
        if self.with.cases().is_empty() {
            return;
        }
        let node = self.clean.target.dut.node;
        for (when, received, skip) in self.mutant.deviation().frames(node) {
            let skip = skip as usize;
            let (mut words, mut fitting) = (decoder_of(self.clean), Vec::new());
            for part in &self.without.parts {
                for (_, seen) in &part.frames {
                    let meaning = words.see(&seen.frame);
                    if seen.own == received && when.matches(&seen.frame) {
                        fitting.push((part, seen.frame, meaning));
                    }
                }
            }
            let all = counted(fitting.len(), "frame");
            if let (Some((_, frame, meaning)), []) = (fitting.get(skip), differences) {
                let meaning = self.named(meaning);
                let left = format!("{all}, but the change alters none of them, such as");
                self.field("fits", &format!("{left} {frame}  {meaning}"));
            }
            if fitting.len() <= skip {
                let than = if skip == 0 { String::new() } else { format!(", and skips {skip}") };
                self.field("fits", &format!("{all} of the whole session{than}: it changes none"));
            }
            let left = fitting.len().min(skip);
            for (place, (part, frame, meaning)) in fitting.iter().take(left).enumerate() {
                if place == MOST_SKIPPED && left > MOST_SKIPPED + 1 {
                    self.field("", &format!("... and {} more", left - place));
                    break;
                }
                let of = if part.name.is_empty() { "before the first case" } else { &part.name };
                let label = if place == 0 { "skips" } else { "" };
                let count = format!("{} of {skip}", place + 1);
                self.field(label, &format!("{count}  {frame}  {}, {of}", self.named(meaning)));
            }
        }
    }

    /// Where the frames first differ from those of the device without deviation.
    fn changes(&mut self, differences: &[Difference]) {
        let sheet = self.mutant.deviation().changes_data_sheet();
        let Some(first) = differences.first() else {
            let what = if sheet { "the data sheet, and no frame" } else { "no frame" };
            self.field("changes", &format!("{what} in any of these cases"));
            return self.changes_before();
        };
        let of = counted(self.with.cases().len(), "instance");
        let in_frames = differences.iter().filter(|one| one.kind == Kind::Frame).count();
        let what = match in_frames {
            0 => format!("the times of frames in {} of {of}", differences.len()),
            some => format!("the frames of {some} of {of}"),
        };
        self.field("changes", &what);
        self.changes_before();
        self.field("first in", &format!("{}, {}", first.with.name, self.moment(first)));
        let from = first.place.saturating_sub(BEFORE);
        let (lost, added) = first.sides();
        let both = from..first.place;
        both.for_each(|place| self.frame(' ', first.without, place));
        if lost {
            self.frame('-', first.without, first.place);
        }
        if added {
            self.frame('+', first.with, first.place);
        }
        self.field("", "- without the mutant, + with it; in seconds since the case began");
    }

    /// The changes before the first case, which no report of a run contains.
    fn changes_before(&mut self) {
        if difference(&self.with.parts[0], &self.without.parts[0]).is_some() {
            self.field("", "and what the device answers before the first case");
        }
    }

    /// When a difference shows, in words.
    fn moment(&self, first: &Difference) -> String {
        let frame = |of: &Recorded| of.frames.get(first.place).map(|(moment, _)| *moment);
        let moment = frame(first.with).or_else(|| frame(first.without)).unwrap_or_default();
        match moment {
            Moment::Settling => "before its setup".to_owned(),
            Moment::Setup => "in its setup".to_owned(),
            Moment::Step(step) => self.step(&first.with.name, step),
            Moment::After => "after its steps".to_owned(),
        }
    }

    /// A step: its line, and what it does.
    fn step(&self, instance: &str, step: usize) -> String {
        let Some(instance) = self.with.instance(instance) else { return String::new() };
        let Some(at) = instance.case().steps.get(step) else { return String::new() };
        let (words, scope) = (&instance.suite.words, Some(&instance.scope));
        let wording = Wording { words, scope, node: Some(self.clean.target.dut.node) };
        format!("line {}: {}", at.place.line, self.named(&wording.step(&at.value)))
    }

    /// A frame of an instance, in words.
    fn frame(&mut self, sign: char, of: &Recorded, place: usize) {
        let Some((_, seen)) = of.frames.get(place) else { return };
        let mut words = decoder_of(self.clean);
        for (_, before) in &of.frames[..place] {
            words.see(&before.frame);
        }
        let (way, meaning) = (if seen.own { "TX" } else { "RX" }, words.see(&seen.frame));
        let at = seen.at.since(of.begun).as_secs_f64();
        let (frame, meaning) = (seen.frame.to_string(), self.named(&meaning));
        self.line(&format!("    {sign} {at:>10.6}  {way}  {frame:<20}  {meaning}"));
    }

    /// The instances by their verdicts, in the order in which they ran.
    fn tried(&mut self, differences: &[Difference], all: bool) {
        let cases = self.with.cases();
        if cases.is_empty() {
            return self.field("tried", "nothing: no case for this device checks what it breaks");
        }
        self.field("tried", &format!("{}, in this order", counted(cases.len(), "instance")));
        let differs = |of: &Recorded| differences.iter().any(|one| one.with.name == of.name);
        for (place, of) in cases.iter().enumerate() {
            let left = cases.len() - place;
            if !all && place >= MOST_TRIED && left > 1 {
                self.field("", &format!("... and {left} more, which -v shows"));
                break;
            }
            let verdict = of.outcome.as_ref().map_or(Verdict::Skip, Outcome::verdict).to_string();
            let same = if differs(of) { "" } else { ", as without the mutant" };
            self.line(&format!("    {verdict:<9}{}{same}", of.name));
        }
        if let Some(end) = ended(&self.with.ending) {
            self.field("then", &end);
        }
    }

    /// The first case that noticed, and at which step; whether there is one.
    fn noticed(&mut self, differences: &[Difference]) -> bool {
        let with = self.with;
        let held = |name: &str| {
            let without = self.without.cases().iter().find(|without| without.name == name);
            without.is_some_and(Recorded::notices)
        };
        let notices = |of: &&Recorded| of.notices() && !held(&of.name);
        let count = with.cases().iter().filter(notices).count();
        let Some(first) = with.cases().iter().find(notices) else {
            let why = match (self.mutant.canary, differences.is_empty()) {
                (true, _) => "by nothing: it is a canary, which must survive",
                (false, true) => "by nothing: there is nothing to notice",
                (false, false) => "by nothing: no step judges what differs",
            };
            self.field("noticed", why);
            return false;
        };
        self.field("noticed", &format!("by {count}, first by {}", first.name));
        let Some(problem) = first.outcome.as_ref().and_then(Outcome::problem) else { return true };
        let at = match (problem.phase, first.shown.step) {
            (Phase::Step, Some(step)) => self.step(&first.name, step),
            (Phase::Monitor, _) => "a monitor, which watches all the time".to_owned(),
            _ => format!("line {}", problem.place.line),
        };
        self.field("at", &at);
        self.field("expected", &self.named(&problem.expected));
        self.field("came", &self.named(&problem.actual));
        true
    }

    /// The text with the names of the objects in it.
    fn named(&self, text: &str) -> String {
        self.clean.target.dut.sheet.names.in_text(text).into_owned()
    }
}

fn decoder_of(clean: &Clean) -> Decoder {
    let dut = &clean.target.dut;
    decoder(dut.node, &dut.eds, &clean.library.catalogue)
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
