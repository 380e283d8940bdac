//! A crate for the test of the scanner, which nobody compiles.

mod a;
mod b;
mod c;
