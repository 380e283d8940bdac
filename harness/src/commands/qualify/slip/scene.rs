//! A step of a case on a device without deviation, and the frames heard while it ran.

use std::time::Duration;

use canopen::eds::Eds;
use canopen::sdo::RESPONSE_COB_ID;
use canopen::{Frame, Id, Instant, Pattern};
use runner::plan::Scope;
use runner::suite::constraint::Constraint;
use runner::suite::literal::FrameText;
use runner::suite::step::Step;

use crate::source::At;

/// A frame that was heard since the steps began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heard {
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
pub(crate) struct Moment {
    pub step: usize,
    pub from: Instant,
    pub to: Instant,
    /// The names after it.
    pub scope: Scope,
}

/// A step of a case on a device without deviation, and the frames heard then.
pub(super) struct Scene<'s> {
    pub step: &'s Step,
    pub moment: &'s Moment,
    /// When the steps began.
    pub begin: Instant,
    pub all: &'s [Heard],
    pub node: u8,
    pub eds: &'s Eds,
}

impl Scene<'_> {
    /// The frames that arrived while the step ran.
    pub(super) fn heard(&self) -> impl DoubleEndedIterator<Item = &Heard> {
        let Moment { from, to, .. } = self.moment;
        self.all.iter().filter(move |heard| heard.at > *from && heard.at <= *to)
    }

    /// The frames that the device sent then.
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
}
