//! Rest: a device in a known state, without errors and with nothing in flight, as it was before.
//!
//! Before a case, [`settle`] brings the device there or says why it is lost; after a case,
//! [`Leaving`] sets back what the case changed. Demands of steps do not belong here: nothing in
//! this room is a verdict.
//!
//! ```text
//! settle, first_look, bring_back ▶ ladder ▶ answer, state, lss ▶ baseline ▶ rung
//! leave ▶ restore, stimuli, answer, state, lss ▶ address
//! settle, leave, first_look ▶ emergencies ▶ baseline
//! first_look ▶ shown ▶ undo ▶ restore
//! partner ▶ undo, restore
//! ```

mod address;
mod answer;
mod baseline;
mod bring_back;
mod emergencies;
mod first_look;
mod ladder;
mod leave;
mod lss;
mod outputs;
mod partner;
mod restore;
mod rung;
mod settle;
mod shown;
mod state;
mod stimuli;
mod undo;

pub use address::Address;
pub(super) use answer::first_answer;
pub(super) use baseline::Baseline;
pub use bring_back::{Abandoned, BroughtBack, differs};
pub(super) use emergencies::emergencies;
pub(super) use first_look::{Wanted, first_look, look_at_channels};
pub(super) use leave::Leaving;
pub(super) use lss::give_back;
pub(super) use outputs::Outputs;
pub(super) use partner::{Partner, set_back_the_rest};
pub use restore::Snapshot;
pub(super) use settle::{Left, Settled, application, settle};
pub(super) use state::{enter, is_still, owes_a_sign, pre_operational};
pub(super) use stimuli::{BenchSnapshot, bench};
pub use undo::{KeepChanges, Undo};
