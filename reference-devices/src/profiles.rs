//! The common behaviour of all devices of one profile.
//!
//! An application here takes its channels from the dictionary and its decisions from a trait of
//! rules, so that a device can have it whole or in part and a mutant can take one decision
//! otherwise.

pub(crate) mod cia401;
