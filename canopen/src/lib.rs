//! The CANopen language: frames, service codecs, object dictionary, electronic data sheets, and
//! a virtual bus on which devices are values. No I/O, no clock, no threads.
//!
//! A [`Bus`] carries the wire and the time; a [`Device`] takes frames and
//! time and gives frames and its next deadline. Everything else is data.

mod abort;
pub mod bench;
mod bus;
pub mod catalogue;
pub mod decoder;
mod dictionary;
pub mod eds;
pub mod emcy;
mod frame;
pub mod heartbeat;
pub mod lss;
mod malformed;
mod meaning;
pub mod monitor;
mod mux;
pub mod nearest;
pub mod nmt;
mod pattern;
pub mod pdo;
pub mod sdo;
pub mod source;
pub mod sync;
mod time;
pub mod timestamp;
mod value;
mod virtual_bus;
pub mod wire;

pub use abort::Abort;
pub use bench::{Bench, BenchError};
pub use bus::{Bus, BusError, Device, Outbox, Stamped, serve};
pub use decoder::Decoder;
pub use dictionary::Dictionary;
pub use frame::{Data, Frame, FrameError, Id};
pub use malformed::Malformed;
pub use meaning::{Meaning, meaning};
pub use mux::{Mux, NoMux};
pub use nmt::NmtState;
pub use pattern::{Pattern, PatternError, Word};
pub use time::Instant;
pub use value::{DataType, Value, ValueError};
pub use virtual_bus::VirtualBus;
