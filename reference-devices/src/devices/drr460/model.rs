//! What a DRR460 does, as small types that know neither objects nor a clock: each has settings,
//! looks at inputs, and is given the time that went by.

mod parameters;
mod rules;

mod cycle;
mod delay;
mod filter;
mod latch;
mod on_off;
mod pid;
mod reading;
mod state;
mod valve;
mod wiring;
