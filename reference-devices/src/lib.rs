//! Reference CANopen devices: what each is, what it does, and the stack that they share.
//!
//! A [`stack::Node`] is a [`canopen::Device`]: frames and time go in, frames and the next deadline
//! come out. Its data sheet states which services it has, [`stack::NodeSettings`] what a data sheet
//! cannot express, a [`stack::Behaviour`] what the device does, and [`rules::Rules`] every decision
//! that the specification takes. [`rules::named`] breaks exactly one of those decisions.

pub mod describe;
pub mod devices;
pub mod mutant;
mod profiles;
pub mod rules;
pub mod stack;
