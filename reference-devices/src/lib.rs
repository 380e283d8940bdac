//! Reference CANopen devices: their data, their behaviour, and the stack that they share.
//!
//! A [`stack::Node`] is a [`canopen::Device`]: frames and time go in, frames and the next deadline
//! come out. Its data sheet states its services, and [`stack::NodeSettings`] everything that a data
//! sheet cannot express. A [`stack::Behaviour`] is its application, and [`rules::Rules`] has every
//! decision of the specification. A [`mutant::Mutant`] is a device with one deviation that a
//! document forbids, a [`freedom::Freedom`] one with a deviation that a document allows, and a
//! [`freedom::Personality`] has many of these.

#[macro_use]
mod decisions;

pub mod change;
pub mod describe;
pub mod devices;
pub mod freedom;
pub mod mutant;
pub mod partner;
mod profiles;
pub mod rules;
pub mod stack;
