//! A run as data: devices, their suites, their cases. Every report is a function of a run.

use std::fmt;
use std::sync::Arc;

use canopen::{Instant, Stamped};

use crate::campaign::Campaign;
use crate::cause::Cause;
use crate::characteristics::{Characteristic, Watched};
use crate::comparison::Comparison;
use crate::event::{
    Begun, CaseEnded, CaseStarted, DeviceStarted, Event, Measured, Note, Origin, Repeated,
    RunEnded, RunStarted, Stimulus,
};
use crate::journal::{self, JournalError};
use crate::verdict::{Grade, Outcome, Problem, Verdict};

/// Of which cases the frames are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// Of every case.
    All,
    /// Of those that neither passed nor were skipped. The memory of a run then grows with what
    /// has to be explained, not with what was on the bus.
    #[default]
    Unusual,
}

/// A run, whole or as far as it came.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// How it began; `None` before the first event.
    pub started: Option<RunStarted>,
    /// The devices, in the order in which they were tested.
    pub devices: Vec<DeviceRun>,
    /// How it ended; `None` when it was cut off.
    pub ended: Option<RunEnded>,
    /// What it showed, when it is a fuzzing campaign.
    pub campaign: Option<Box<Campaign>>,
    /// The journals from which it was read, where it was.
    pub journals: Vec<Origin>,
    /// What is different from an earlier run, where one was given.
    pub comparison: Option<Comparison>,
    keep: Keep,
    watches: bool,
    running: bool,
    suite: usize,
    /// The memory of a record that was not kept, for the next one.
    spare: Box<Record>,
    /// When the present attempt at the open case began.
    attempt: Instant,
    /// The latest earlier attempt at it that failed.
    failed: Option<Box<Attempt>>,
}

/// What belongs to one attempt at a case.
#[derive(Clone, Debug, Default)]
struct Attempt {
    began: Instant,
    ended: Instant,
    frames: usize,
    record: Record,
}

/// The results of one device.
#[derive(Clone, Debug)]
pub struct DeviceRun {
    /// The device.
    pub info: DeviceStarted,
    /// The suites, in the order of their first case.
    pub suites: Vec<SuiteRun>,
    /// What its frames show, where the run [watches](Run::watching) them.
    pub(crate) watched: Option<Box<Watched>>,
}

/// The cases of one suite that ran against one device.
#[derive(Clone, Debug)]
pub struct SuiteRun {
    /// The suite, such as `cia301/heartbeat`.
    pub name: Arc<str>,
    /// Its file, relative to the folder of the project.
    pub file: Arc<str>,
    /// The instances of its cases, in the order in which they ran.
    pub cases: Vec<CaseRun>,
}

/// One instance of a case and its result.
#[derive(Clone, Debug)]
pub struct CaseRun {
    /// The case.
    pub info: CaseStarted,
    /// The verdict and what led to it; an error when the case did not come to its end.
    pub outcome: Outcome,
    /// The cause in common with the other instances that did not pass for the same reason.
    pub cause: Option<Box<Cause>>,
    /// The requirements on which the result rests.
    pub relies_on: Vec<Arc<str>>,
    /// When it was over; the last that is known of it when it did not come to its end.
    pub ended: Instant,
    /// How many frames were on the bus; of a case that was repeated, in the attempt that its
    /// verdict is about.
    pub frames: usize,
    /// Its record, where there is something in it: of most cases nothing is kept.
    record: Option<Box<Record>>,
}

/// What was done and seen in a case; of one that was repeated, in the attempt that its verdict is
/// about. Of a case that passed, steps, stimuli and frames are empty when they were not
/// [kept](Keep).
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The figures it took.
    pub measured: Vec<Measured>,
    /// Remarks, by time.
    pub notes: Vec<Note>,
    /// Its steps, by time.
    pub steps: Vec<Begun>,
    /// The stimuli on the bench, by time.
    pub stimuli: Vec<Stimulus>,
    /// The frames, by time.
    pub trace: Vec<Stamped>,
}

/// That of a case of which nothing is kept.
static NOTHING: Record = Record {
    measured: Vec::new(),
    notes: Vec::new(),
    steps: Vec::new(),
    stimuli: Vec::new(),
    trace: Vec::new(),
};

impl Run {
    /// A run of which nothing is known yet.
    pub fn new(keep: Keep) -> Self {
        Self { keep, ..Self::default() }
    }

    /// The same, which takes the characteristics of devices from their frames.
    #[must_use]
    pub fn watching(self) -> Self {
        Self { watches: true, ..self }
    }

