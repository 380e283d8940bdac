//! Storing and restoring parameters.

use std::ops::RangeInclusive;

use canopen::Mux;

use super::Rules;

decisions! {
    /// The decisions of 1010h, 1011h and 1020h (CiA 301, 7.5.2.13, 7.5.2.14 and 7.5.2.23).
    pub StorageDecision of Rules, otherwise [DEVIATIONS];

    /// Nothing is done without the signature.
    fn signature_valid(&self, expected: &[u8], got: &[u8]) -> bool {
        expected == got
    }

    /// Stored values count once they are complete, so that a loss of supply does no harm.
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

    /// The master resets the device after "load"; the device does not restart by itself.
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
    DEVIATIONS of StorageDecision;

    "save-with-any-signature" =>
        signature_valid: |_, expected, got| expected == got || expected == b"save";
    "load-with-any-signature" =>
        signature_valid: |_, expected, got| expected == got || expected == b"load";
    "save-stores-half" => stored: |_, mux| mux.index < 0x2000;
    "save-forgets-sync" => stored: |_, mux| !matches!(mux.index, 0x1006 | 0x1019);
    "save-forgets-sync-identifier" => stored: |_, mux| mux.index != 0x1005;
    "save-forgets-guarding" => stored: |_, mux| !matches!(mux.index, 0x100C | 0x100D);
    "save-forgets-time" => stored: |_, mux| mux.index != 0x1012;
    "save-forgets-emcy-identifier" => stored: |_, mux| mux.index != 0x1014;
    "save-forgets-emcy-inhibit-time" => stored: |_, mux| mux.index != 0x1015;
    "save-forgets-error-behaviour" => stored: |_, mux| mux.index != 0x1029;
    "save-forgets-interrupt-enable" => stored: |_, mux| !matches!(mux.index, 0x6005 | 0x6423);
    "parameter-groups-are-one" => parameter_group: |_, _| 0x1000..=0xFFFF;
    "parameter-groups-swapped" => parameter_group: |_, sub| match sub {
        2 => 0x6000..=0x9FFF,
        3 => 0x1000..=0x1FFF,
        _ => 0x1000..=0xFFFF,
    };
    "save-without-sdo-channels" => stored: |_, mux| !(0x1201..=0x12FF).contains(&mux.index);
    "save-of-three-monitored-nodes" => stored: |_, mux| mux.index != 0x1016 || mux.sub <= 3;
    "save-of-three-emcy-consumers" => stored: |_, mux| mux.index != 0x1028 || mux.sub <= 3;
    "save-of-four-pdos" => stored: |_, mux| {
        !matches!(mux.index, 0x1400..=0x1BFF) || mux.index & 0x1FF < 4
    };
    "save-of-two-sdo-channels-of-a-kind" => stored: |_, mux| {
        !matches!(mux.index, 0x1202..=0x127F | 0x1281..=0x12FF)
    };
    "save-of-eight-sub-indices" => stored: |_, mux| mux.sub <= 8;
    "save-of-eight-bytes" => stored_length: |_, length| length.min(8);
    "load-of-eight-sub-indices" => forgotten: |_, mux| mux.sub <= 8;
}
