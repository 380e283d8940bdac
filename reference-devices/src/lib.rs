//! Reference CANopen devices: what each is, what it does, and the stack that they share.
//!
//! A [`stack::Node`] is a [`canopen::Device`]: frames and time go in, frames and the next deadline
//! come out. Its data sheet states which services it has, [`stack::NodeSettings`] what a data sheet
//! cannot express, a [`stack::Behaviour`] what the device does, and [`rules::Rules`] every decision
//! that the specification takes. A [`mutant::Mutant`] is a device with one deviation that a
//! document forbids, a [`freedom::Freedom`] one with a deviation that a document allows, and a
//! [`freedom::Personality`] has many of these.

#[macro_use]
mod decisions;

pub mod change;
pub mod describe;
pub mod devices;
pub mod freedom;
pub mod mutant;
mod profiles;
pub mod rules;
pub mod stack;
