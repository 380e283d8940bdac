//! The excerpt before a failure: the actions and the frames that say most about its subject.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use canopen::{Instant, Mux};

use super::subject::Subject;
use super::trace::{Group, Kind, Trace};
use crate::event::Begun;
use crate::names::addresses;
use crate::run::CaseRun;
use crate::verdict::Phase;

/// One line of the excerpt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Line<'c> {
    /// The frame in this place of the trace.
    Frame(usize),
    /// As often the frames that follow, of which there are so many, came before.
    Again(usize, usize),
    /// The number of frames of a long transfer left out here.
    Left(usize),
    /// The action, in words.
    Done(Done<'c>),
}

/// An action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Done<'c> {
    /// A step began.
    Step(&'c str),
    /// Something was set on the bench: the name and its value.
    Bench(&'c str, &'c str),
    /// A remark.
    Note(&'c str),
}

/// The excerpt of a case.
#[derive(Debug, Default)]
pub(super) struct Excerpt<'c> {
    /// By time.
    pub lines: Vec<(Instant, Line<'c>)>,
    /// How many frames they show or stand for.
    pub frames: usize,
    /// The groups that are left out, by kind, and the places of all that are shown.
    pub left: BTreeMap<Kind, usize>,
    pub shown: BTreeSet<usize>,
    /// How many actions are left out.
    pub actions: usize,
}

/// How much a line says about the failure, from most to least.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    /// The step that was judged and its last transfer, emergency messages.
    Failure,
    /// Stimuli, remarks, and writes that are about the subject.
    Setting,
    /// Any other step.
    Step,
    /// Frames about the subject, or of the step that was judged.
    Subject,
    /// Frames of services.
    Service,
    /// What a step says as well: the device has taken a value.
    Told,
    /// Never shown: frames that settled the device, and those that come by themselves and say
    /// nothing new.
    Rest,
}

/// Lines that are shown together or not at all.
struct Candidate<'c> {
    rank: Rank,
    lines: Vec<(Order, Line<'c>)>,
    /// The place of the group; `None` of an action.
    group: Option<usize>,
}

/// Time; at one instant frames, remarks, stimuli, steps; the place among these.
type Order = (Instant, u8, usize);

