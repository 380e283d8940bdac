//! Limits of a measured time, and figures for the report.

use std::time::Duration;

use reports::Measured;

use super::judge::{Difference, Trouble};
use crate::plan::Scope;
use crate::suite::literal::{Tolerance, show_time};
use crate::suite::step::Bounds;

type Span = (Duration, Duration);

/// The limits of a time, with the allowance for the bus.
#[derive(Clone, Debug)]
pub(super) struct Limits {
    strict: Span,
    lenient: Option<Span>,
}

impl Limits {
    /// The limits of a suite, widened by `slack`: how late a frame may be because another one is
    /// on the wire.
    ///
    /// # Errors
    /// When the slack is more than the tolerance: such a bench cannot judge.
    pub(super) fn new(bounds: &Bounds, scope: &Scope, slack: Duration) -> Result<Self, Trouble> {
        let widened = |tolerance: &Tolerance| {
            let (low, high) = scope.bounds(tolerance).map_err(Trouble::Impossible)?;
            let tolerance = high.saturating_sub(low);
            if high != Duration::MAX && tolerance < slack {
                return Err(Trouble::Unjudged(format!(
                    "one frame on this bus takes {}, which is more than the tolerance of {}",
                    show_time(slack),
                    show_time(tolerance)
                )));
            }
            Ok((low.saturating_sub(slack), high.saturating_add(slack)))
        };
        let lenient = bounds.lenient.as_ref().map(|lenient| widened(&lenient.value));
        Ok(Self { strict: widened(&bounds.strict.value)?, lenient: lenient.transpose()? })
    }

    /// The longest time that is accepted.
    pub(super) fn longest(&self) -> Duration {
        self.accepted().1
    }

    /// From where to where a time is accepted.
    pub(super) fn accepted(&self) -> Span {
        self.lenient.unwrap_or(self.strict)
    }

    /// The difference of a time outside the strict limits.
    pub(super) fn difference(&self, value: Duration, what: &str) -> Option<Difference> {
        let (low, high) = self.strict;
        let lies_within = (low..=high).contains(&value);
        let expected = || format!("{what}: {}", show_span(self.strict));
        (!lies_within).then(|| Difference::new(expected(), show_time(value)))
    }

    /// The figures of a series of intervals.
    pub(super) fn figures(&self, what: String, intervals: &[Duration]) -> Measured {
        let ms = |time: Duration| time.as_nanos() as f64 / 1e6;
        Measured {
            what,
            unit: "ms".to_owned(),
            count: intervals.len() as u64,
            min: ms(intervals.iter().copied().min().unwrap_or_default()),
            mean: ms(mean(intervals)),
            max: ms(intervals.iter().copied().max().unwrap_or_default()),
            strict: Some(show_span(self.strict)),
            lenient: self.lenient.map(show_span),
        }
    }
}

/// The arithmetic mean; zero of nothing.
pub(super) fn mean(intervals: &[Duration]) -> Duration {
    let count = u32::try_from(intervals.len()).unwrap_or(u32::MAX).max(1);
    intervals.iter().sum::<Duration>() / count
}

/// The middle one by size; zero of nothing.
pub(super) fn median(intervals: &[Duration]) -> Duration {
    let mut sorted = intervals.to_vec();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

fn show_span((low, high): Span) -> String {
    match high {
        Duration::MAX => format!("at least {}", show_time(low)),
        _ => format!("{} to {}", show_time(low), show_time(high)),
    }
}
