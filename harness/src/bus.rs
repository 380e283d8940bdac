//! Bus backends: the only places that touch hardware, and the only ones that read a clock.

pub mod socketcan;
