//! The effect of a step on a device, defined once for the code that restores it and the code that
//! judges it.
//!
//! The match names every step and has no `_` arm, so that a new step does not compile until its
//! writes are defined: an object that is written and not restored changes the verdicts of later
//! cases.

use smallvec::{SmallVec, smallvec};

use super::literal::{FrameText, Literal, ObjectRef};
use super::refusal::Refusal;
use super::step::{Produce, Step};
use crate::source::At;

/// Something that a step may change.
#[derive(Clone, Copy, Debug)]
pub enum Written<'s> {
    /// The object.
    Object(&'s At<ObjectRef>),
    /// The object that this mapping entry maps.
    Mapped(&'s At<Literal>),
    /// The objects that a device takes out of this frame.
    Frame(&'s At<FrameText>),
}

/// The demand of a step on the object that it accesses.
#[derive(Debug)]
pub struct Access<'s> {
    /// The object.
    pub object: &'s At<ObjectRef>,
    /// The values with which it is written or compared.
    pub literals: SmallVec<[&'s At<Literal>; 2]>,
    /// The refusal that is demanded instead.
    pub refused: Option<&'s At<Refusal>>,
}

/// The effect of a step. The default is a step that touches nothing.
#[derive(Debug, Default)]
pub struct Effect<'s> {
    /// Everything that the step may change in the device's dictionary.
    pub writes: SmallVec<[Written<'s>; 1]>,
    /// The one object that the step is about, when it accesses one by SDO.
    pub access: Option<Access<'s>>,
    /// The frames sent while the step watches the bus.
    pub during: Option<&'s Produce>,
    /// Whether the step needs a data sheet that says more than the device's own answers.
    pub judges_sheet: bool,
}

impl Step {
    /// The effect of the step.
    pub fn effect(&self) -> Effect<'_> {
        match self {
            Self::Send(frame) => Effect::of_frame(frame),
            Self::Ask(ask) => {
                let frames = ask.first.iter().chain([&ask.send]);
                Effect { writes: frames.map(Written::Frame).collect(), ..Effect::default() }
            }
            Self::Produce(produce) => Effect::of_frame(&produce.frame),
            Self::Expect(expect) => Effect::of_watching(expect.during.as_ref()),
            Self::Never(never) => Effect::of_watching(never.during.as_ref()),
            Self::Measure(measure) => Effect::of_watching(measure.during.as_ref()),
            Self::Collect(collect) => Effect::of_watching(collect.during.as_ref()),
            Self::Read(read) => Effect::of_access(
                &read.object,
                read.value.as_ref(),
                &[&read.min, &read.max, &read.length],
                read.refused.as_deref(),
            ),
            Self::Until(until) => Effect::of_access(
                &until.object,
                until.value.as_ref(),
                &[&until.min, &until.max],
                None,
            ),
            Self::Write(write) => Effect {
                writes: smallvec![Written::Object(&write.object)],
                ..Effect::of_access(
                    &write.object,
                    write.value.as_ref(),
                    &[],
                    write.refused.as_deref(),
                )
            },
            // A mapping is about the objects that are mapped, not about its own parameter.
            Self::Remap(remap) => {
                let mapped = remap.objects.iter().map(Written::Mapped);
                let writes = [Written::Object(&remap.pdo)].into_iter().chain(mapped).collect();
                Effect { writes, ..Effect::default() }
            }
            Self::Eds(_) | Self::Undeclared(_) => {
                Effect { judges_sheet: true, ..Effect::default() }
            }
            // What changes in another node is set back by itself.
            // SYNC makes a device take over the values that RPDOs brought before, and their frames
            // are listed. A fastscan changes the LSS state only, and a bench remembers its own
            // former state. The defaults of a generated sheet are compared with the present
            // answers, which is a fair comparison.
            Self::Reply(_)
            | Self::Defaults(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Sync(_)
            | Self::Bench(_)
            | Self::Observe(_)
            | Self::Partner(_)
            | Self::Lss(_) => Effect::default(),
        }
    }
}

impl<'s> Effect<'s> {
    fn of_frame(frame: &'s At<FrameText>) -> Self {
        Self { writes: smallvec![Written::Frame(frame)], ..Self::default() }
    }

    fn of_watching(during: Option<&'s Produce>) -> Self {
        let writes = during.map(|produce| Written::Frame(&produce.frame)).into_iter().collect();
        Self { writes, during, ..Self::default() }
    }

    fn of_access(
        object: &'s At<ObjectRef>,
        value: Option<&'s At<Literal>>,
        bounds: &[&'s Option<Box<At<Literal>>>],
        refused: Option<&'s At<Refusal>>,
    ) -> Self {
        let bounds = bounds.iter().filter_map(|bound| bound.as_deref());
        let literals = value.into_iter().chain(bounds).collect();
        Self { access: Some(Access { object, literals, refused }), ..Self::default() }
    }
}
