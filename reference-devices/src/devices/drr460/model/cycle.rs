//! A contact that is closed for its share of each cycle (manual, 11.3.2, parameters 40 and 44).

use super::rules::Rules;
use super::state::State;

/// The demand for an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    /// A share of the power, from 0 to 1.
    Share(f64),
    /// All or nothing.
    Level(bool),
    /// The state of an output without a decision of its own.
    State(State),
}

impl Wanted {
    /// The current of the analogue output for it.
    pub(super) fn microamperes(self, live_zero: bool, rules: &Rules) -> f64 {
        match self {
            Self::Share(share) => rules.microamperes(share, live_zero),
            Self::Level(on) => rules.microamperes(f64::from(u8::from(on)), live_zero),
            Self::State(state) => state.microamperes(rules),
        }
    }
}

/// The cycle of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cycle {
    /// Seconds since the cycle began.
    at: f64,
    /// The share of this cycle, where a new one has to wait for the next.
    share: Option<f64>,
}

impl Cycle {
    /// Advances the time.
    pub(super) fn advance(&mut self, elapsed: f64, period: f64) {
        self.at = (self.at + elapsed) % period.max(SHORTEST);
        // A remainder due to rounding is the start of the next cycle.
        if period - self.at < ROUNDING {
            self.at = 0.0;
        }
        if elapsed > 0.0 && self.at < elapsed {
            self.share = None;
        }
    }

    /// The output wants something; returns what it has until the cycle ends.
    pub(super) fn hold(&mut self, wanted: Wanted, rules: &Rules) -> Wanted {
        match wanted {
            Wanted::Share(share) if !rules.share_counts_at_once() => {
                // An output that is always off or always on has no cycle to wait for.
                let is_part = |share: f64| share > 0.0 && share < 1.0;
                let held = self.share.filter(|held| is_part(*held) && is_part(share));
                Wanted::Share(*self.share.insert(held.unwrap_or(share)))
            }
            other => other,
        }
    }

    /// The demand that the output keeps until the cycle ends.
    pub(super) fn held(&self, wanted: Wanted) -> Wanted {
        match (wanted, self.share) {
            (Wanted::Share(_), Some(share)) => Wanted::Share(share),
            (other, _) => other,
        }
    }

    /// Whether the contact is closed now. Each cycle begins closed.
    pub(super) fn is_closed(&self, wanted: Wanted, period: f64, rules: &Rules) -> bool {
        match wanted {
            Wanted::Share(share) => {
                rules.in_share(self.at + ROUNDING, rules.cycle_share(share), period)
            }
            Wanted::Level(on) => on,
            Wanted::State(state) => state.is_closed(rules),
        }
    }

    /// Seconds until the contact changes by itself; `None` when it does not.
    pub(super) fn next(&self, wanted: Wanted, period: f64, rules: &Rules) -> Option<f64> {
        let Wanted::Share(share) = wanted else { return None };
        let share = rules.cycle_share(share);
        let (opens, ends) = (share * period - self.at, period - self.at);
        (share > 0.0 && share < 1.0).then_some(if opens > ROUNDING { opens } else { ends })
    }
}

/// In seconds, as what follows.
const SHORTEST: f64 = 1.0;
const ROUNDING: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    #[test]
    fn a_contact_is_closed_for_its_share_of_the_cycle() {
        let mut cycle = Cycle::default();
        let mut closed = 0;
        for _ in 0..40 {
            closed += u32::from(cycle.is_closed(Wanted::Share(0.25), 2.0, &Rules::plain()));
            cycle.advance(0.1, 2.0);
        }
        assert_eq!(closed, 10);
    }

    #[test]
    fn the_next_edge_is_known() {
        let mut cycle = Cycle::default();
        let wanted = Wanted::Share(0.25);
        let mut edges = Vec::new();
        for _ in 0..4 {
            let next = cycle.next(wanted, 2.0, &Rules::plain()).unwrap();
            cycle.advance(next, 2.0);
            edges.push((
                (next * 10.0).round() as i64,
                cycle.is_closed(wanted, 2.0, &Rules::plain()),
            ));
        }
        assert_eq!(edges, [(5, false), (15, true), (5, false), (15, true)]);
        assert_eq!(
            [0.0, 1.0].map(|share| cycle.next(Wanted::Share(share), 2.0, &Rules::plain())),
            [None, None]
        );
        assert_eq!(cycle.next(Wanted::Level(true), 2.0, &Rules::plain()), None);
    }
}
