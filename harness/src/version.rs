//! What the program says that it is.

/// Its version. A release has the commit that it was built of beside it: `0.1.0 (1a2b3c4d5e)`.
pub(crate) const VERSION: &str = match option_env!("HARNESS_VERSION") {
    Some(version) => version,
    None => env!("CARGO_PKG_VERSION"),
};
