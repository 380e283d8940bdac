//! What goes wrong, and how that changes the frames.

use std::time::Duration;

use canopen::{Frame, Id};

use super::edits::Edit;
use super::scene::Heard;
use super::values::Odd;

/// A slip: what goes wrong, and with which frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slip {
    /// A description of such firmware, for people.
    pub what: String,
    pub(super) changes: Vec<Change>,
    /// Unrequested frames, each with its time after the steps began.
    pub(super) unasked: Vec<(Duration, Frame)>,
    /// The wrong observation on the physical side instead, while this step runs.
    pub(super) observed: Option<(usize, Odd)>,
    /// The step after which the answers are those of a device that did not slip.
    pub(super) healed: Option<usize>,
}

/// A change to frames of one identifier.
#[derive(Clone, Debug)]
pub(super) struct Change {
    pub(super) id: Id,
    /// The step, and the first frame in it.
    pub(super) from: (usize, u32),
    /// The step, and the frame after the last one.
    pub(super) to: (usize, u32),
    pub(super) fate: Fate,
}

/// A change to one frame.
#[derive(Clone, Debug)]
pub(super) enum Fate {
    /// It is not sent.
    Lost,
    /// It is another one.
    Edited(Edit),
    /// It is sent so much later.
    Late(Duration),
    /// It is sent later by this part of the time since then.
    Slow(Duration, f64),
}

impl Slip {
    pub(super) fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), ..Self::default() }
    }

    /// The same slip, but steps after this one see answers of a device without deviation.
    pub(crate) fn healed_after(self, step: usize) -> Self {
        Self { healed: Some(step), ..self }
    }

    /// The same, beside another one.
    pub(crate) fn beside(mut self, other: &Self) -> Self {
        self.changes.splice(0..0, other.changes.iter().cloned());
        self
    }

    pub(super) fn with(mut self, change: Change) -> Self {
        self.changes.push(change);
        self
    }

    pub(super) fn and_unasked(mut self, after: Duration, frame: Frame) -> Self {
        self.unasked.push((after, frame));
        self
    }
}

impl Change {
    /// Of one frame.
    pub(super) const fn once(heard: &Heard, fate: Fate) -> Self {
        let Heard { frame, step, ordinal, .. } = heard;
        Self { id: frame.id, from: (*step, *ordinal), to: (*step, *ordinal + 1), fate }
    }

    /// Of this frame and those after it in its step.
    pub(super) const fn rest(heard: &Heard, fate: Fate) -> Self {
        let Heard { frame, step, ordinal, .. } = heard;
        Self { id: frame.id, from: (*step, *ordinal), to: (*step, u32::MAX), fate }
    }

    /// Of all such frames in the step.
    pub(super) const fn during(heard: &Heard, step: usize, fate: Fate) -> Self {
        Self { id: heard.frame.id, from: (step, 0), to: (step, u32::MAX), fate }
    }

    /// Of this frame and all after it.
    pub(super) const fn always(heard: &Heard, fate: Fate) -> Self {
        let Heard { frame, step, ordinal, .. } = heard;
        Self { id: frame.id, from: (*step, *ordinal), to: (usize::MAX, u32::MAX), fate }
    }
}
