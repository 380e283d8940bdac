//! The steps that judge times and count frames.

use std::time::Duration;

use canopen::{Frame, Instant};
use reports::{Event, Measured};

use super::judge::{Difference, Judgement, Trouble};
use super::limits::{Limits, mean, median};
use super::run::Steps;
use crate::run::link::Lateness;
use crate::suite::constraint::{Allowance, Constraint, Time};
use crate::suite::literal::show_time;
use crate::suite::step::{Bounds, Collect, Measure};

/// How long a measurement waits for a frame that has no upper bound.
const UNBOUNDED_PATIENCE: Duration = Duration::from_secs(10);

impl Steps<'_, '_> {
    pub(super) fn measure(&mut self, measure: &Measure) -> Judgement {
        let pattern = self.pattern(&measure.frame)?;
        let start = self.begin(measure.during.as_ref())?;
        self.stimulate(measure.during.as_ref())?;
        let sent = self.link.mark().max(start);
        self.link_rewind(measure.during.is_some(), start);
        let slack = self.policy.bus_slack;
        let intervals = measure.count.saturating_sub(1).max(1) as u32;
        // The mean of many intervals suffers from only one frame in front of the first and last.
        let limits = |bounds: &Option<Bounds>, slack| {
            bounds.as_ref().map(|bounds| Limits::new(bounds, &self.scope, slack)).transpose()
        };
        let each = limits(&measure.interval, slack)?;
        let average = limits(&measure.mean, slack / intervals)?;
        let middle = limits(&measure.median, slack / intervals)?;
        let late = limits(&measure.latency, slack)?;
        let longest = each.as_ref().or(late.as_ref()).map_or(Duration::MAX, Limits::longest);
        let patience = longest.min(UNBOUNDED_PATIENCE) * 2;
        let first = self.optional_time(&measure.within, patience)?;
        let Some(stamps) = self.stamps(measure, (start, sent), (first, patience))? else {
            return Ok(None);
        };
        self.own_jitter();
        let intervals: Vec<Duration> =
            stamps.windows(2).map(|pair| pair[1].since(pair[0])).collect();
        let what = format!("interval of {}", pattern.id());
        let only = |limits: &Option<Limits>, of: fn(&[Duration]) -> Duration| {
            limits.iter().map(|_| of(&intervals)).collect::<Vec<_>>()
        };
        let (mean, median) = (only(&average, mean), only(&middle, median));
        let mut latencies = (String::new(), Vec::new());
        if let (Some(_), Some(during)) = (&late, &measure.during) {
            let asked = self.frame(&during.frame)?;
            let what = format!("time from {} to {}", asked.id, pattern.id());
            latencies = (what, self.latencies(&asked, start, &stamps));
        }
        // The limit, its name, the measured values, and those of them that are judged.
        let table = [
            (each, Time::Interval, what.clone(), &intervals, &intervals),
            (average, Time::Mean, format!("mean {what}"), &intervals, &mean),
            (middle, Time::Median, format!("median {what}"), &intervals, &median),
            (late, Time::Latency, latencies.0, &latencies.1, &latencies.1),
        ];
        let mut lenient = None;
        for (limits, time, what, taken, judged) in table {
            let Some(limits) = limits else { continue };
            self.link.emit(Event::Measured(limits.figures(what.clone(), taken)));
            // A late stamp moves a mean by one part of as many as it has values.
            let parts = (taken.len() / judged.len().max(1)).max(1) as u32;
            for took in judged {
                lenient = lenient.or(self.in_time(&limits, (time, parts), *took, &what)?);
            }
        }
        Ok(lenient)
    }

