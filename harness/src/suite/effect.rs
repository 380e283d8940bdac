//! What a step does to a device, said once for those who restore it and those who judge it.
//!
//! Every match names every step and has no `_` arm, so that a new step does not compile before it
//! is known what it writes: an object that is written and not restored changes the verdicts of
//! later cases.

use super::literal::{FrameText, Literal, ObjectRef, Refusal};
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

/// What a step demands of the object that it accesses.
#[derive(Debug)]
pub struct Access<'s> {
    /// The object.
    pub object: &'s At<ObjectRef>,
    /// The values with which it is written or compared.
    pub literals: Vec<&'s At<Literal>>,
    /// The refusal that is demanded instead.
    pub refused: Option<&'s At<Refusal>>,
}

impl Step {
    /// Everything that the step may change in the device's dictionary.
    pub fn writes(&self) -> Vec<Written<'_>> {
        match self {
            Self::Write(write) => vec![Written::Object(&write.object)],
            Self::Remap(remap) => {
                let mapped = remap.objects.iter().map(Written::Mapped);
                [Written::Object(&remap.pdo)].into_iter().chain(mapped).collect()
            }
            Self::Send(frame) => vec![Written::Frame(frame)],
            Self::Ask(ask) => vec![Written::Frame(&ask.send)],
            Self::Produce(produce) => vec![Written::Frame(&produce.frame)],
            Self::Expect(_) | Self::Never(_) | Self::Measure(_) | Self::Collect(_) => {
                self.during().map(|produce| Written::Frame(&produce.frame)).into_iter().collect()
            }
            // SYNC makes a device take over what RPDOs brought before, and their frames are listed.
            // A fastscan changes the LSS state only, and a bench has its own memory of what it was.
            Self::Reply(_)
            | Self::Read(_)
            | Self::Defaults(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Until(_)
            | Self::Sync(_)
            | Self::Bench(_)
            | Self::Observe(_)
            | Self::Eds(_)
            | Self::Undeclared(_)
            | Self::Lss(_) => Vec::new(),
        }
    }

    /// The one object that the step is about, when it accesses one by SDO.
    pub fn access(&self) -> Option<Access<'_>> {
        match self {
            Self::Read(read) => access(
                &read.object,
                &[&read.value, &read.min, &read.max, &read.length],
                read.refused.as_ref(),
            ),
            Self::Write(write) => access(&write.object, &[&write.value], write.refused.as_ref()),
            Self::Until(until) => {
                access(&until.object, &[&until.value, &until.min, &until.max], None)
            }
            // A mapping is about the objects that are mapped, not about its own parameter.
            Self::Remap(_)
            | Self::Send(_)
            | Self::Reply(_)
            | Self::Ask(_)
            | Self::Expect(_)
            | Self::Never(_)
            | Self::Defaults(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Measure(_)
            | Self::Collect(_)
            | Self::Sync(_)
            | Self::Produce(_)
            | Self::Bench(_)
            | Self::Observe(_)
            | Self::Eds(_)
            | Self::Undeclared(_)
            | Self::Lss(_) => None,
        }
    }

    /// What is sent while the step watches the bus.
    pub fn during(&self) -> Option<&Produce> {
        match self {
            Self::Expect(expect) => expect.during.as_ref(),
            Self::Never(never) => never.during.as_ref(),
            Self::Measure(measure) => measure.during.as_ref(),
            Self::Collect(collect) => collect.during.as_ref(),
            Self::Send(_)
            | Self::Reply(_)
            | Self::Ask(_)
            | Self::Read(_)
            | Self::Write(_)
            | Self::Defaults(_)
            | Self::Remap(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Until(_)
            | Self::Sync(_)
            | Self::Produce(_)
            | Self::Bench(_)
            | Self::Observe(_)
            | Self::Eds(_)
            | Self::Undeclared(_)
            | Self::Lss(_) => None,
        }
    }

    /// Whether the step needs a data sheet that says more than the device's own answers.
    pub fn judges_sheet(&self) -> bool {
        match self {
            Self::Eds(_) | Self::Undeclared(_) => true,
            // What was answered once is compared with what is answered now: a fair question, too.
            Self::Defaults(_)
            | Self::Send(_)
            | Self::Reply(_)
            | Self::Ask(_)
            | Self::Expect(_)
            | Self::Never(_)
            | Self::Read(_)
            | Self::Write(_)
            | Self::Remap(_)
            | Self::Nmt(_)
            | Self::Wait(_)
            | Self::Until(_)
            | Self::Measure(_)
            | Self::Collect(_)
            | Self::Sync(_)
            | Self::Produce(_)
            | Self::Bench(_)
            | Self::Observe(_)
            | Self::Lss(_) => false,
        }
    }
}

fn access<'s>(
    object: &'s At<ObjectRef>,
    literals: &[&'s Option<At<Literal>>],
    refused: Option<&'s At<Refusal>>,
) -> Option<Access<'s>> {
    let literals = literals.iter().filter_map(|literal| literal.as_ref()).collect();
    Some(Access { object, literals, refused })
}
