//! Slips in time: frames that come too early or too late.

use std::time::Duration;

use canopen::Instant;
use runner::suite::constraint::{Constraint, Time};
use runner::suite::step::Step;

use super::frames::taken;
use super::model::{Change, Fate, Slip};
use super::scene::{Heard, Scene};

/// Parts of a time by which a frame comes at another one.
const PARTS: [f64; 12] = [1.0, 0.5, 0.3, 0.2, 0.15, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 2.0];

/// How much later an answer comes, in milliseconds.
const LATER_MS: [f64; 14] =
    [600.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 1500.0, 6000.0, 15_000.0, 300.0];

/// The slips that break a bound of a time.
pub(super) fn candidates(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    match constraint {
        Constraint::After => early(scene),
        Constraint::Low(Time::Latency) => early(scene),
        Constraint::High(Time::Latency) => late(scene),
        Constraint::Low(time) => [one_early(scene, *time), fast(scene)].concat(),
        Constraint::High(time) => [one_late(scene, *time), slow(scene)].concat(),
        _ => Vec::new(),
    }
}

/// The slips that use accepted bounds.
pub(super) fn accepted(scene: &Scene, time: Time) -> Vec<Slip> {
    match time {
        Time::Latency => [late(scene), early(scene)].concat(),
        _ => [slow(scene), fast(scene)].concat(),
    }
}

/// The frame comes sooner after what it answers, or after the begin of the step.
fn early(scene: &Scene) -> Vec<Slip> {
    let Some(&heard) = taken(scene).first() else { return Vec::new() };
    let asked = scene.heard().take_while(|other| other.at < heard.at).filter(|other| other.own);
    let since = match scene.step {
        Step::Expect(_) => scene.moment.from,
        _ => asked.last().map_or(scene.moment.from, |asked| asked.at),
    };
    let span = heard.at.since(since);
    let parts = [0.01, 0.25, 0.5, 0.75, 0.9, 0.95];
    let same = |other: &&Heard| !other.own && other.frame.id == heard.frame.id;
    let later: Vec<&Heard> =
        scene.all.iter().filter(same).filter(|other| other.at >= heard.at).collect();
    let mut slips = Vec::new();
    for part in parts {
        let sooner = span.mul_f64(1.0 - part).saturating_sub(Duration::from_micros(1));
        // Alone, and with all that follow.
        for count in [1, later.len()].into_iter().take(later.len().min(2)) {
            let mut slip = Slip::new(format!("{} comes too early", heard.frame.id));
            for other in &later[..count] {
                slip = slip
                    .with(Change::once(other, Fate::Lost))
                    .and_unasked(scene.after(other.at - sooner), other.frame);
            }
            slips.push(slip);
        }
    }
    slips
}

/// The answer comes later.
fn late(scene: &Scene) -> Vec<Slip> {
    let Some(&heard) = taken(scene).first() else { return Vec::new() };
    let slips = LATER_MS.map(|ms: f64| {
        let late = Duration::from_secs_f64(ms / 1e3);
        Slip::new(format!("{} comes {ms} ms later", heard.frame.id))
            .with(Change::once(heard, Fate::Late(late)))
    });
    slips.into()
}

/// The mean of the intervals.
fn period(taken: &[&Heard]) -> Option<Duration> {
    let (first, last) = (taken.first()?, taken.last()?);
    let count = u32::try_from(taken.len()).ok()?.checked_sub(1).filter(|count| *count > 0)?;
    Some(last.at.since(first.at) / count)
}

/// The frames of a clock that runs slow.
fn slow(scene: &Scene) -> Vec<Slip> {
    let taken = taken(scene);
    let Some(&first) = taken.first() else { return Vec::new() };
    let since = scene.after(first.at);
    let slips = PARTS.map(|part| {
        Slip::new(format!("{} comes slower by {} %", first.frame.id, part * 100.0))
            .with(Change::during(first, scene.moment.step, Fate::Slow(since, part)))
    });
    slips.into()
}

/// The frames of a clock that runs fast.
fn fast(scene: &Scene) -> Vec<Slip> {
    let taken = taken(scene);
    let (Some(&first), Some(_)) = (taken.first(), period(&taken)) else { return Vec::new() };
    let parts = PARTS.iter().filter(|part| **part < 1.0);
    let slips = parts.map(|part| {
        let mut slip = Slip::new(format!("{} comes faster by {} %", first.frame.id, part * 100.0));
        for heard in &taken {
            let after = heard.at.since(first.at).mul_f64(1.0 - part);
            let lost = Change::once(heard, Fate::Lost);
            slip = slip.with(lost).and_unasked(scene.after(first.at) + after, heard.frame);
        }
        slip
    });
    slips.collect()
}

/// One interval is too long, and what follows is later.
fn one_late(scene: &Scene, time: Time) -> Vec<Slip> {
    let taken = taken(scene);
    let (Some(period), Time::Interval) = (period(&taken), time) else { return Vec::new() };
    let place = taken[taken.len() / 2];
    let slips = PARTS.map(|part| {
        let late = Fate::Late(period.mul_f64(part));
        Slip::new(format!("{} comes late once", place.frame.id)).with(Change::rest(place, late))
    });
    slips.into()
}

/// One interval is too short, and what follows is sooner.
fn one_early(scene: &Scene, time: Time) -> Vec<Slip> {
    let taken = taken(scene);
    let (Some(period), Time::Interval) = (period(&taken), time) else { return Vec::new() };
    let place = taken.len() / 2;
    let parts = PARTS.iter().filter(|part| **part < 1.0);
    let slips = parts.map(|part| {
        let sooner = period.mul_f64(*part);
        let mut slip = Slip::new(format!("{} comes early once", taken[place].frame.id));
        for heard in &taken[place..] {
            let at: Instant = heard.at - sooner;
            slip = slip
                .with(Change::once(heard, Fate::Lost))
                .and_unasked(scene.after(at), heard.frame);
        }
        slip
    });
    slips.collect()
}
