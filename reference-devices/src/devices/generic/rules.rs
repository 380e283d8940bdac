//! Every decision of the application that a test can observe, and the devices that take one of
//! them otherwise.

use canopen::Abort;

use crate::devices::deviating::{self, Deviation, Lay, deviating, layer};

/// A device that keeps to its data sheet.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DataSheet;

layer!(pub(crate) of dyn GenericRules);
impl Layer for DataSheet {}
impl GenericRules for DataSheet {}

decisions! {
    /// The decisions. The default methods are a summary of what the data sheet says.
    pub(crate) trait GenericRules: Layer;

    /// A parameter is not changed from the network under local control, nor in a state that
    /// forbids it (2F04h).
    fn parameter_change(&self, mode: i64) -> Result<(), Abort> {
        match mode {
            1 => Err(Abort::LOCAL_CONTROL),
            2 => Err(Abort::DEVICE_STATE),
            _ => Ok(()),
        }
    }

    /// A terminal that is still broken after a reset is an error again.
    fn fault_seen_after_reset(&self) -> bool {
        true
    }

    /// Each error of a terminal leads to the state that 1029h says.
    fn each_fault_reacts(&self) -> bool {
        true
    }

    /// Large data are not looked at (2F20h).
    fn large_data_taken(&self, _bytes: &[u8]) -> bool {
        true
    }
}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    deviating::names(DEVIATIONS)
}

/// The deviation of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Lay<dyn GenericRules>> {
    deviating::named(DEVIATIONS, name)
}

const DEVIATIONS: &[Deviation<dyn GenericRules>] = deviating! { dyn GenericRules: GenericRules [];
    "large-data-of-one-format" {
        fn large_data_taken(&self, bytes: &[u8]) -> bool { bytes.starts_with(b"\x7FELF") }
    }
    "fault-forgotten-by-reset" {
        fn fault_seen_after_reset(&self) -> bool { false }
    }
    "fault-reacts-once" {
        fn each_fault_reacts(&self) -> bool { false }
    }
    "parameter-always-changes" {
        fn parameter_change(&self, _mode: i64) -> Result<(), Abort> { Ok(()) }
    }
};
