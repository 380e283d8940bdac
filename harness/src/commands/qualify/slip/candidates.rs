//! Which slips may break, or make use of, a part of a step: found from what was heard while a
//! device in order went through the case.

use std::time::Duration;

use canopen::eds::Eds;
use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Frame, Id, Instant, Pattern};

use super::{Change, Fate, Slip, frames, objects, times, values};
use crate::plan::Scope;
use crate::source::At;
use crate::suite::constraint::Constraint;
use crate::suite::literal::FrameText;
use crate::suite::step::Step;

/// A frame that was heard since the steps began.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Heard {
    pub at: Instant,
    pub frame: Frame,
    /// Whether the tester sent it.
    pub own: bool,
    /// The step that ran when it was taken from the bus.
    pub step: usize,
    /// Which of the frames of its identifier it is in that step, counted from 0.
    pub ordinal: u32,
}

/// A step that ran.
#[derive(Clone, Debug)]
pub(in super::super) struct Moment {
    pub step: usize,
    pub from: Instant,
    pub to: Instant,
    /// The names after it.
    pub scope: Scope,
}

/// A step of a case on a device in order, and what was heard then.
pub(super) struct Scene<'s> {
    pub step: &'s Step,
    pub moment: &'s Moment,
    /// When the steps began.
    pub begin: Instant,
    pub all: &'s [Heard],
    pub node: u8,
    pub eds: &'s Eds,
}

/// What may break the step, or this part of it, those first that do so most likely.
pub(in super::super) fn candidates(
    step: &Step,
    constraint: Option<&Constraint>,
    (moment, begin): (&Moment, Instant),
    all: &[Heard],
    (node, eds): (u8, &Eds),
) -> Vec<Slip> {
    let scene = Scene { step, moment, begin, all, node, eds };
    let Some(constraint) = constraint else { return scene.of_whole() };
    match step {
        Step::Reply(_)
        | Step::Ask(_)
        | Step::Expect(_)
        | Step::Never(_)
        | Step::Collect(_)
        | Step::Measure(_) => match constraint {
            Constraint::Low(_) | Constraint::High(_) | Constraint::After => {
                times::candidates(&scene, constraint)
            }
            Constraint::Allowance(allowance) => frames::taking(&scene, *allowance),
            _ => frames::breaking(&scene, constraint),
        },
        Step::Read(_)
        | Step::Write(_)
        | Step::Remap(_)
        | Step::Defaults(_)
        | Step::Until(_)
        | Step::Undeclared(_) => objects::candidates(&scene, constraint),
        Step::Observe(_) => values::observed(&scene),
        Step::Lss(_) | Step::Eds(_) => Vec::new(),
        Step::Send(_)
        | Step::Nmt(_)
        | Step::Wait(_)
        | Step::Sync(_)
        | Step::Produce(_)
        | Step::Bench(_) => Vec::new(),
    }
}

/// How a device goes on where one in order ended the steps by what it may refuse.
pub(in super::super) fn not_declining(
    step: &Step,
    (moment, begin): (&Moment, Instant),
    all: &[Heard],
    (node, eds): (u8, &Eds),
) -> Option<Slip> {
    objects::not_declining(&Scene { step, moment, begin, all, node, eds })
}

impl Scene<'_> {
    /// What came while the step ran.
    pub(super) fn heard(&self) -> impl DoubleEndedIterator<Item = &Heard> {
        let Moment { from, to, .. } = self.moment;
        self.all.iter().filter(move |heard| heard.at > *from && heard.at <= *to)
    }

    /// What the device sent then.
    pub(super) fn sent(&self) -> impl DoubleEndedIterator<Item = &Heard> {
        self.heard().filter(|heard| !heard.own)
    }

    /// The answers of its SDO server.
    pub(super) fn answers(&self) -> impl DoubleEndedIterator<Item = &Heard> {
        let id = Id::standard(RESPONSE_COB_ID + u16::from(self.node));
        self.sent().filter(move |heard| heard.frame.id == id)
    }

    /// So long after the steps began.
    pub(super) fn after(&self, at: Instant) -> Duration {
        at.since(self.begin)
    }

    /// The frame of that identifier before this one, in whose buffer it may be built.
    pub(super) fn before(&self, heard: &Heard) -> Option<&Heard> {
        let same = |other: &&Heard| !other.own && other.frame.id == heard.frame.id;
        self.all.iter().filter(same).take_while(|other| other.at < heard.at).last()
    }

    pub(super) fn pattern(&self, text: &At<FrameText>) -> Option<Pattern> {
        self.moment.scope.pattern(&text.value, self.node).ok()
    }

    /// The pattern of which this part does not count.
    pub(super) fn open(&self, text: &At<FrameText>, part: &Constraint) -> Option<Pattern> {
        let words = text.value.words_of(part)?;
        let open = |place| words.contains(&place);
        self.moment.scope.pattern_open(&text.value, self.node, &open).ok()
    }

    /// What may break the step as a whole.
    fn of_whole(&self) -> Vec<Slip> {
        if let Step::Never(never) = self.step {
            return frames::coming(self, &never.frame);
        }
        if let Step::Collect(collect) = self.step {
            return [
                frames::breaking(self, &Constraint::Many),
                frames::coming(self, &collect.frame),
            ]
            .concat();
        }
        let mut slips = Vec::new();
        for constraint in self.step.constraints() {
            let (moment, begin) = (self.moment, self.begin);
            let device = (self.node, self.eds);
            if constraint.is_demand() {
                let some =
                    candidates(self.step, Some(&constraint), (moment, begin), self.all, device);
                slips.extend(some.into_iter().take(2));
            }
        }
        slips.extend(objects::refusing(self));
        // Frames that are not sent while the step runs.
        let mut ids: Vec<&Heard> = Vec::new();
        for heard in self.sent() {
            if ids.iter().all(|known| known.frame.id != heard.frame.id) {
                ids.push(heard);
            }
        }
        for heard in ids {
            let id = heard.frame.id;
            let lost = Change::during(heard, self.moment.step, Fate::Lost);
            slips.push(Slip::new(format!("no frame {id} is sent")).with(lost));
            let once = Change::once(heard, Fate::Lost);
            slips.push(Slip::new(format!("a frame {id} is not sent")).with(once));
        }
        slips.extend(values::observed(self));
        slips
    }
}
