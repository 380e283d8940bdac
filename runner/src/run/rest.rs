//! Rest: a device in a known state, without errors and with nothing in flight, as it was before.
//!
//! Before a case, [`settle`] brings the device there or says why it is lost; after a case,
//! [`Leaving`] sets back what the case changed. Demands of steps do not belong here: nothing in
//! this room is a verdict.
//!
//! ```text
//! settle, first_look, bring_back ▶ ladder ▶ answer, state ▶ baseline
//! leave ▶ restore, stimuli, answer, state           undo ▶ restore
//! ```

mod answer;
mod baseline;
mod bring_back;
mod first_look;
mod ladder;
mod leave;
mod restore;
mod settle;
mod state;
mod stimuli;
mod undo;

pub(super) use answer::first_answer;
pub(super) use baseline::Baseline;
pub use bring_back::{Abandoned, BroughtBack};
pub(super) use first_look::first_look;
pub(super) use leave::Leaving;
pub(super) use restore::Snapshot;
pub(super) use settle::{Left, Settled, application, settle};
pub(super) use state::{enter, is_still, pre_operational};
pub(super) use stimuli::{BenchSnapshot, bench};
pub use undo::{KeepChanges, Undo};