impl<'c> Excerpt<'c> {
    /// The lines that say most, at most `room` of them.
    pub(super) fn of(
        case: &'c CaseRun,
        trace: &Trace,
        steps: &[&'c Begun],
        (subject, until): (&Subject, Instant),
        room: usize,
    ) -> Self {
        let mut candidates = actions(case, steps, subject, until);
        candidates.extend(frames(trace, steps, subject));
        candidates.sort_by_key(|one| (one.rank, Reverse(one.lines.last().map(|line| line.0))));
        let (mut excerpt, mut lines) = (Self::default(), Vec::new());
        for Candidate { rank, lines: more, group } in candidates {
            let fits = rank < Rank::Rest && lines.len() + more.len() <= room;
            match group.map(|place| &trace.groups[place]) {
                Some(group) if fits => {
                    excerpt.frames += group.frames.len() * (1 + group.again);
                    excerpt.shown.extend(&group.frames);
                }
                Some(group) => excerpt.leave(group),
                None => excerpt.actions += usize::from(!fits),
            }
            if fits {
                lines.extend(more);
            }
        }
        lines.sort_by_key(|(order, _)| *order);
        excerpt.lines = lines.into_iter().map(|((at, ..), line)| (at, line)).collect();
        excerpt
    }

    fn leave(&mut self, group: &Group) {
        let kind = match group.kind {
            // A reader counts transfers, whatever they were about.
            Kind::Read(_) | Kind::Written(_) => Kind::Transfer,
            other => other,
        };
        let frames = if kind == Kind::Settling { group.frames.len() } else { 1 };
        *self.left.entry(kind).or_default() += frames * (1 + group.again);
    }
}

/// The groups that may be shown.
fn frames<'c>(trace: &Trace, steps: &[&Begun], subject: &Subject) -> Vec<Candidate<'c>> {
    let mut candidates = Vec::new();
    let mut cyclic = 0;
    for (place, group) in trace.groups.iter().enumerate().rev() {
        let mut rank = rank(group, trace, steps, subject);
        if group.kind.is_cyclic() && rank < Rank::Rest {
            cyclic += 1;
            // A few are enough to see that nothing else came.
            rank = if cyclic > CYCLIC { Rank::Rest } else { rank };
        }
        let at = |place: usize| (trace.frames[place].at, 0, place);
        let first = group.frames[0];
        let mut lines = Vec::new();
        if group.again > 0 {
            lines.push((at(first), Line::Again(group.again, group.frames.len())));
        }
        let (begin, end) = ends(&group.frames);
        lines.extend(begin.iter().map(|place| (at(*place), Line::Frame(*place))));
        if let left @ 1.. = group.frames.len() - begin.len() - end.len() {
            lines.push((at(end[0]), Line::Left(left)));
        }
        lines.extend(end.iter().map(|place| (at(*place), Line::Frame(*place))));
        candidates.push(Candidate { rank, lines, group: Some(place) });
    }
    candidates
}

/// The begin and the end of a long transfer; a short one has no end.
fn ends(frames: &[usize]) -> (&[usize], &[usize]) {
    match frames.len() {
        ..=LONG => (frames, &[]),
        many => (&frames[..2], &frames[many - 4..]),
    }
}

/// How much a group says.
fn rank(group: &Group, trace: &Trace, steps: &[&Begun], subject: &Subject) -> Rank {
    let judged = steps.last().map_or(Instant::ZERO, |step| step.at);
    let in_step = trace.end(group) > judged;
    let last = trace.groups.iter().rfind(|group| !group.kind.is_cyclic());
    let of_subject = subject.id == Some(trace.frames[group.frames[0]].frame.id);
    match group.kind {
        Kind::Emergency => Rank::Failure,
        Kind::SamePdo | Kind::SameState | Kind::Clock if of_subject => Rank::Subject,
        // A PDO may be late, or not come, after a SYNC.
        Kind::Clock if subject.is_pdo => Rank::Service,
        Kind::SamePdo | Kind::SameState | Kind::Clock | Kind::Settling => Rank::Rest,
        _ if in_step && last == Some(group) => Rank::Failure,
        _ if in_step || of_subject => Rank::Subject,
        Kind::Written(mux) if is_told(mux, group, trace, steps) => Rank::Told,
        Kind::Read(mux) | Kind::Written(mux) if subject.has_object(mux) => Rank::Subject,
        Kind::Read(_) | Kind::Written(_) | Kind::Transfer | Kind::NewPdo | Kind::Other => {
            Rank::Service
        }
    }
}

/// Whether the step before the transfer says that this object is written.
fn is_told(mux: Mux, group: &Group, trace: &Trace, steps: &[&Begun]) -> bool {
    let at = trace.frames[group.frames[0]].at;
    let step = steps[..steps.partition_point(|step| step.at <= at)].last();
    let writes = step.filter(|step| step.text.starts_with("write "));
    writes.is_some_and(|step| addresses(&step.text).next().is_some_and(|(of, _)| of == mux))
}

/// The actions: the steps, stimuli and remarks until then.
fn actions<'c>(
    case: &'c CaseRun,
    steps: &[&'c Begun],
    subject: &Subject,
    until: Instant,
) -> Vec<Candidate<'c>> {
    let one =
        |rank, order, done| Candidate { rank, lines: vec![(order, Line::Done(done))], group: None };
    let last = steps.len().saturating_sub(1);
    let worded = steps.iter().enumerate().filter_map(|(place, step)| {
        // Stimuli have lines of their own.
        let rank = match () {
            () if step.text.starts_with("bench: ") => return None,
            () if place == last => Rank::Failure,
            () if step.text.starts_with("write ") && subject.has_step(&step.text) => Rank::Setting,
            () => Rank::Step,
        };
        Some(one(rank, (step.at, 3, place), Done::Step(&step.text)))
    });
    let stimuli = case.record().stimuli.iter().filter(|stimulus| stimulus.at < until).enumerate();
    let stimuli = stimuli.map(|(place, stimulus)| {
        let done = Done::Bench(&stimulus.name, &stimulus.says);
        one(Rank::Setting, (stimulus.at, 2, place), done)
    });
    let notes = case.record().notes.iter().filter(|note| note.at <= until).enumerate();
    let notes =
        notes.map(|(place, note)| one(Rank::Setting, (note.at, 1, place), Done::Note(&note.text)));
    worded.chain(stimuli).chain(notes).collect()
}

/// The steps that began until then, by time. Those that undo a case come later, unless one of them
/// failed.
pub(super) fn steps_until(case: &CaseRun, until: Instant) -> Vec<&Begun> {
    let undoing = case.outcome.problem().is_some_and(|problem| problem.phase == Phase::Finally);
    let led_to = |step: &&Begun| undoing || step.phase != Phase::Finally;
    case.record().steps.iter().filter(|step| step.at <= until).filter(led_to).collect()
}

/// How many frames that come by themselves are shown.
const CYCLIC: usize = 6;
/// A transfer of more frames is cut.
const LONG: usize = 8;
