//! The steps on the physical side, and its state after a case.

use std::time::Duration;

use canopen::bench::POWER;
use canopen::sdo::Transfer;
use canopen::{BenchError, BusError, Value};

use super::apart;
use super::judge::{Difference, Judgement, Trouble};
use super::run::Steps;
use crate::dut::Dut;
use crate::plan::Instance;
use crate::run::link::Link;
use crate::run::link::sdo;
use crate::run::policy::Policy;
use crate::run::rest::bench;
use crate::source::At;
use crate::suite::constraint::Constraint;
use crate::suite::literal::{Literal, show_time};
use crate::suite::step::{Observe, Stimuli};

/// How often a bench is asked: often for one in this process, bearable for one at a socket.
const EVERY: Duration = Duration::from_millis(5);

impl Steps<'_, '_> {
    /// Sets all stimuli of a step. A device may answer to the first before a bench has set the
    /// last.
    pub(super) fn stimulate_bench(&mut self, stimuli: &Stimuli) -> Judgement {
        self.link.look_from_now()?;
        for (name, literal) in &stimuli.0 {
            let value = self.scope.value(&literal.value).map_err(Trouble::Impossible)?;
            let value = worded(name, value);
            let shown = self.words.bench_value(name, &value);
            self.bench_snapshot.set(self.link, name, &value, shown)?.map_err(failed)?;
        }
        Ok(None)
    }

    pub(super) fn observe(&mut self, observe: &Observe) -> Judgement {
        let name = &observe.bench.value;
        let value = |literal: &Option<At<Literal>>| {
            let literal = literal.as_ref().map(|literal| self.scope.value(&literal.value));
            literal
                .transpose()
                .map(|value| value.map(|value| worded(name, value)))
                .map_err(Trouble::Impossible)
        };
        let wanted = [value(&observe.value)?, value(&observe.min)?, value(&observe.max)?];
        let within = self.optional_time(&observe.within, Duration::ZERO)? * self.patience;
        let end = self.link.mark() + within;
        loop {
            let seen = bench(self.link).and_then(|bench| bench.get(name)).map_err(failed)?;
            if misfits(&seen, &wanted).next().is_none() {
                self.link.moved();
                return Ok(None);
            }
            let next = self.link.now() + EVERY;
            if next > end {
                let shown = |value: &Value| self.words.bench_value(name, value);
                let wanted_words = show(&wanted, &shown);
                let expected = format!("{name} = {wanted_words} within {}", show_time(within));
                let wrong: Vec<Constraint> = misfits(&seen, &wanted).collect();
                let apart = self.off_bounds(name, &seen, &wanted);
                let difference = Difference { apart, ..Difference::new(expected, shown(&seen)) };
                return self.broken(&wrong, difference);
            }
            self.link.wait(next)?;
        }
    }
}

impl Steps<'_, '_> {
    /// How far a number is from what was wanted, in its unit.
    fn off_bounds(&self, name: &str, seen: &Value, wanted: &[Option<Value>; 3]) -> Option<String> {
        let seen = seen.as_real()?;
        let [value, min, max] = wanted.each_ref().map(|wanted| wanted.as_ref()?.as_real());
        let by = match (value, min, max) {
            (Some(value), ..) => seen - value,
            (None, Some(min), _) if seen < min => seen - min,
            (None, _, Some(max)) if seen > max => seen - max,
            _ => return None,
        };
        let amount = self.words.bench_amount(name, by.abs())?;
        Some(apart::too_much(by > 0.0, &amount))
    }
}

/// The bench did not do what it was asked.
fn failed(error: BenchError) -> Trouble {
    Trouble::Impossible(error.0)
}

/// Sets the device up for the bench actions of this case. Returns why the device does not accept
/// that, if so.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn meet_needs(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    instance: &Instance,
) -> Result<Option<String>, BusError> {
    for (mux, value) in instance.bench_needs(dut) {
        let unmet = |why: String| Ok(Some(format!("the bench needs {mux} = {value}, {why}")));
        let Some(entry) = dut.eds.entry(mux) else {
            return unmet("which the data sheet does not have".to_owned());
        };
        let data = match entry.data_type.encode(&Value::Int(value.into())) {
            Ok(data) => data,
            Err(wrong) => return unmet(format!("which it cannot be: {wrong}")),
        };
        let flow = Transfer::usual(data.len());
        if let Err(failure) = sdo::download(link, policy, dut.node, mux, &data, flow)?.result {
            return unmet(format!("which the device does not take: {failure}"));
        }
    }
    Ok(None)
}

/// YAML takes `on` and `off` for truth values; of a supply they are words.
fn worded(name: &str, value: Value) -> Value {
    match value {
        Value::Bool(on) if name == POWER => Value::Text(if on { "on" } else { "off" }.to_owned()),
        other => other,
    }
}

/// The observations that are not as wanted.
fn misfits(
    seen: &Value,
    [value, min, max]: &[Option<Value>; 3],
) -> impl Iterator<Item = Constraint> {
    let equal = |value: &Value| match (value.as_real(), seen.as_real()) {
        (Some(value), Some(seen)) => value == seen,
        _ => value == seen,
    };
    let bounds = |bound: &Option<Value>, fits: fn(f64, f64) -> bool| {
        let bound = bound.as_ref().map(Value::as_real);
        bound.is_none_or(|bound| bound.zip(seen.as_real()).is_some_and(|(b, seen)| fits(seen, b)))
    };
    let table = [
        (Constraint::Value, value.as_ref().is_none_or(equal)),
        (Constraint::Min, bounds(min, |seen, min| seen >= min)),
        (Constraint::Max, bounds(max, |seen, max| seen <= max)),
    ];
    table.into_iter().filter(|(_, fits)| !fits).map(|(constraint, _)| constraint)
}

fn show([value, min, max]: &[Option<Value>; 3], shown: &dyn Fn(&Value) -> String) -> String {
    let words = [("", value), ("at least ", min), ("at most ", max)];
    let words = words
        .iter()
        .filter_map(|(word, value)| Some(format!("{word}{}", shown((*value).as_ref()?))));
    words.collect::<Vec<_>>().join(", ")
}