    /// The run that a journal records, with the characteristics of its devices.
    ///
    /// # Errors
    /// The first line that is not an event, or one that cannot follow those before it.
    pub fn fold(journal: &str, keep: Keep) -> Result<Self, JournalError> {
        let mut run = Self::new(keep).watching();
        for (line, event) in journal::read(journal) {
            run.take(line, &event?)?;
        }
        Ok(run)
    }

    /// Adds the event of a line of a journal.
    ///
    /// # Errors
    /// That it cannot follow those before it.
    pub fn take(&mut self, line: usize, event: &Event) -> Result<(), JournalError> {
        let wrong = |error: OutOfOrder| JournalError { line, column: 1, why: error.to_string() };
        self.apply(event).map_err(wrong)
    }

    /// Adds an event. Frames and remarks between two cases belong to none and are left
    /// to the journal.
    ///
    /// # Errors
    /// [`OutOfOrder`] when the event cannot follow those before it; the run is then unchanged.
    pub fn apply(&mut self, event: &Event) -> Result<(), OutOfOrder> {
        match event {
            Event::RunStarted(run) => self.start_run(run),
            Event::DeviceStarted(device) => self.start_device(device),
            Event::CaseStarted(case) => self.start_case(case),
            Event::Frame(seen) => {
                if let Some(device) = self.devices.last_mut()
                    && let Some(watched) = &mut device.watched
                {
                    watched.take(device.info.node, seen);
                }
                if let Some(case) = self.open_case() {
                    case.ended = case.ended.max(seen.at);
                    case.frames += 1;
                    case.record_mut().trace.push(*seen);
                }
                Ok(())
            }
            Event::Note(note) => {
                if let Some(case) = self.open_case() {
                    case.ended = case.ended.max(note.at);
                    case.record_mut().notes.push(note.clone());
                }
                Ok(())
            }
            Event::CaseRepeated(repeated) => self.repeat_case(repeated),
            Event::Step(step) => {
                if let Some(case) = self.open_case() {
                    case.ended = case.ended.max(step.at);
                    case.record_mut().steps.push(step.clone());
                }
                Ok(())
            }
            Event::Stimulus(stimulus) => {
                if let Some(case) = self.open_case() {
                    case.ended = case.ended.max(stimulus.at);
                    case.record_mut().stimuli.push(stimulus.clone());
                }
                Ok(())
            }
            Event::Measured(measured) => {
                let case = self.open_case().ok_or(OutOfOrder("a figure belongs to no case"))?;
                case.record_mut().measured.push(measured.clone());
                Ok(())
            }
            Event::CaseEnded(end) => self.end_case(end),
            Event::Campaign(campaign) => {
                self.idle("a campaign shows something within a case")?;
                self.campaign = Some(campaign.clone());
                Ok(())
            }
            Event::RunEnded(end) => {
                self.idle("the run ends within a case")?;
                self.ended = Some(end.clone());
                Ok(())
            }
        }
    }

    /// Every case with its device, in the order of the report.
    pub fn cases(&self) -> impl Iterator<Item = (&DeviceRun, &CaseRun)> {
        self.devices.iter().flat_map(|device| device.cases().map(move |case| (device, case)))
    }

    /// The case that started last, with its device.
    pub fn latest(&self) -> Option<(&DeviceRun, &CaseRun)> {
        let device = self.devices.last()?;
        Some((device, device.suites.get(self.suite)?.cases.last()?))
    }

    /// How many cases came out how.
    pub fn counts(&self) -> Counts {
        self.cases().map(|(_, case)| case.verdict()).collect()
    }

    /// The heaviest verdict; `None` when no case ran.
    pub fn worst(&self) -> Option<Verdict> {
        self.cases().map(|(_, case)| case.verdict()).max()
    }

    /// Whether no verdict is worse than the grade of the run allows.
    pub fn is_green(&self) -> bool {
        !self.cases().any(|(_, case)| self.is_red(case.verdict()))
    }

    /// Whether a verdict is worse than the grade of the run allows.
    pub fn is_red(&self, verdict: Verdict) -> bool {
        let grade = self.started.as_ref().map_or_else(Grade::default, |run| run.grade);
        match verdict {
            Verdict::Pass | Verdict::Skip | Verdict::Blocked | Verdict::Waived => false,
            Verdict::Lenient => grade == Grade::Strict,
            // A lost frame may be the reason, unless somebody wants to know what differs.
            Verdict::Flaky => grade == Grade::Strict || self.is_repeated(),
            Verdict::Fail | Verdict::Error => true,
        }
    }

