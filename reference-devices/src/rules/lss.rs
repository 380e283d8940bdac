//! The decisions of CiA 305, the layer setting services.

use std::time::Duration;

use canopen::lss::{BIT_RATES, Bound, Fastscan, Mode, Part, Request, UNCONFIGURED};
use canopen::{Data, NmtState};

use super::Rules;

decisions! {
    /// The decisions of an LSS slave. Clauses are those of CiA 305.
    pub LssDecision of Rules, otherwise [DEVIATIONS];

    /// A request has exactly eight bytes (6.1).
    fn lss_request(&self, data: &[u8]) -> Option<Request> {
        Request::decode(data).ok()
    }

    /// LSS does not depend on the NMT state (5.1).
    fn lss_served_in(&self, _state: NmtState) -> bool {
        true
    }

    /// A global switch is not answered, as every slave would (6.2.1).
    fn lss_global_switch_answered(&self) -> bool {
        false
    }

    /// Settings are asked for and made in the state LSS configuration (5.2).
    fn lss_configures_in(&self, mode: Mode) -> bool {
        mode == Mode::CONFIGURATION
    }

    /// After a reset the slave waits (5.2).
    fn lss_waits_after_reset(&self) -> bool {
        true
    }

    /// The parts of the address are sent in order (6.2.2).
    fn lss_selection_in_order(&self) -> bool {
        true
    }

    /// Each of them is that of the slave (6.2.2).
    fn lss_part_compared(&self, _part: Part) -> bool {
        true
    }

    /// Node ids are 1 to 127, and 255 for none (6.3.1).
    fn lss_node_id_valid(&self, node: u8) -> bool {
        matches!(node, 1..=127 | UNCONFIGURED)
    }

    /// A new node id is not in force at once (6.3.1).
    fn lss_node_id_waits(&self) -> bool {
        true
    }

    /// Reset communication brings it into force (6.3.1).
    fn lss_node_id_after_reset(&self, _active: u8, pending: u8) -> u8 {
        pending
    }

    /// For a slave that restarts when it leaves LSS configuration: settings that were not stored
    /// are no reason to restart.
    fn lss_configuring_renews(&self) -> bool {
        false
    }

    /// A slave without node id that was given one starts when it leaves LSS configuration (6.3.1).
    fn lss_leaving_starts(&self) -> bool {
        true
    }

    /// The bit rate at a place of a table, as far as the slave has it (6.3.2).
    fn lss_bit_rate(&self, table: u8, index: u8, supported: &[u32]) -> Option<u32> {
        bit_rate(table, index, supported)
    }

    /// The slave sends nothing for one delay before the change of the bit rate and one after it
    /// (6.3.3).
    fn lss_silence(&self, delay: Duration) -> Duration {
        delay * 2
    }

    /// Stored settings are in force after power-on (6.3.4).
    fn lss_stores(&self) -> bool {
        true
    }

    /// Stored settings are in force after each further power-on, too (6.3.4).
    fn lss_stored_kept(&self) -> bool {
        true
    }

    /// Settings that were not stored are lost without supply (6.3.4).
    fn lss_forgets_without_supply(&self) -> bool {
        true
    }

    /// Only a slave without node id says that it has none (6.5.2).
    fn lss_says_unconfigured(&self, active: u8) -> bool {
        active == UNCONFIGURED
    }

    /// Vendor and product are compared, revision and serial number lie within their bounds, which
    /// are part of the range (6.5.1).
    fn lss_bound_met(&self, bound: Bound, own: u32, number: u32) -> bool {
        match bound {
            Bound::Vendor | Bound::Product => own == number,
            Bound::RevisionLow | Bound::SerialLow => own >= number,
            Bound::RevisionHigh | Bound::SerialHigh => own <= number,
        }
    }

    /// Fastscan is for slaves without node id (6.5.3).
    fn lss_scanned(&self, active: u8, pending: u8) -> bool {
        active == UNCONFIGURED && pending == UNCONFIGURED
    }

    /// A configured device is not selected (5.2).
    fn lss_selects_in(&self, mode: Mode) -> bool {
        mode == Mode::WAITING
    }

    /// Bits are 0 to 31, parts 0 to 3 (6.5.3).
    fn lss_scan_valid(&self, scan: Fastscan) -> bool {
        scan.bit < 32 && scan.part < 4 && scan.next < 4
    }

    /// The parts are asked for one after the other (6.5.3).
    fn lss_scan_in_order(&self) -> bool {
        true
    }

    /// A scan ends with the last bit of the last part (6.5.3).
    fn lss_scan_complete(&self, scan: Fastscan) -> bool {
        scan.part == 3 && scan.next == 0
    }

    /// The start of a scan leads back to the first part (6.7).
    fn lss_confirm_restarts_scan(&self) -> bool {
        true
    }

    /// Node id and bit rate are settings of their own (6.4).
    fn lss_bit_rate_leaves_node_id(&self) -> bool {
        true
    }

    /// The pending node id is stored, regardless of the active one (6.4.5).
    fn lss_node_id_stored(&self, _pending: u8, _active: u8) -> bool {
        true
    }

    /// A part that does not fit ends the identification (6.6.2).
    fn lss_misfit_ends_identification(&self) -> bool {
        true
    }
}

