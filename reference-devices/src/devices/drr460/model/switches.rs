//! The DIP switches (manual, 6.3 and 11.3.2, parameters 111 and 112).

/// The switches as they were at power-on: contact 1 is bit 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Switches {
    pub(crate) address: u8,
    pub(crate) rate: u8,
}

impl Switches {
    /// The node-ID: that of the contacts or, with all of them off, of parameter 111. `None` when
    /// there is no such node-ID, with which the device keeps off the bus.
    pub(crate) fn node(self, configured: i64) -> Option<u8> {
        // Contact 8 must be kept off, so it is ignored.
        let set = self.address & 0x7F;
        let node = if set == 0 { u8::try_from(configured).ok()? } else { set };
        (1..=127).contains(&node).then_some(node)
    }

    /// The code of the bit rate as 2000h sub 1 has it: that of the contacts or, with all of them
    /// off, of parameter 112.
    pub(crate) fn rate(self, configured: i64) -> i64 {
        match self.rate & 7 {
            0 => configured,
            set => i64::from(set) - 1,
        }
    }

    /// Whether contact 4 asks for the defaults.
    pub(crate) const fn loads_defaults(self) -> bool {
        self.rate & 8 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_comes_from_the_contacts_or_a_parameter() {
        let table = [
            (0, 247, None),
            (0, 5, Some(5)),
            (0, 127, Some(127)),
            (7, 5, Some(7)),
            (0x7F, 5, Some(127)),
            (0x83, 5, Some(3)),
            (0x80, 5, Some(5)),
        ];
        for (address, configured, node) in table {
            assert_eq!(Switches { address, rate: 0 }.node(configured), node, "{address:#04X}");
        }
    }

    #[test]
    fn the_rate_comes_from_the_contacts_or_a_parameter() {
        for (rate, configured, code) in [(0, 2, 2), (1, 2, 0), (7, 2, 6), (8, 3, 3)] {
            assert_eq!(Switches { address: 0, rate }.rate(configured), code, "{rate}");
        }
        assert!(Switches { address: 0, rate: 15 }.loads_defaults());
    }
}
