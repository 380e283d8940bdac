//! Heartbeat, guarding, and the effect of an error on the NMT state.

use std::time::Duration;

use canopen::NmtState;

use super::Rules;

/// What a state lets a device do beside error control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Take SYNC.
    Sync,
    /// Transmit PDOs.
    Tpdo,
    /// Use PDOs that it receives.
    Rpdo,
    /// Serve SDOs.
    Sdo,
}

decisions! {
    /// The decisions of error control (CiA 301, 7.2.8.2, 7.2.8.3.2 and 7.5.2.32).
    pub ErrorControlDecision of Rules, otherwise [DEVIATIONS];

    /// The producer keeps the period of 1017h (7.5.2.20).
    fn heartbeat_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// The first heartbeat comes one period after boot-up.
    fn heartbeats_at_boot_up(&self) -> u32 {
        0
    }

    /// A producer that is configured sends its first heartbeat after one period; the standard lets
    /// it begin at once (7.2.8.3.2.2).
    fn heartbeat_begins_at_once(&self) -> bool {
        false
    }

    /// Heartbeats follow the period alone, although the standard permits further ones.
    fn heartbeat_at_change_of_state(&self) -> bool {
        false
    }

    /// The consumer waits as long as 1016h says (7.5.2.19).
    fn heartbeat_consumer_time(&self, configured: Duration) -> Duration {
        configured
    }

    /// A node is watched from its first heartbeat on (7.2.8.3.2.2).
    fn first_heartbeat_starts_watch(&self) -> bool {
        true
    }

    /// The next heartbeat of a node that was lost ends the error.
    fn heartbeat_loss_recovers(&self) -> bool {
        true
    }

    /// Only the three states of a node that runs are a sign of life; a boot-up message
    /// indicates a restart.
    fn is_heartbeat(&self, state: NmtState) -> bool {
        matches!(state, NmtState::STOPPED | NmtState::OPERATIONAL | NmtState::PRE_OPERATIONAL)
    }

    /// Each node that is lost is reported.
    fn each_lost_node_told(&self) -> bool {
        true
    }

    /// The loss of a node ends when that node is back, regardless of the other nodes.
    fn lost_nodes_end_one_by_one(&self) -> bool {
        true
    }

    /// Nodes are watched in every state (7.3.2.2.5).
    fn nodes_watched_in(&self, _state: NmtState) -> bool {
        true
    }

    /// Nodes are watched by a device without a heartbeat of its own as well (7.5.2.19).
    fn nodes_watched_without_heartbeat(&self) -> bool {
        true
    }

    /// An entry that is not used any more ends its watch (7.5.2.19).
    fn unused_entry_ends_watch(&self) -> bool {
        true
    }

    /// An entry that no longer watches a node that was lost ends the error.
    fn end_of_watch_ends_error(&self) -> bool {
        true
    }

    /// Two entries of 1016h do not name the same node (7.5.2.19).
    fn heartbeat_node_taken(&self, other: u8, used: bool, node: u8) -> bool {
        used && other == node
    }

    /// Guarding and heartbeat exclude each other, and heartbeat goes first (7.2.8.2.2.1).
    fn guarding_answered(&self, heartbeat_runs: bool) -> bool {
        !heartbeat_runs
    }

    /// The guard time configures life guarding alone, so that 0 is no reason to be silent.
    fn guarding_needs_guard_time(&self) -> bool {
        false
    }

    /// Nor is a life time factor of 0.
    fn guarding_needs_life_time_factor(&self) -> bool {
        false
    }

    /// The toggle bit alternates from answer to answer (7.2.8.3.2.1).
    fn guarding_toggle_after(&self, toggle: bool) -> bool {
        !toggle
    }

    /// It starts at 0 after a reset (7.2.8.3.2.1).
    fn guarding_toggle_after_reset(&self, _toggle: bool) -> bool {
        false
    }

    /// Life guarding waits for guard time times life time factor (7.5.2.12).
    fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
        guard_time * u32::from(factor)
    }

    /// Life guarding begins with the first question (7.2.8.2.2.1).
    fn first_question_starts_life_time(&self) -> bool {
        true
    }

    /// While heartbeats are produced, there is no life guarding (7.2.8.2.2.1).
    fn heartbeat_ends_life_guarding(&self, runs: bool) -> bool {
        runs
    }

    /// A communication error changes the state of an operational device only (7.5.2.32).
    fn errors_change(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// Each class of errors has its own entry of 1029h, communication errors sub 1 (7.5.2.32).
    fn error_class(&self, sub: u8) -> Option<u8> {
        Some(sub)
    }

    /// It decides: PRE-OPERATIONAL, nothing, or STOPPED (7.5.2.32).
    fn error_reaction(&self, configured: u8) -> Option<NmtState> {
        match configured {
            0 => Some(NmtState::PRE_OPERATIONAL),
            2 => Some(NmtState::STOPPED),
            _ => None,
        }
    }

    /// It ends what the new state does not have, as a command does (7.3.2.2.5).
    fn reaction_ends(&self, _service: Service) -> bool {
        true
    }

    /// A change of the state does not disturb the beat (7.2.8.3.2.2).
    fn state_change_restarts_heartbeat(&self) -> bool {
        false
    }

    /// A lost node is found again in every state (7.3.2.2.5).
    fn heartbeat_return_seen_in(&self, _state: NmtState) -> bool {
        true
    }

    /// New values of 100Ch and 100Dh leave the toggle bit alone (7.2.8.3.2.1).
    fn guarding_toggle_after_configuration(&self, toggle: bool) -> bool {
        toggle
    }

    /// Nor does the life guarding event touch it (7.2.8.3.2.1).
    fn guarding_toggle_after_life_guarding_event(&self, toggle: bool) -> bool {
        toggle
    }

    /// What is written to other objects leaves monitoring and life guarding alone that have begun.
    fn settings_leave_error_control(&self) -> bool {
        true
    }

    /// A life time of 0 ends life guarding that has begun (7.5.2.12).
    fn life_guarding_can_end(&self) -> bool {
        true
    }

    /// Life guarding works in every state (7.3.2.2.5).
    fn life_guarded_in(&self, _state: NmtState) -> bool {
        true
    }

    /// A guarding request restarts the life time in every state (7.3.2.2.5).
    fn guarding_restarts_life_time_in(&self, _state: NmtState) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of ErrorControlDecision;

    "errors-change-pre-operational" => errors_change:
        |_, state| matches!(state, NmtState::OPERATIONAL | NmtState::PRE_OPERATIONAL);
    "heartbeat-period-doubled" => heartbeat_period: |_, configured| configured * 2;
    "heartbeat-period-drifts" => heartbeat_period: |_, configured| configured * 101 / 100;
    "heartbeat-period-of-15-bits" => heartbeat_period: |_, configured| {
        Duration::from_millis((configured.as_millis() as u64 & 0x7FFF).max(1))
    };
    "tpdos-outlive-operational" => reaction_ends: |_, service| {
        !matches!(service, Service::Tpdo | Service::Sync)
    };
    "rpdos-outlive-operational" => reaction_ends: |_, service| service != Service::Rpdo;
    "sdo-outlives-operational" => reaction_ends: |_, service| service != Service::Sdo;
    "errors-of-the-application-without-reaction" => error_class: |_, sub| (sub == 1).then_some(sub);
    "nodes-not-watched-in-stopped" => nodes_watched_in: |_, state| state != NmtState::STOPPED;
    "heartbeat-consumer-time-doubled" => heartbeat_consumer_time: |_, configured| configured * 2;
    "heartbeat-consumer-time-tenfold" => heartbeat_consumer_time: |_, configured| configured * 10;
    "heartbeat-consumer-tick-of-32-ms" => heartbeat_consumer_time: |_, configured| {
        Duration::from_millis((configured.as_millis() as u64).next_multiple_of(32))
    };
    "heartbeat-consumer-time-quartered" => heartbeat_consumer_time: |_, configured| configured / 4;
    "heartbeat-node-taken-by-an-unused-entry" =>
        heartbeat_node_taken: |_, other, _, node| other == node;
    "heartbeat-nodes-in-their-order" =>
        heartbeat_node_taken: |_, other, used, node| used && other >= node;
    "guarding-toggle-stuck" => guarding_toggle_after: |_, toggle| toggle;
    "guarding-toggle-kept-over-reset" => guarding_toggle_after_reset: |_, toggle| toggle;
    "life-time-factor-0-is-1" =>
        life_time: |_, guard_time, factor| guard_time * u32::from(factor.max(1));
    "life-time-quartered" => life_time: |_, guard_time, factor| guard_time * u32::from(factor) / 4;
    "life-time-factor-ignored" =>
        life_time: |_, guard_time, factor| if factor == 0 { Duration::ZERO } else { guard_time };
    "heartbeat-return-not-seen-in-stopped" =>
        heartbeat_return_seen_in: |_, state| state != NmtState::STOPPED;
    "heartbeat-of-a-stopped-node-ignored" =>
        is_heartbeat: |_, state| matches!(state, NmtState::OPERATIONAL | NmtState::PRE_OPERATIONAL);
    "heartbeat-consumer-time-of-15-bits" => heartbeat_consumer_time: |_, configured| {
        Duration::from_millis(configured.as_millis() as u64 & 0x7FFF)
    };
    "no-life-guarding-in-stopped" => life_guarded_in: |_, state| state != NmtState::STOPPED;
    "life-time-not-restarted-in-stopped" =>
        guarding_restarts_life_time_in: |_, state| state != NmtState::STOPPED;
}
