//! A bell that ends the wait of a bus from another thread.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;

use nix::sys::eventfd::{EfdFlags, EventFd};

/// A bell that other threads ring. Clones are the same bell.
#[derive(Clone, Debug)]
pub struct Bell(Arc<EventFd>);

impl Bell {
    /// A bell that has not rung yet.
    ///
    /// # Errors
    /// When the process has too many files open.
    pub(super) fn new() -> io::Result<Self> {
        let flags = EfdFlags::EFD_CLOEXEC | EfdFlags::EFD_NONBLOCK;
        Ok(Self(Arc::new(EventFd::from_value_and_flags(0, flags)?)))
    }

    /// Ends the wait that goes on, or else the next one.
    pub fn ring(&self) {
        // Writing fails only after 2^64 rings that were not read.
        _ = self.0.write(1);
    }

    /// Whether it was rung since it was asked for last.
    pub(super) fn heard(&self) -> bool {
        self.0.read().is_ok()
    }
}

impl AsFd for Bell {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}
