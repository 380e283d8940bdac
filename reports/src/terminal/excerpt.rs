//! The excerpt before a failure: the actions, and the frames that say most.

use canopen::{Instant, Stamped};

use crate::event::Begun;
use crate::run::CaseRun;
use crate::verdict::Phase;

/// The number of frames of services to show: SDO, LSS, NMT, emergency messages, boot-ups and every
/// frame of the tester.
const OF_SERVICES: usize = 12;

/// How many of the frames that devices send by themselves, such as heartbeats and PDOs.
const CYCLIC: usize = 6;

/// How many steps and remarks; stimuli are all shown.
const WORDS: usize = 16;

/// One line of the excerpt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Line<'c> {
    /// The frame in this place of the trace.
    Frame(usize),
    /// As often the two frames that follow came before.
    Again(usize),
    /// The number of frames left out here.
    Left(usize),
    /// The action at that time, in words.
    Done(Instant, Done<'c>),
}

/// An action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Done<'c> {
    /// A step began.
    Step(&'c str),
    /// Something was set on the bench: the name and its value.
    Bench(&'c str, &'c str),
    /// A remark.
    Note(&'c str),
}

/// The excerpt of a case, and how many frames it shows.
pub(super) struct Excerpt<'c> {
    pub lines: Vec<Line<'c>>,
    pub frames: usize,
}

impl<'c> Excerpt<'c> {
    /// The events until that instant. Later ones did not lead to the problem.
    pub(super) fn until(case: &'c CaseRun, until: Instant) -> Self {
        let trace = &case.trace[..case.trace.partition_point(|seen| seen.at <= until)];
        let (cyclic, services): (Vec<usize>, Vec<usize>) =
            (0..trace.len()).partition(|place| is_cyclic(&trace[*place]));
        let mut shown = fold(trace, &services);
        let by_themselves = cyclic.iter().rev().take(CYCLIC);
        shown.extend(by_themselves.map(|place| Shown { place: *place, again: 0, stands_for: 1 }));
        shown.sort_unstable_by_key(|shown| shown.place);
        let told: usize = shown.iter().map(|shown| shown.stands_for).sum();
        let from = match shown.first() {
            Some(first) if told < trace.len() => trace[first.place].at,
            _ => Instant::ZERO,
        };
        let mut done = done(case, from, until).into_iter().peekable();
        let mut lines = Vec::new();
        // Frames before the first shown one belong to the heading.
        let mut next = shown.first().map_or(0, |first| first.place);
        for Shown { place, again, stands_for } in &shown {
            let left = (place + 1).saturating_sub(next + stands_for);
            if left > 0 {
                lines.push(Line::Left(left));
            }
            next = place + 1;
            while let Some(done) = done.next_if(|(at, _)| *at < trace[*place].at) {
                lines.push(Line::Done(done.0, done.1));
            }
            if *again > 0 {
                lines.push(Line::Again(*again));
            }
            lines.push(Line::Frame(*place));
        }
        lines.extend(done.map(|(at, done)| Line::Done(at, done)));
        Self { lines, frames: told }
    }
}

/// Whether a device sends the frame cyclically, without a request.
fn is_cyclic(seen: &Stamped) -> bool {
    let Some(id) = seen.frame.id.as_standard() else { return false };
    match id {
        0x080 | 0x100 => true,
        0x181..=0x57F => !seen.own,
        // A boot-up is no heartbeat.
        0x701..=0x77F => *seen.frame.data != [0],
        _ => false,
    }
}

/// A frame that is shown.
struct Shown {
    place: usize,
    /// How often it and the next one were seen before them.
    again: usize,
    /// How many frames of the trace it stands for.
    stands_for: usize,
}

/// The last of these frames, each with the number of times that it and the next one were seen
/// before them. A question that is asked until its answer changes would else hide what led to it.
fn fold(trace: &[Stamped], of: &[usize]) -> Vec<Shown> {
    let same = |one: usize, other: usize| {
        let (one, other) = (&trace[one], &trace[other]);
        one.own == other.own && one.frame == other.frame
    };
    let (mut shown, mut rest) = (Vec::new(), of);
    while shown.len() < OF_SERVICES {
        let Some((&last, mut before)) = rest.split_last() else { break };
        shown.push(Shown { place: last, again: 0, stands_for: 1 });
        if let Some((&first, earlier)) = before.split_last()
            && (trace[first].own, trace[last].own) == (true, false)
        {
            let (mut again, mut earlier) = (0, earlier);
            while let Some((start, &[one, two])) = earlier.split_last_chunk::<2>()
                && same(one, first)
                && same(two, last)
            {
                (again, earlier) = (again + 1, start);
            }
            if again > 1 {
                shown.push(Shown { place: first, again, stands_for: 1 + 2 * again });
                before = earlier;
            }
        }
        rest = before;
    }
    shown
}

/// The actions by time: every stimulus, and the last steps and remarks from an instant on.
fn done(case: &CaseRun, from: Instant, until: Instant) -> Vec<(Instant, Done<'_>)> {
    // Stimuli have lines of their own, and the steps that undo a case come later.
    let told = |step: &&Begun| step.phase != Phase::Finally && !step.text.starts_with("bench: ");
    let steps = case.steps.iter().filter(told);
    let steps = steps.map(|step| (step.at, Done::Step(step.text.as_str())));
    let notes = case.notes.iter().map(|note| (note.at, Done::Note(note.text.as_str())));
    let mut words: Vec<_> = steps.chain(notes).filter(|(at, _)| *at >= from).collect();
    words.sort_by_key(|(at, _)| *at);
    words.retain(|(at, _)| *at <= until);
    words.drain(..words.len().saturating_sub(WORDS));
    let stimuli = case.stimuli.iter().filter(|stimulus| stimulus.at < until);
    let stimuli =
        stimuli.map(|stimulus| (stimulus.at, Done::Bench(&stimulus.name, &stimulus.says)));
    // The step after a stimulus begins at the same instant.
    let mut words: Vec<_> = stimuli.chain(words).collect();
    words.sort_by_key(|(at, _)| *at);
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(own: bool, text: &str) -> Stamped {
        let frame = text.parse().expect("a frame in candump form");
        Stamped { at: Instant::ZERO, frame, own }
    }

    #[test]
    fn a_question_that_is_asked_again_and_again_takes_one_place() {
        let (ask, answer) =
            (seen(true, "605#4002200100000000"), seen(false, "585#4F02200100000000"));
        let mut trace =
            vec![seen(true, "605#2F01200101000000"), seen(false, "585#6001200100000000")];
        for _ in 0..100 {
            trace.extend([ask, answer]);
        }
        let all: Vec<usize> = (0..trace.len()).collect();
        let shown = fold(&trace, &all);
        let again: Vec<usize> = shown.iter().rev().map(|shown| shown.again).collect();
        assert_eq!(again, [0, 0, 99, 0]);
        assert_eq!(shown.iter().map(|shown| shown.stands_for).sum::<usize>(), trace.len());
        assert!(fold(&[], &[]).is_empty());
    }

    #[test]
    fn what_comes_by_itself_is_told_from_services() {
        for (own, text, cyclic) in [
            (false, "705#05", true),
            (false, "705#00", false),
            (false, "185#0102", true),
            (true, "205#0102", false),
            (true, "080#", true),
            (false, "085#0010010000000000", false),
            (false, "585#6017100000000000", false),
            (true, "7E5#0401000000000000", false),
            (true, "000#0105", false),
        ] {
            assert_eq!(is_cyclic(&seen(own, text)), cyclic, "{text}");
        }
    }
}
