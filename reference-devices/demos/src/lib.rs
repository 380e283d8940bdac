//! Reference devices at work: a machine control on a simulated bus spends minutes or an hour with
//! each of them.
//!
//! Examples draw them and benchmarks time them; the shipped program contains none of this. A demo
//! knows its device as a user does, by frames, data sheet and manual, so that addresses are written
//! here again. What a device must do does not belong here, but in its suites.

pub mod ax021211;
pub mod ax021211_full;
pub mod drr460;
pub mod em66;
mod master;
pub mod mcm260x;
