//! What differs from one operating system to another: programs in a group of their own, serial
//! lines, the socket of a bench, and how a user ends a program.
//!
//! Each family has a file with the same items, and it is chosen here. A bus that only one system
//! has is left out in [`bus`](crate::bus).

#[cfg(unix)]
mod unix;
#[cfg(unix)]
use unix as this;

#[cfg(windows)]
mod windows;
#[cfg(windows)]
use windows as this;

pub(crate) use this::*;
