//! What the names of interfaces and hosts say.

/// Whether a network interface of Linux has no wire, and no bit rate.
pub(super) fn is_virtual(name: &str) -> bool {
    ["vcan", "vxcan"].iter().any(|kind| name.starts_with(kind))
}

/// Whether a host, with its port, is this machine.
pub(super) fn is_this_machine(host: &str) -> bool {
    ["localhost:", "127.", "[::1]:"].iter().any(|own| host.starts_with(own))
}
