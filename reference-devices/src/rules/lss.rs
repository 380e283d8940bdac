//! What CiA 305, the layer setting services, decides.

use std::time::Duration;

use canopen::lss::{BIT_RATES, Bound, Fastscan, Mode, Part, Request, UNCONFIGURED};
use canopen::{Data, NmtState};

use super::Layer;

decisions! {
    /// The decisions of an LSS slave. Clauses are those of CiA 305.
    pub trait LssRules: Layer;

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

    /// Of a slave that restarts when it leaves LSS configuration: what was not stored is no reason.
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

    /// What was stored is in force after power-on (6.3.4).
    fn lss_stores(&self) -> bool {
        true
    }

    /// What was stored is in force after each further power-on, too (6.3.4).
    fn lss_stored_kept(&self) -> bool {
        true
    }

    /// What was not stored is forgotten without supply (6.3.4).
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

    /// Who is configured already is not selected (5.2).
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

    /// What is pending is stored, whatever is in force (6.4.5).
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
    LssRules;

    "lss-short-frame-answered" {
        fn lss_request(&self, data: &[u8]) -> Option<Request> {
            Request::decode(&Data::new(data).padded()).ok()
        }
    }
    "lss-in-pre-operational-only" {
        fn lss_served_in(&self, state: NmtState) -> bool {
            matches!(state, NmtState::PRE_OPERATIONAL | NmtState::INITIALISING)
        }
    }
    "lss-not-in-operational" {
        fn lss_served_in(&self, state: NmtState) -> bool { state != NmtState::OPERATIONAL }
    }
    "lss-some-bit-rates" {
        fn lss_bit_rate(&self, table: u8, index: u8, supported: &[u32]) -> Option<u32> {
            bit_rate(table, index, supported).filter(|rate| *rate >= 125_000)
        }
    }
    "lss-global-switch-answered" {
        fn lss_global_switch_answered(&self) -> bool { true }
    }
    "lss-configures-while-waiting" {
        fn lss_configures_in(&self, _mode: Mode) -> bool { true }
    }
    "lss-selected-while-configured" {
        fn lss_selects_in(&self, _mode: Mode) -> bool { true }
    }
    "lss-configuration-survives-reset" {
        fn lss_waits_after_reset(&self) -> bool { false }
    }
    "lss-serial-number-selects" {
        fn lss_selection_in_order(&self) -> bool { false }
    }
    "lss-vendor-not-compared" {
        fn lss_part_compared(&self, part: Part) -> bool { part != Part::Vendor }
    }
    "lss-product-not-compared" {
        fn lss_part_compared(&self, part: Part) -> bool { part != Part::Product }
    }
    "lss-revision-not-compared" {
        fn lss_part_compared(&self, part: Part) -> bool { part != Part::Revision }
    }
    "lss-serial-not-compared" {
        fn lss_part_compared(&self, part: Part) -> bool { part != Part::Serial }
    }
    "lss-node-id-0-accepted" {
        fn lss_node_id_valid(&self, node: u8) -> bool { node <= 127 || node == UNCONFIGURED }
    }
    "lss-node-id-128-accepted" {
        fn lss_node_id_valid(&self, node: u8) -> bool { node != 0 }
    }
    "lss-node-id-127-refused" {
        fn lss_node_id_valid(&self, node: u8) -> bool { matches!(node, 1..127 | UNCONFIGURED) }
    }
    "lss-node-id-255-refused" {
        fn lss_node_id_valid(&self, node: u8) -> bool { matches!(node, 1..=127) }
    }
    "lss-node-ids-refused" {
        fn lss_node_id_valid(&self, _node: u8) -> bool { false }
    }
    "lss-node-id-at-once" {
        fn lss_node_id_waits(&self) -> bool { false }
    }
    "lss-node-id-never" {
        fn lss_node_id_after_reset(&self, active: u8, _pending: u8) -> u8 { active }
    }
    "lss-unconfigured-node-starts" {
        fn lss_node_id_after_reset(&self, active: u8, pending: u8) -> u8 {
            if pending == UNCONFIGURED { active } else { pending }
        }
    }
    "lss-configuring-restarts" {
        fn lss_configuring_renews(&self) -> bool { true }
    }
    "lss-configured-node-does-not-start" {
        fn lss_leaving_starts(&self) -> bool { false }
    }
    "lss-reserved-bit-rate-accepted" {
        fn lss_bit_rate(&self, table: u8, index: u8, supported: &[u32]) -> Option<u32> {
            match (table, index) {
                (0, 5) => Some(100_000),
                _ => bit_rate(table, index, supported),
            }
        }
    }
    "lss-any-bit-rate-index-accepted" {
        fn lss_bit_rate(&self, table: u8, index: u8, supported: &[u32]) -> Option<u32> {
            let beyond = usize::from(index) >= BIT_RATES.len() && table == 0;
            if beyond { Some(1_000_000) } else { bit_rate(table, index, supported) }
        }
    }
    "lss-bit-rate-table-ignored" {
        fn lss_bit_rate(&self, _table: u8, index: u8, supported: &[u32]) -> Option<u32> {
            bit_rate(0, index, supported)
        }
    }
    "lss-bit-rates-refused" {
        fn lss_bit_rate(&self, _table: u8, _index: u8, _supported: &[u32]) -> Option<u32> { None }
    }
    "lss-silent-for-one-delay" {
        fn lss_silence(&self, delay: Duration) -> Duration { delay }
    }
    "lss-never-speaks-after-activation" {
        fn lss_silence(&self, _delay: Duration) -> Duration { Duration::from_secs(1 << 20) }
    }
    "lss-store-forgets" {
        fn lss_stores(&self) -> bool { false }
    }
    "lss-stored-for-one-power-on" {
        fn lss_stored_kept(&self) -> bool { false }
    }
    "lss-pending-survives-power" {
        fn lss_forgets_without_supply(&self) -> bool { false }
    }
    "lss-configured-node-says-unconfigured" {
        fn lss_says_unconfigured(&self, _active: u8) -> bool { true }
    }
    "lss-identify-range-inverted" {
        fn lss_bound_met(&self, bound: Bound, own: u32, number: u32) -> bool {
            match bound {
                Bound::Vendor | Bound::Product => own == number,
                Bound::RevisionLow | Bound::SerialLow => own <= number,
                Bound::RevisionHigh | Bound::SerialHigh => own >= number,
            }
        }
    }
    "lss-identify-bounds-excluded" {
        fn lss_bound_met(&self, bound: Bound, own: u32, number: u32) -> bool {
            match bound {
                Bound::Vendor | Bound::Product => own == number,
                Bound::RevisionLow | Bound::SerialLow => own > number,
                Bound::RevisionHigh | Bound::SerialHigh => own < number,
            }
        }
    }
    "lss-identify-any-vendor" {
        fn lss_bound_met(&self, bound: Bound, own: u32, number: u32) -> bool {
            match bound {
                Bound::Vendor | Bound::Product => true,
                Bound::RevisionLow | Bound::SerialLow => own >= number,
                Bound::RevisionHigh | Bound::SerialHigh => own <= number,
            }
        }
    }
    "lss-identify-any-bounds" {
        fn lss_bound_met(&self, bound: Bound, own: u32, number: u32) -> bool {
            !matches!(bound, Bound::Vendor | Bound::Product) || own == number
        }
    }
    "lss-fastscan-of-configured-node" {
        fn lss_scanned(&self, _active: u8, _pending: u8) -> bool { true }
    }
    "lss-fastscan-any-bit" {
        fn lss_scan_valid(&self, scan: Fastscan) -> bool { scan.part < 4 && scan.next < 4 }
    }
    "lss-fastscan-any-next" {
        fn lss_scan_valid(&self, scan: Fastscan) -> bool { scan.bit < 32 && scan.part < 4 }
    }
    "lss-fastscan-in-any-order" {
        fn lss_scan_in_order(&self) -> bool { false }
    }
    "lss-fastscan-ends-early" {
        fn lss_scan_complete(&self, scan: Fastscan) -> bool { scan.next < scan.part }
    }
    "lss-fastscan-never-ends" {
        fn lss_scan_complete(&self, _scan: Fastscan) -> bool { false }
    }
    "lss-scan-not-begun-anew" {
        fn lss_confirm_restarts_scan(&self) -> bool { false }
    }
    "lss-node-id-lost-with-a-bit-rate" {
        fn lss_bit_rate_leaves_node_id(&self) -> bool { false }
    }
    "lss-active-node-id-not-stored" {
        fn lss_node_id_stored(&self, pending: u8, active: u8) -> bool { pending != active }
    }
    "lss-identification-outlives-a-misfit" {
        fn lss_misfit_ends_identification(&self) -> bool { false }
    }
    "lss-switch-delay-in-a-byte" {
        fn lss_silence(&self, delay: Duration) -> Duration {
            Duration::from_millis(delay.as_millis() as u64 & 0xFF) * 2
        }
    }
}