    /// Whether no case of a suite is in it, but one that stands for the run.
    pub(crate) fn has_no_case(&self) -> bool {
        self.cases().all(|(_, case)| case.info.file.is_empty())
    }

    /// Whether each case ran several times.
    pub(crate) fn is_repeated(&self) -> bool {
        self.started.as_ref().is_some_and(|run| run.repeat.is_some())
    }

    fn start_run(&mut self, run: &RunStarted) -> Result<(), OutOfOrder> {
        if self.started.is_some() {
            return Err(OutOfOrder("a second run starts"));
        }
        self.started = Some(run.clone());
        Ok(())
    }

    fn start_device(&mut self, device: &DeviceStarted) -> Result<(), OutOfOrder> {
        self.idle("a device starts within a case")?;
        let watched = self.watches.then(Box::default);
        self.devices.push(DeviceRun { info: device.clone(), suites: Vec::new(), watched });
        Ok(())
    }

    fn start_case(&mut self, case: &CaseStarted) -> Result<(), OutOfOrder> {
        self.idle("a case starts within another")?;
        let device = self.devices.last_mut().ok_or(OutOfOrder("a case starts before a device"))?;
        let suites = &mut device.suites;
        let before = self.suite;
        self.suite =
            suites.iter().position(|suite| suite.name == case.suite).unwrap_or_else(|| {
                // Most suites have all their cases by now; half of the grown capacity would stay
                // unused.
                if let Some(last) = suites.get_mut(before) {
                    last.cases.shrink_to_fit();
                }
                let (name, file) = (Arc::clone(&case.suite), Arc::clone(&case.file));
                suites.push(SuiteRun { name, file, cases: Vec::new() });
                suites.len() - 1
            });
        // What was undecided is tried again later in a run, and that counts.
        let cases = &mut suites[self.suite].cases;
        let is_tried_again = |known: &CaseRun| {
            matches!(known.outcome, Outcome::Undecided(_))
                && (&known.info.case, &known.info.instance) == (&case.case, &case.instance)
        };
        if let Some(place) = cases.iter().position(is_tried_again) {
            cases.remove(place);
        }
        cases.push(CaseRun {
            info: case.clone(),
            // Kept if no result follows: a case that did not end is an error and not forgotten.
            outcome: Outcome::Error { reason: INTERRUPTED.into(), problem: None },
            cause: None,
            relies_on: Vec::new(),
            ended: case.at,
            frames: 0,
            record: Some(std::mem::take(&mut self.spare)),
        });
        (self.running, self.attempt, self.failed) = (true, case.at, None);
        Ok(())
    }

    /// The last attempt counts, or the latest one that failed. The journal has the others.
    fn repeat_case(&mut self, repeated: &Repeated) -> Result<(), OutOfOrder> {
        let began = self.attempt;
        let case = self.open_case().ok_or(OutOfOrder("no case is repeated"))?;
        let note = Note { at: repeated.at, text: repeated.text.clone() };
        case.ended = case.ended.max(note.at);
        let mut attempt = Box::new(Attempt { began, ended: note.at, ..Attempt::default() });
        attempt.swap(case);
        case.record_mut().notes.push(note.clone());
        self.attempt = note.at;
        if repeated.failed {
            attempt.record.notes.push(note);
            self.failed = Some(attempt);
        }
        Ok(())
    }

    fn end_case(&mut self, end: &CaseEnded) -> Result<(), OutOfOrder> {
        let (keep, failed) = (self.keep, self.failed.take());
        let case = self.open_case().ok_or(OutOfOrder("a case ends that did not start"))?;
        case.ended = end.at;
        case.outcome = end.outcome.clone();
        case.cause = end.cause.clone().map(Box::new);
        case.relies_on.clone_from(&end.relies_on);
        if let Some(problem) = end.outcome.problem()
            && let Some(mut attempt) =
                failed.filter(|attempt| (attempt.began..=attempt.ended).contains(&problem.at))
        {
            attempt.swap(case);
        }
        let mut record = case.record.take().unwrap_or_default();
        if keep == Keep::Unusual && case.verdict().is_usual() {
            let (measured, notes) =
                (std::mem::take(&mut record.measured), std::mem::take(&mut record.notes));
            let said = !measured.is_empty() || !notes.is_empty();
            let kept = Record { measured, notes, ..Record::default() };
            case.record = said.then(|| Box::new(kept));
            // The next case has the room of what was not kept.
            record.steps.clear();
            record.stimuli.clear();
            record.trace.clear();
            self.spare = record;
        } else {
            record.trace.shrink_to_fit();
            case.record = Some(record);
        }
        self.running = false;
        Ok(())
    }

