//! Slips: what a device in order does wrong once, late in a case, and what becomes of its frames
//! then.

mod candidates;
mod edits;
mod frames;
mod model;
mod objects;
mod scene;
mod tape;
mod times;
mod values;

pub(super) use candidates::{candidates, not_declining};
pub(super) use model::Slip;
pub(super) use scene::{Heard, Moment};
pub(super) use tape::{Answers, Part, SlippingBus, Tape};
