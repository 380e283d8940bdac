//! What happened in a case, up to its problem: the frames with their meanings, and of these, of the
//! steps and of the stimuli those that say most about it. Reports show it, each in its form.

mod excerpt;
mod state;
mod subject;
mod trace;

use std::collections::BTreeMap;

use canopen::decoder::PdoLayout;
use canopen::{Decoder, Instant, Stamped};

use crate::run::{CaseRun, DeviceRun};
use crate::verdict::Phase;

use excerpt::{Excerpt, steps_until};
use subject::Subject;
use trace::Trace;

pub(crate) use excerpt::{Done, Line};

/// An excerpt of a case.
pub(crate) struct Story<'c> {
    trace: Trace<'c>,
    excerpt: Excerpt<'c>,
    /// The values that were read of the object in question.
    pub(crate) reads: Option<String>,
    /// The places of the last process data objects, where the excerpt does not show them.
    pub(crate) pdos: Vec<usize>,
    /// How many of the frames are shown.
    pub(crate) frames: String,
    /// What of them is not; `None` where there is none.
    pub(crate) left_out: Option<String>,
}

impl<'c> Story<'c> {
    /// The excerpt with at most `room` lines.
    pub(crate) fn of(device: &DeviceRun, case: &'c CaseRun, room: usize) -> Self {
        let problem = case.outcome.problem();
        let until = problem.map_or(Instant::NEVER, |problem| problem.at);
        let steps = steps_until(case, until);
        let (node, pdos) = (device.info.node, PdoLayout::clone(&device.info.pdos));
        let mut decoder = Decoder::of_layout(node, pdos, BTreeMap::new());
        let settled = problem.is_none_or(|problem| problem.phase != Phase::Settle);
        let first = steps.first().filter(|_| settled).map_or(Instant::ZERO, |step| step.at);
        let trace = Trace::read(&case.record().trace, node, &mut decoder, (first, until));
        let subject = problem.map(|problem| Subject::of(problem, &steps, &decoder));
        let subject = subject.unwrap_or_default();
        let excerpt = Excerpt::of(case, &trace, &steps, (&subject, until), room);
        let (reads, pdos) = state::known(&trace, &excerpt, &subject, &steps);
        // What came after the failure is neither shown nor left out.
        let after = case.record().trace.len() - trace.frames.len();
        let since = "in seconds since the case began";
        let frames = match (case.frames - after, excerpt.frames) {
            (0, _) => "none".to_owned(),
            (all, _) if case.record().trace.is_empty() => format!("{all}, not kept"),
            (all, some) if all == some => format!("{all}, {since}"),
            (all, some) if after > 0 => format!("{some} of {all}, up to the failure, {since}"),
            (all, some) => format!("{some} of {all}, {since}"),
        };
        let left_out = (!trace.frames.is_empty()).then(|| state::left_out(&trace, &excerpt));
        Self { trace, excerpt, reads, pdos, frames, left_out }
    }

    /// The lines, by time.
    pub(crate) fn lines(&self) -> &[(Instant, Line<'c>)] {
        &self.excerpt.lines
    }

    /// The frame in this place, and its meaning.
    pub(crate) fn frame(&self, place: usize) -> (&'c Stamped, &str) {
        (&self.trace.frames[place], &self.trace.seen[place].text)
    }

    /// The frames that are shown.
    pub(crate) fn shown(&self) -> impl Iterator<Item = &'c Stamped> {
        self.excerpt.shown.iter().map(|place| &self.trace.frames[*place])
    }
}
