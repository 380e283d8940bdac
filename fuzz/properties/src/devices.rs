//! The devices that the sessions of bytes are tried on.

use reference_devices::devices;
use reference_devices::rules::Rules;
use reference_devices::stack::Node;

/// The node that is spoken to.
pub(crate) const NODE: u8 = 5;

/// A device that has just been switched on. Building one takes longer than a session does, so a
/// property builds its devices once for a thread, boots them and gives each session a copy.
pub(crate) fn switched_on(name: &str) -> Node {
    let device = devices::device(name).expect("it is part of the program");
    device.node(NODE, Rules::default())
}