    /// When the frames came; `None` when there were too few, and the steps go on.
    fn stamps(
        &mut self,
        measure: &Measure,
        (start, sent): (Instant, Instant),
        (first, patience): (Duration, Duration),
    ) -> Result<Option<Vec<Instant>>, Trouble> {
        let mut pattern = self.pattern(&measure.frame)?;
        let (mut stamps, mut open) = (Vec::new(), false);
        while stamps.len() < measure.count {
            let wait = if stamps.is_empty() { first } else { patience };
            let until = self.link.mark().max(sent) + wait;
            let got = self.link.find(until, |seen| !seen.own && pattern.matches(&seen.frame))?;
            if let Some(got) = got {
                stamps.push(got.at);
                continue;
            }
            self.awaited = wait;
            let expected = format!("{} frames {pattern}", measure.count);
            let actual = format!("{}, then none for {}", stamps.len(), show_time(wait));
            let difference = Difference::new(expected, actual);
            let near = self.nearly(&measure.frame, (start, until), |count| count > 0)?;
            let Some(odd) = near.filter(|_| !open) else {
                self.broken(&[], difference)?;
                return Ok(None);
            };
            self.broken(&odd, difference)?;
            (pattern, open) = (self.pattern_without(&measure.frame, &odd)?, true);
            self.link.look_from(start);
            stamps.clear();
        }
        Ok(Some(stamps))
    }

    /// Judges one time, which may be the mean of as many `parts`.
    pub(super) fn in_time(
        &mut self,
        limits: &Limits,
        (time, parts): (Time, u32),
        took: Duration,
        what: &str,
    ) -> Judgement {
        let Some(difference) = limits.difference(took, what) else { return Ok(None) };
        let (low, high) = limits.accepted();
        self.margin = low.saturating_sub(took).max(took.saturating_sub(high)) * parts;
        if took < low {
            return self.broken(&[Constraint::Low(time)], difference);
        }
        if took > high {
            return self.broken(&[Constraint::High(time)], difference);
        }
        self.allows(Allowance::Bounds(time));
        Ok(Some(difference))
    }

    /// How long after the first `asked` the first of the stamps is, and so on.
    fn latencies(&self, asked: &Frame, start: Instant, stamps: &[Instant]) -> Vec<Duration> {
        let trace = self.link.trace().iter().map(|seen| &seen.stamped);
        let sent = trace.filter(|sent| sent.own && sent.frame == *asked && sent.at >= start);
        sent.zip(stamps).map(|(sent, answered)| answered.since(sent.at)).collect()
    }

    pub(super) fn collect(&mut self, collect: &Collect) -> Judgement {
        let pattern = self.pattern(&collect.frame)?;
        let wanted = self.scope.int(&collect.count.value).map_err(Trouble::Impossible)?;
        let time = self.time(&collect.time)? + self.policy.slow_wire;
        let start = self.begin(collect.during.as_ref())?;
        self.stimulate(collect.during.as_ref())?;
        let until = self.link.mark() + time;
        self.link_rewind(collect.during.is_some(), start);
        let mut count = 0;
        while self.link.find(until, |seen| !seen.own && pattern.matches(&seen.frame))?.is_some() {
            count += 1;
        }
        self.link.skip_to(until);
        if count == wanted {
            return Ok(None);
        }
        // What is expected is the same in each attempt, and how long sending takes is not.
        let expected = format!("{wanted} frames {pattern}");
        let actual = format!("{count} in {}", show_time(until.since(start)));
        let difference = Difference::new(expected, actual);
        let fits = |count| count as i128 == wanted;
        let broken = match count < wanted {
            false => vec![Constraint::Many],
            true => {
                let nearly = self.nearly(&collect.frame, (start, until), fits)?;
                nearly.unwrap_or_else(|| vec![Constraint::Few])
            }
        };
        self.broken(&broken, difference)
    }

    /// The figures of the tester itself, which those of the device cannot be better than.
    fn own_jitter(&mut self) {
        let Lateness { noticed, soonest, sum, count, .. } = self.link.lateness();
        if count == 0 {
            return;
        }
        let ms = |time: Duration| time.as_nanos() as f64 / 1e6;
        self.link.emit(Event::Measured(Measured {
            what: "lateness of the tester".to_owned(),
            unit: "ms".to_owned(),
            count: count.into(),
            min: ms(soonest),
            mean: ms(sum / count),
            max: ms(noticed),
            strict: None,
            lenient: None,
        }));
    }
}