    fn open_case(&mut self) -> Option<&mut CaseRun> {
        if !self.running {
            return None;
        }
        self.devices.last_mut()?.suites.get_mut(self.suite)?.cases.last_mut()
    }

    /// Whether no case runs and the run goes on.
    fn idle(&self, otherwise: &'static str) -> Result<(), OutOfOrder> {
        if self.running {
            return Err(OutOfOrder(otherwise));
        }
        if self.ended.is_some() {
            return Err(OutOfOrder("the run is over"));
        }
        Ok(())
    }
}

impl Attempt {
    fn swap(&mut self, case: &mut CaseRun) {
        std::mem::swap(&mut self.frames, &mut case.frames);
        std::mem::swap(&mut self.record, case.record_mut());
    }
}

impl DeviceRun {
    /// Every case, in the order of the report.
    pub fn cases(&self) -> impl Iterator<Item = &CaseRun> {
        self.suites.iter().flat_map(|suite| &suite.cases)
    }

    /// How many cases came out how.
    pub fn counts(&self) -> Counts {
        self.cases().map(CaseRun::verdict).collect()
    }

    /// What its frames show, where they were [watched](Run::watching).
    pub fn characteristics(&self) -> Vec<Characteristic> {
        self.watched.as_ref().map(|it| it.characteristics()).unwrap_or_default()
    }
}

impl CaseRun {
    /// The verdict alone.
    pub const fn verdict(&self) -> Verdict {
        self.outcome.verdict()
    }

    /// What was done and seen in it.
    pub fn record(&self) -> &Record {
        self.record.as_deref().unwrap_or(&NOTHING)
    }

    fn record_mut(&mut self) -> &mut Record {
        self.record.get_or_insert_default()
    }

    /// The step that was judged, where it is kept.
    pub(crate) fn step_of(&self, problem: &Problem) -> Option<&Begun> {
        let place = (problem.phase, problem.place.line);
        self.record()
            .steps
            .iter()
            .rfind(|step| step.at <= problem.at && (step.phase, step.line) == place)
    }

    /// A time in the case, since it began.
    pub(crate) fn since_begin(&self, at: Instant) -> Instant {
        Instant(u64::try_from(at.since(self.info.at).as_nanos()).unwrap_or(u64::MAX))
    }

    /// How long it took on the bus.
    pub fn duration(&self) -> std::time::Duration {
        self.ended.since(self.info.at)
    }
}

/// How many cases came out how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts([usize; Verdict::ALL.len()]);

impl Counts {
    /// How many came out as `verdict`.
    pub const fn of(self, verdict: Verdict) -> usize {
        self.0[verdict as usize]
    }

    /// How many there are.
    pub fn total(self) -> usize {
        self.0.iter().sum()
    }

    /// Counts one more.
    pub const fn add(&mut self, verdict: Verdict) {
        self.0[verdict as usize] += 1;
    }
}

impl FromIterator<Verdict> for Counts {
    fn from_iter<I: IntoIterator<Item = Verdict>>(verdicts: I) -> Self {
        let mut counts = Self::default();
        verdicts.into_iter().for_each(|verdict| counts.add(verdict));
        counts
    }
}

/// `9 passed, 0 lenient, 1 failed, 0 errors, 2 skipped, 3 blocked, 1 waived, 1 flaky`; the last
/// three if there are any.
impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let errors = self.of(Verdict::Error);
        write!(
            f,
            "{} passed, {} lenient, {} failed, {errors} error{}, {} skipped",
            self.of(Verdict::Pass),
            self.of(Verdict::Lenient),
            self.of(Verdict::Fail),
            if errors == 1 { "" } else { "s" },
            self.of(Verdict::Skip),
        )?;
        let rare =
            [(Verdict::Blocked, "blocked"), (Verdict::Waived, "waived"), (Verdict::Flaky, "flaky")];
        for (verdict, word) in rare {
            match self.of(verdict) {
                0 => {}
                count => write!(f, ", {count} {word}")?,
            }
        }
        Ok(())
    }
}

/// An event that cannot follow those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfOrder(&'static str);

impl fmt::Display for OutOfOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl std::error::Error for OutOfOrder {}

/// The reason of a case that did not come to its end.
const INTERRUPTED: &str = "interrupted";
