//! What is known about the device when it failed, from the frames until then.

use std::collections::BTreeMap;

use canopen::{Instant, Mux, Value};

use super::excerpt::Excerpt;
use super::subject::Subject;
use super::trace::{Kind, Trace};
use crate::event::Begun;

/// What is left out of the excerpt, by kind, and whether an emergency message came.
pub(super) fn left_out(trace: &Trace, excerpt: &Excerpt) -> String {
    let mut left: Vec<String> =
        excerpt.left.iter().map(|(kind, count)| kind.counted(*count)).collect();
    match excerpt.actions {
        0 => {}
        1 => left.push("1 step".to_owned()),
        many => left.push(format!("{many} steps")),
    }
    let left = if left.is_empty() { "nothing".to_owned() } else { left.join(", ") };
    let emergencies = trace.groups.iter().filter(|group| group.kind == Kind::Emergency);
    match emergencies.count() {
        0 => format!("{left}; no EMCY"),
        many => format!("{left}; {many} EMCY"),
    }
}

/// The values that were read of the object in question, and the last of process data objects that
/// the excerpt does not show, each with its time.
pub(super) fn known(
    trace: &Trace,
    excerpt: &Excerpt,
    subject: &Subject,
    steps: &[&Begun],
) -> (Option<String>, Vec<usize>) {
    let reads = subject.object.and_then(|mux| {
        let began = |step: Option<&&Begun>| step.map_or(Instant::ZERO, |step| step.at);
        let in_step = values(trace, mux, began(steps.last()));
        match in_step.len() {
            0 | 1 => figures(mux, &values(trace, mux, began(steps.first())), "in this case"),
            _ => figures(mux, &in_step, "in this step"),
        }
    });
    let mut last = BTreeMap::new();
    for (place, seen) in trace.seen.iter().enumerate() {
        if let Some(pdo) = seen.pdo.as_ref().filter(|_| !trace.frames[place].own) {
            last.insert(&pdo.name, place);
        }
    }
    let hidden = last.into_values().filter(|place| !excerpt.shown.contains(place));
    (reads, hidden.take(PDOS).collect())
}

/// The values of an object that were read after an instant, by time.
fn values<'t>(trace: &'t Trace, mux: Mux, after: Instant) -> Vec<&'t Value> {
    let seen = trace.seen.iter().zip(trace.frames);
    let given = seen.filter(|(_, stamped)| stamped.at > after).filter_map(|(seen, _)| {
        let given = seen.given.as_ref().filter(|given| !given.written && given.mux == mux);
        given?.value.as_ref()
    });
    given.collect()
}

/// How often a value was read, with the first, the last, the smallest and the largest; `None` where
/// it was read once.
fn figures(mux: Mux, values: &[&Value], when: &str) -> Option<String> {
    let ([first, .., last], many) = (values, values.len()) else { return None };
    if values.iter().all(|value| value == first) {
        return Some(format!("{mux} read {many} times {when}, each time {first}"));
    }
    let mut text = format!("{mux} read {many} times {when}, first {first}, last {last}");
    let mut sorted: Vec<(f64, &Value)> =
        values.iter().filter_map(|value| Some((value.as_real()?, *value))).collect();
    sorted.sort_by(|one, other| one.0.total_cmp(&other.0));
    if let [(_, least), _, .., (_, most)] = &sorted[..] {
        text.push_str(&format!(", smallest {least}, largest {most}"));
    }
    Some(text)
}

/// How many process data objects are listed.
const PDOS: usize = 4;
