//! Heartbeat, guarding, and what an error does to the NMT state.

use std::time::Duration;

use canopen::NmtState;

use super::Layer;

decisions! {
    /// The decisions of error control (CiA 301, 7.2.8.2, 7.2.8.3.2 and 7.5.2.32).
    pub trait ErrorControlRules: Layer;

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

    /// Heartbeats come with the period alone; the standard forbids no more of them.
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

    /// The loss of a node ends when that node is back, wherever the others are.
    fn lost_nodes_end_one_by_one(&self) -> bool {
        true
    }

    /// Nodes are watched in every state (7.3.2.2.5).
    fn nodes_watched_in(&self, _state: NmtState) -> bool {
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
    ErrorControlRules;

    "heartbeat-period-drifts" {
        fn heartbeat_period(&self, configured: Duration) -> Duration {
            configured * 101 / 100
        }
    }
    "heartbeat-period-of-15-bits" {
        fn heartbeat_period(&self, configured: Duration) -> Duration {
            Duration::from_millis((configured.as_millis() as u64 & 0x7FFF).max(1))
        }
    }
    "heartbeat-burst-at-boot-up" {
        fn heartbeats_at_boot_up(&self) -> u32 { 3 }
    }
    "heartbeat-begins-at-once" {
        fn heartbeat_begins_at_once(&self) -> bool { true }
    }
    "heartbeat-at-change-of-state" {
        fn heartbeat_at_change_of_state(&self) -> bool { true }
    }
    "guarding-needs-guard-time" {
        fn guarding_needs_guard_time(&self) -> bool { true }
    }
    "guarding-needs-life-time-factor" {
        fn guarding_needs_life_time_factor(&self) -> bool { true }
    }
    "error-classes-are-one" {
        fn error_class(&self, _sub: u8) -> Option<u8> { Some(1) }
    }
    "errors-of-the-application-without-reaction" {
        fn error_class(&self, sub: u8) -> Option<u8> { (sub == 1).then_some(sub) }
    }
    "error-behaviour-ignored" {
        fn error_reaction(&self, _configured: u8) -> Option<NmtState> { None }
    }
    "heartbeat-watched-before-first" {
        fn first_heartbeat_starts_watch(&self) -> bool { false }
    }
    "heartbeat-loss-never-recovers" {
        fn heartbeat_loss_recovers(&self) -> bool { false }
    }
    "heartbeat-error-outlives-its-entry" {
        fn end_of_watch_ends_error(&self) -> bool { false }
    }
    "lost-nodes-end-together" {
        fn lost_nodes_end_one_by_one(&self) -> bool { false }
    }
    "nodes-not-watched-in-stopped" {
        fn nodes_watched_in(&self, state: NmtState) -> bool { state != NmtState::STOPPED }
    }
    "heartbeat-losses-told-once" {
        fn each_lost_node_told(&self) -> bool { false }
    }
    "heartbeat-consumer-time-doubled" {
        fn heartbeat_consumer_time(&self, configured: Duration) -> Duration { configured * 2 }
    }
    "heartbeat-consumer-time-quartered" {
        fn heartbeat_consumer_time(&self, configured: Duration) -> Duration { configured / 4 }
    }
    "heartbeat-of-any-state" {
        fn is_heartbeat(&self, _state: NmtState) -> bool { true }
    }
    "life-guarding-beside-heartbeat" {
        fn heartbeat_ends_life_guarding(&self, _runs: bool) -> bool { false }
    }
    "life-guarding-ends-with-the-write-of-1017h" {
        fn heartbeat_ends_life_guarding(&self, _runs: bool) -> bool { true }
    }
    "errors-change-every-state" {
        fn errors_change(&self, _state: NmtState) -> bool { true }
    }
    "heartbeat-node-watched-twice" {
        fn heartbeat_node_taken(&self, _other: u8, _used: bool, _node: u8) -> bool { false }
    }
    "heartbeat-node-taken-by-an-unused-entry" {
        fn heartbeat_node_taken(&self, other: u8, _used: bool, node: u8) -> bool { other == node }
    }
    "heartbeat-nodes-in-their-order" {
        fn heartbeat_node_taken(&self, other: u8, used: bool, node: u8) -> bool {
            used && other >= node
        }
    }
    "guarding-answered-beside-heartbeat" {
        fn guarding_answered(&self, _heartbeat_runs: bool) -> bool { true }
    }
    "guarding-toggle-stuck" {
        fn guarding_toggle_after(&self, toggle: bool) -> bool { toggle }
    }
    "guarding-toggle-kept-over-reset" {
        fn guarding_toggle_after_reset(&self, toggle: bool) -> bool { toggle }
    }
    "life-guarding-before-first-question" {
        fn first_question_starts_life_time(&self) -> bool { false }
    }
    "life-time-factor-0-is-1" {
        fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
            guard_time * u32::from(factor.max(1))
        }
    }
    "life-time-quartered" {
        fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
            guard_time * u32::from(factor) / 4
        }
    }
    "life-time-factor-ignored" {
        fn life_time(&self, guard_time: Duration, factor: u8) -> Duration {
            if factor == 0 { Duration::ZERO } else { guard_time }
        }
    }
    "heartbeat-restarts-with-each-state" {
        fn state_change_restarts_heartbeat(&self) -> bool { true }
    }
    "heartbeat-return-not-seen-in-stopped" {
        fn heartbeat_return_seen_in(&self, state: NmtState) -> bool { state != NmtState::STOPPED }
    }
    "heartbeat-of-a-stopped-node-ignored" {
        fn is_heartbeat(&self, state: NmtState) -> bool {
            matches!(state, NmtState::OPERATIONAL | NmtState::PRE_OPERATIONAL)
        }
    }
    "heartbeat-consumer-time-of-15-bits" {
        fn heartbeat_consumer_time(&self, configured: Duration) -> Duration {
            Duration::from_millis(configured.as_millis() as u64 & 0x7FFF)
        }
    }
    "guarding-toggle-reset-by-parameters" {
        fn guarding_toggle_after_configuration(&self, _toggle: bool) -> bool { false }
    }
    "life-guarding-cannot-be-switched-off" {
        fn life_guarding_can_end(&self) -> bool { false }
    }
    "no-life-guarding-in-stopped" {
        fn life_guarded_in(&self, state: NmtState) -> bool { state != NmtState::STOPPED }
    }
    "life-time-not-restarted-in-stopped" {
        fn guarding_restarts_life_time_in(&self, state: NmtState) -> bool {
            state != NmtState::STOPPED
        }
    }
}
