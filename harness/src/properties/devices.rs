//! The devices that the sessions of bytes are tried on.

use std::sync::LazyLock;

use reference_devices::devices::{self, ReferenceDevice};

/// The node that is spoken to.
pub(super) const NODE: u8 = 5;

/// A device with a profile of its own.
pub(super) static DRR460: LazyLock<ReferenceDevice> =
    LazyLock::new(|| devices::device("drr460").expect("it is part of the program"));

/// The device that has every service.
pub(super) static GENERIC: LazyLock<ReferenceDevice> =
    LazyLock::new(|| devices::device("generic").expect("it is part of the program"));
