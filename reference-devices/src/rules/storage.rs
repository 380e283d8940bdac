//! Storing and restoring parameters.

use std::ops::RangeInclusive;

use canopen::Mux;

use super::Layer;

decisions! {
    /// The decisions of 1010h, 1011h and 1020h (CiA 301, 7.5.2.13, 7.5.2.14 and 7.5.2.23).
    pub trait StorageRules: Layer;

    /// Nothing is done without the signature.
    fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
        expected == got
    }

    /// What is stored counts when it is complete, so that a loss of supply does no harm.
    fn save_completes_last(&self) -> bool {
        true
    }

    /// A parameter that changes sets 1020h to 0 (7.5.2.23).
    fn change_clears_signature(&self) -> bool {
        true
    }

    /// A sub-index of 1010h and 1011h is a group of objects; from 4 on, the manufacturer chooses.
    fn parameter_group(&self, sub: u8) -> RangeInclusive<u16> {
        match sub {
            2 => 0x1000..=0x1FFF,
            3 => 0x6000..=0x9FFF,
            4.. => 0x2000..=0x5FFF,
            _ => 0x1000..=0xFFFF,
        }
    }

    /// Every object of the group is stored.
    fn stored(&self, _mux: Mux) -> bool {
        true
    }

    /// Restored values are in force after the next reset.
    fn load_waits_for_reset(&self) -> bool {
        true
    }

    /// The master resets the device after "load"; it does not start anew by itself.
    fn load_restarts(&self) -> bool {
        false
    }

    /// A value is stored whole.
    fn stored_length(&self, length: usize) -> usize {
        length
    }

    /// A reset ends the SDO transfer of a save; its confirmation does not follow (7.2.4.3.17).
    fn reset_drops_confirmation(&self) -> bool {
        true
    }

    /// A save adds to what the last command left in the memory.
    fn save_extends_newest(&self) -> bool {
        true
    }

    /// A save after one that was cut short is a save as any other.
    fn saves_after_a_cut(&self) -> bool {
        true
    }

    /// "load" forgets every object of the group.
    fn forgotten(&self, _mux: Mux) -> bool {
        true
    }
}

deviations! {
    StorageRules;

    "save-confirmed-after-a-reset" {
        fn reset_drops_confirmation(&self) -> bool { false }
    }
    "save-with-any-signature" {
        fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
            expected == got || expected == b"save"
        }
    }
    "load-with-any-signature" {
        fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
            expected == got || expected == b"load"
        }
    }
    "save-stores-half" {
        fn stored(&self, mux: Mux) -> bool { mux.index < 0x2000 }
    }
    "save-stores-nothing" {
        fn stored(&self, _mux: Mux) -> bool { false }
    }
    "save-forgets-sync" {
        fn stored(&self, mux: Mux) -> bool { !matches!(mux.index, 0x1006 | 0x1019) }
    }
    "save-forgets-sync-identifier" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1005 }
    }
    "save-forgets-sync-window" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1007 }
    }
    "save-forgets-guarding" {
        fn stored(&self, mux: Mux) -> bool { !matches!(mux.index, 0x100C | 0x100D) }
    }
    "save-forgets-time" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1012 }
    }
    "save-forgets-emcy-identifier" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1014 }
    }
    "save-forgets-emcy-inhibit-time" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1015 }
    }
    "save-forgets-error-behaviour" {
        fn stored(&self, mux: Mux) -> bool { mux.index != 0x1029 }
    }
    "save-forgets-interrupt-enable" {
        fn stored(&self, mux: Mux) -> bool { !matches!(mux.index, 0x6005 | 0x6423) }
    }
    "save-after-a-cut-lost" {
        fn saves_after_a_cut(&self) -> bool { false }
    }
    "parameter-groups-are-one" {
        fn parameter_group(&self, _sub: u8) -> RangeInclusive<u16> { 0x1000..=0xFFFF }
    }
    "parameter-groups-swapped" {
        fn parameter_group(&self, sub: u8) -> RangeInclusive<u16> {
            match sub {
                2 => 0x6000..=0x9FFF,
                3 => 0x1000..=0x1FFF,
                _ => 0x1000..=0xFFFF,
            }
        }
    }
    "save-completes-first" {
        fn save_completes_last(&self) -> bool { false }
    }
    "signature-survives-change" {
        fn change_clears_signature(&self) -> bool { false }
    }
    "save-without-sdo-channels" {
        fn stored(&self, mux: Mux) -> bool { !(0x1201..=0x12FF).contains(&mux.index) }
    }
    "load-at-once" {
        fn load_waits_for_reset(&self) -> bool { false }
    }
    "load-restarts" {
        fn load_restarts(&self) -> bool { true }
    }
    "save-of-eight-sub-indices" {
        fn stored(&self, mux: Mux) -> bool { mux.sub <= 8 }
    }
    "save-of-eight-bytes" {
        fn stored_length(&self, length: usize) -> usize { length.min(8) }
    }
    "save-extends-older-bank" {
        fn save_extends_newest(&self) -> bool { false }
    }
    "load-of-eight-sub-indices" {
        fn forgotten(&self, mux: Mux) -> bool { mux.sub <= 8 }
    }
}
