//! Slips: single mistakes of a device that is otherwise in order, late in a case, and their effect
//! on its frames.

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
