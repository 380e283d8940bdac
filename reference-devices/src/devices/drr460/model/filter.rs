//! The filter of the analogue input (manual, 11.3.2, parameter 10).

use std::collections::VecDeque;

use super::PERIOD;
use super::rules::Rules;

/// The average of the last samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Filter {
    samples: VecDeque<f64>,
    /// Seconds since the last sample.
    since: f64,
}

impl Filter {
    /// Takes a sample, `elapsed` seconds after the last one, and the number of samples to average.
    /// The first sample fills the average, so that it need not climb from zero; an early sample
    /// replaces the last one.
    pub(super) fn take(&mut self, sample: f64, wanted: i64, elapsed: f64, rules: &Rules) -> f64 {
        if !rules.filters_by_mean() {
            return self.follow(sample, wanted, elapsed);
        }
        let wanted = usize::try_from(wanted).unwrap_or(1).max(1);
        self.since += elapsed;
        if self.since + ROUNDING < PERIOD {
            self.samples.pop_back();
        } else {
            self.since = 0.0;
        }
        self.samples.push_back(sample);
        while rules.filter_starts_full() && self.samples.len() < wanted {
            self.samples.push_front(self.samples[0]);
        }
        while self.samples.len() > rules.kept_samples(wanted) {
            self.samples.pop_front();
        }
        let last = self.samples.iter().rev().take(wanted);
        last.clone().sum::<f64>() / last.len() as f64
    }

    /// Follows the samples with a time constant given in periods; 1 does not filter.
    fn follow(&mut self, sample: f64, wanted: i64, elapsed: f64) -> f64 {
        let last = self.samples.pop_back().filter(|_| wanted > 1).unwrap_or(sample);
        let time = wanted as f64 * PERIOD;
        let value = sample + (last - sample) * (-elapsed / time).exp();
        let value = if (value - sample).abs() < NOTICED { sample } else { value };
        self.samples = VecDeque::from([sample, value]);
        value
    }

    /// Restarts.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether another sample like the last one would change nothing, now and after a step.
    pub(super) fn is_settled(&self, wanted: i64, rules: &Rules) -> bool {
        let kept = rules.kept_samples(usize::try_from(wanted).unwrap_or(1));
        let grows = rules.filters_by_mean() && self.samples.len() < kept;
        !grows && self.samples.iter().all(|sample| Some(sample) == self.samples.back())
    }
}

const ROUNDING: f64 = 1e-6;
/// Digits below which a lag has arrived.
const NOTICED: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    #[test]
    fn a_step_arrives_in_as_many_samples_as_are_averaged() {
        let mut filter = Filter::default();
        assert_eq!(filter.take(100.0, 4, 0.1, &Rules::plain()), 100.0);
        assert_eq!(
            [(); 5].map(|()| filter.take(200.0, 4, 0.1, &Rules::plain())),
            [125.0, 150.0, 175.0, 200.0, 200.0]
        );
        assert!(filter.is_settled(4, &Rules::plain()));
        assert_eq!([(); 2].map(|()| filter.take(240.0, 4, 0.05, &Rules::plain())), [210.0, 220.0]);
        assert_eq!(filter.take(0.0, 1, 0.1, &Rules::plain()), 0.0);
    }

    /// It goes on with equal samples, since a step changes less when there are more of them.
    #[test]
    fn a_mean_that_begins_with_one_sample_settles_when_it_has_all() {
        let rules = Rules::otherwise("filter-starts-full: false");
        let mut filter = Filter::default();
        let settles = [(); 4].map(|()| {
            filter.take(100.0, 4, 0.1, &rules);
            filter.is_settled(4, &rules)
        });
        assert_eq!(settles, [false, false, false, true]);
        assert_eq!(filter.take(200.0, 4, 0.1, &rules), 125.0);
    }
}
