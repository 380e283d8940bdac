//! Reference CANopen devices: one small stack, a struct and a file per service.
//!
//! A [`Node`] is a [`canopen::Device`]: frames and time go in, frames and the next deadline come
//! out. Its data sheet says which services it has, [`NodeSettings`] what a data sheet cannot say,
//! a [`Behaviour`] what the device does, and [`Rules`] every decision that the specification
//! takes. [`rules::named`] breaks exactly one of those decisions.

mod behaviour;
pub mod describe;
pub mod devices;
pub mod drr460;
pub mod em66;
mod emcy;
mod emcy_consumer;
mod error_behaviour;
mod errors;
pub mod generic;
mod guarding;
mod heartbeat_consumer;
mod heartbeat_producer;
mod lss;
pub mod mutant;
mod nmt;
mod node;
mod pdo;
mod pdo_mapping;
mod rpdo;
pub mod rules;
mod sdo_channels;
mod sdo_client;
mod sdo_server;
mod services;
mod settings;
mod storage;
mod sync;
mod sync_producer;
#[cfg(test)]
mod testing;
mod time;
mod time_stamp;
mod tpdo;

pub use behaviour::{Behaviour, Event, Inert};
pub use errors::Errors;
pub use nmt::{Change, Reset};
pub use node::Node;
pub use rules::{Rules, Specification};
pub use sdo_client::SdoJob;
pub use settings::{BlockTransfer, Byte, EmcyForm, EmcyTable, NodeSettings, SyncSupervision};
