//! The suites are part of the program: it is built again when one of them changes or is new.

fn main() {
    println!("cargo::rerun-if-changed=../suites");
}
