//! Fuzzing of a CANopen device with a model of it as the judge.
//!
//! A [`Blueprint`] says how models of the device are built: from any data sheet, with the stack of
//! the reference devices. A [`session::Session`] is a list of typed actions, drawn from bytes by
//! the state of the model, and played on a bus. An [`Oracle`] runs a model beside the device and
//! judges each frame. A [`Belief`] is what is known of the device: the freedoms that it was seen to
//! use. What no freedom explains is a finding; the mutants that do the same name the requirement.
//!
//! Nothing here opens a bus, reads a clock or a file.

mod action;
mod belief;
mod blueprint;
mod campaign;
mod diagnosis;
mod draw;
mod explore;
mod finding;
mod kept;
mod listen;
mod look;
mod model;
mod oracle;
pub mod session;
mod shrink;
mod stage;
mod surface;
mod talk;
mod together;
mod virtual_device;

pub use action::{Action, Kind, Stimulus, Then};
pub use belief::{Belief, Judged};
pub use blueprint::{Blueprint, Candidate, Kept};
pub use campaign::{Campaign, Tally, bytes};
pub use diagnosis::Suspect;
pub use explore::{Coverage, Pair, Sights, Tried};
pub use finding::Finding;
pub use kept::kept;
pub use listen::{Heard, Listener};
pub use look::{Look, look};
pub use oracle::{Difference, End, Oracle, Seen, Violation, What};
pub use shrink::shrink;
pub use stage::{Ask, Stage};
pub use surface::Surface;
pub use talk::Open;
pub use virtual_device::{Behind, VirtualDevice};