/// The bit rate at that place of a table of CiA 305, in bit/s, if the node has it.
fn bit_rate(table: u8, index: u8, supported: &[u32]) -> Option<u32> {
    let bit_rate = BIT_RATES.get(usize::from(index)).copied().flatten()?;
    (table == 0 && supported.contains(&bit_rate)).then_some(bit_rate)
}

deviations! {
    DEVIATIONS of LssDecision;

    "lss-short-frame-answered" =>
        lss_request: |_, data| Request::decode(&Data::new(data).padded()).ok();
    "lss-in-pre-operational-only" => lss_served_in: |_, state| {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::INITIALISING)
    };
    "lss-not-in-operational" => lss_served_in: |_, state| state != NmtState::OPERATIONAL;
    "lss-some-bit-rates" => lss_bit_rate: |_, table, index, supported| {
        bit_rate(table, index, supported).filter(|rate| *rate >= 125_000)
    };
    "lss-vendor-not-compared" => lss_part_compared: |_, part| part != Part::Vendor;
    "lss-product-not-compared" => lss_part_compared: |_, part| part != Part::Product;
    "lss-revision-not-compared" => lss_part_compared: |_, part| part != Part::Revision;
    "lss-serial-not-compared" => lss_part_compared: |_, part| part != Part::Serial;
    "lss-node-id-0-accepted" => lss_node_id_valid: |_, node| node <= 127 || node == UNCONFIGURED;
    "lss-node-id-128-accepted" => lss_node_id_valid: |_, node| node != 0;
    "lss-node-id-127-refused" => lss_node_id_valid: |_, node| matches!(node, 1..127 | UNCONFIGURED);
    "lss-node-id-255-refused" => lss_node_id_valid: |_, node| matches!(node, 1..=127);
    "lss-node-id-never" => lss_node_id_after_reset: |_, active, _| active;
    "lss-unconfigured-node-starts" => lss_node_id_after_reset: |_, active, pending| {
        if pending == UNCONFIGURED { active } else { pending }
    };
    "lss-reserved-bit-rate-accepted" => lss_bit_rate: |_, table, index, supported| {
        match (table, index) {
            (0, 5) => Some(100_000),
            _ => bit_rate(table, index, supported),
        }
    };
    "lss-any-bit-rate-index-accepted" => lss_bit_rate: |_, table, index, supported| {
        let beyond = usize::from(index) >= BIT_RATES.len() && table == 0;
        if beyond { Some(1_000_000) } else { bit_rate(table, index, supported) }
    };
    "lss-bit-rate-table-ignored" =>
        lss_bit_rate: |_, _, index, supported| bit_rate(0, index, supported);
    "lss-silent-for-one-delay" => lss_silence: |_, delay| delay;
    "lss-identify-range-inverted" => lss_bound_met: |_, bound, own, number| match bound {
        Bound::Vendor | Bound::Product => own == number,
        Bound::RevisionLow | Bound::SerialLow => own <= number,
        Bound::RevisionHigh | Bound::SerialHigh => own >= number,
    };
    "lss-identify-bounds-excluded" => lss_bound_met: |_, bound, own, number| match bound {
        Bound::Vendor | Bound::Product => own == number,
        Bound::RevisionLow | Bound::SerialLow => own > number,
        Bound::RevisionHigh | Bound::SerialHigh => own < number,
    };
    "lss-identify-any-vendor" => lss_bound_met: |_, bound, own, number| match bound {
        Bound::Vendor | Bound::Product => true,
        Bound::RevisionLow | Bound::SerialLow => own >= number,
        Bound::RevisionHigh | Bound::SerialHigh => own <= number,
    };
    "lss-identify-any-bounds" => lss_bound_met: |_, bound, own, number| {
        !matches!(bound, Bound::Vendor | Bound::Product) || own == number
    };
    "lss-fastscan-any-bit" => lss_scan_valid: |_, scan| scan.part < 4 && scan.next < 4;
    "lss-fastscan-any-next" => lss_scan_valid: |_, scan| scan.bit < 32 && scan.part < 4;
    "lss-fastscan-ends-early" => lss_scan_complete: |_, scan| scan.next < scan.part;
    "lss-active-node-id-not-stored" => lss_node_id_stored: |_, pending, active| pending != active;
    "lss-switch-delay-in-a-byte" =>
        lss_silence: |_, delay| Duration::from_millis(delay.as_millis() as u64 & 0xFF) * 2;
}
