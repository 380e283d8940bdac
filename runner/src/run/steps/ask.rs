//! The step that polls: a request and its answer, again and again.

use std::time::Duration;

use reports::Event;

use super::judge::{Difference, Judgement, Trouble};
use super::limits::Limits;
use super::run::{DEFAULT_REPLY, Steps};
use crate::suite::constraint::{Allowance, Time};
use crate::suite::literal::show_time;
use crate::suite::step::Ask;

impl Steps<'_, '_> {
    pub(super) fn ask(&mut self, ask: &Ask) -> Judgement {
        let bounds = ask.latency.as_ref();
        let slack = self.policy.bus_slack;
        let limits = bounds.map(|bounds| Limits::new(bounds, &self.scope, slack)).transpose()?;
        let mut taken: Vec<Duration> = Vec::new();
        let mut lenient = None;
        for number in 1..=ask.count.unwrap_or(1) {
            let judged = self.exchange(ask, number, &mut taken)?;
            lenient = lenient.or(judged);
        }
        let Some(limits) = limits else { return Ok(lenient) };
        let reply = self.pattern(&ask.reply)?;
        let what = format!("time to {}", reply.id());
        self.link.emit(Event::Measured(limits.figures(what.clone(), &taken)));
        for time in taken {
            lenient = lenient.or(self.in_time(&limits, (Time::Latency, 1), time, &what)?);
        }
        Ok(lenient)
    }

    /// The exchange with this number; a request without an answer is repeated.
    fn exchange(&mut self, ask: &Ask, number: usize, taken: &mut Vec<Duration>) -> Judgement {
        let first = ask.first.as_ref().map(|first| self.frame(first)).transpose()?;
        let pause = self.optional_time(&ask.pause, Duration::ZERO)?;
        let request = self.frame(&ask.send)?;
        let strict = self.pattern(&ask.reply)?;
        let within = self.optional_time(&ask.within, DEFAULT_REPLY)? + self.policy.slow_wire;
        let tries = ask.tries.unwrap_or(1);
        let id = strict.id();
        for _ in 0..tries {
            if let Some(first) = &first {
                self.link.send(first)?;
                self.link.wait(self.link.mark() + pause)?;
            }
            self.link.send(&request)?;
            let sent = self.link.mark();
            let answer = self.link.find(sent + within, |seen| !seen.own && seen.frame.id == id)?;
            if let Some(answer) = answer {
                taken.push(answer.at.since(sent));
                self.may_decline(&strict, &ask.or_else, &answer)?;
                return self.accept(&ask.reply, &ask.lenient, &answer);
            }
            self.link.skip_to(sent + within);
        }
        if ask.accept_silence {
            self.allows(Allowance::AcceptSilence);
            return Ok(None);
        }
        let requests =
            if tries == 1 { "1 request".to_owned() } else { format!("{tries} requests") };
        let actual = format!("no frame {id} within {} of {requests}", show_time(within));
        if ask.or_silence {
            self.allows(Allowance::OrSilence);
            return Err(Trouble::Declined(format!("expected {strict}, came {actual}")));
        }
        let expected = match ask.count {
            Some(count) if count > 1 => format!("{strict} to request {number} of {count}"),
            _ => strict.to_string(),
        };
        self.margin = within * tries as u32;
        self.broken(&[], Difference::new(expected, actual))
    }
}
