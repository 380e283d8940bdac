//! Every decision of the application that a test can observe, and the deviations that override one
//! of them.

use canopen::emcy::EmcyCode;

use crate::decisions::Layers;

/// All decisions of the application, as its data sheet says.
pub(crate) type GenericRules = Layers<Decision>;

decisions! {
    /// The decisions. The default methods are a summary of what the data sheet says.
    pub(crate) Decision of GenericRules, otherwise [DEVIATIONS];

    /// A terminal that is still broken after a reset is an error again.
    fn fault_seen_after_reset(&self) -> bool {
        true
    }

    /// Each error of a terminal leads to the state that 1029h says.
    fn each_fault_reacts(&self) -> bool {
        true
    }

    /// The error of the application while a value has an end of its range (2F02h sub 3): none.
    fn extreme_value(&self) -> Option<EmcyCode> {
        None
    }

    /// Large data are not looked at (2F20h).
    fn large_data_taken(&self, _bytes: &[u8]) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of Decision;

    "large-data-of-one-format" => large_data_taken: |_, bytes| bytes.starts_with(b"\x7FELF");
}
