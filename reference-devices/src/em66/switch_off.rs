//! The ways to switch off (3.4.5, 3.4.6).
