//! Words in the reasons of skipped cases, by which reports find what the user can change.

/// Stands before what protects a device from a case: `` `stores: 0` in dut.yaml:12 ``.
pub const PROTECTED_BY: &str = ": protected by ";

/// An object that a case needs, chosen by its `LowLimit` in the data sheet.
pub const LOWER_LIMIT: &str = "with a lower limit";

/// An object that a case needs, chosen by its `HighLimit` in the data sheet.
pub const UPPER_LIMIT: &str = "with an upper limit";
