//! What a DRR460 does, as small types that know neither objects nor a clock: each has settings,
//! looks at inputs, and is given the time that went by.

mod parameters;
mod rules;

mod alarm;
mod bench;
mod controller;
mod current;
mod cycle;
mod delay;
mod emergency;
mod expansion;
mod filter;
mod flags;
mod latch;
mod load;
mod on_off;
mod pid;
mod reading;
mod retransmission;
mod soft_start;
mod state;
mod switches;
mod tuning;
mod valve;
mod wiring;
