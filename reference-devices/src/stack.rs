//! One small CANopen stack, a struct and a file per service (CiA 301, CiA 305).
//!
//! A service takes frames, deadlines and NMT states and returns frames and its next deadline; none
//! waits or reads a clock. Each decision of the specification is left to the [rules](crate::rules),
//! so the stack contains no deviation. Code that services share is in `base`, `fault` and
//! `settings`; `services` drives those that work on the dictionary, and `node` is the whole device.

mod base;
mod behaviour;
mod emcy;
mod emcy_consumer;
mod error_behaviour;
mod errors;
mod fault;
mod guarding;
mod heartbeat_consumer;
mod heartbeat_producer;
mod lss;
mod nmt;
mod node;
mod pdo;
mod pdo_mapping;
mod rpdo;
mod sdo_channels;
mod sdo_client;
mod sdo_server;
mod sdo_servers;
mod services;
mod settings;
mod storage;
mod sync;
mod sync_producer;
#[cfg(test)]
pub(crate) mod testing;
mod time;
mod time_stamp;
mod tpdo;

pub use fault::FaultKind;
pub use node::Node;
pub use settings::{BlockTransfer, Byte, EmcyForm, EmcyTable, NodeSettings, SyncSupervision};

pub(crate) use behaviour::{Attachment, Behaviour, CommunicationEvent, Inert};
pub(crate) use errors::Errors;
pub(crate) use sdo_client::SdoJob;
pub(crate) use time::earlier;
