//! What a DRR460 does, as small types that know neither objects nor a clock: each has settings,
//! looks at inputs, and is given the time that went by.

mod parameters;
mod rules;

mod delay;
mod filter;
mod latch;
mod reading;
mod state;
