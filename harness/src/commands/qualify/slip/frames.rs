//! Slips in frames that a step takes as they are.

use std::time::Duration;

use canopen::{Frame, Pattern};
use runner::suite::constraint::{Allowance, Constraint};
use runner::suite::literal::FrameText;
use runner::suite::step::Step;

use super::edits::{Edit, Odd};
use super::model::{Change, Fate, Slip};
use super::scene::{Heard, Scene};
use super::times;
use crate::source::At;

/// How many ways to get a byte wrong are tried for one part of a frame.
const WAYS: usize = 4;

/// The frame that a step is about, and what it accepts as well.
struct Texts<'s> {
    strict: &'s At<FrameText>,
    lenient: &'s [At<FrameText>],
    or_else: &'s [At<FrameText>],
}

impl<'s> Texts<'s> {
    fn of(step: &'s Step) -> Option<Self> {
        let (strict, lenient, or_else) = match step {
            Step::Reply(reply) => (&reply.frame, &reply.lenient[..], &reply.or_else[..]),
            Step::Ask(ask) => (&ask.reply, &ask.lenient[..], &ask.or_else[..]),
            Step::Expect(expect) => (&expect.frame, &expect.lenient[..], &[][..]),
            Step::Never(never) => (&never.frame, &never.lenient[..], &never.or_else[..]),
            Step::Collect(collect) => (&collect.frame, &[][..], &[][..]),
            Step::Measure(measure) => (&measure.frame, &[][..], &[][..]),
            _ => return None,
        };
        Some(Self { strict, lenient, or_else })
    }
}

/// The frames that the step took: those of its identifier, or that fit it, as the step does.
pub(super) fn taken<'s>(scene: &'s Scene) -> Vec<&'s Heard> {
    let strict = Texts::of(scene.step).and_then(|texts| scene.pattern(texts.strict));
    let Some(strict) = strict else { return Vec::new() };
    let id = strict.id();
    match scene.step {
        Step::Reply(_) | Step::Ask(_) => {
            scene.sent().filter(|heard| heard.frame.id == id).collect()
        }
        Step::Expect(_) => {
            scene.sent().rev().find(|heard| strict.matches(&heard.frame)).into_iter().collect()
        }
        _ => scene.sent().filter(|heard| strict.matches(&heard.frame)).collect(),
    }
}

/// The slips that break a part of the frame, its length, or the number of frames.
pub(super) fn breaking(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    let taken = taken(scene);
    let Some(&first) = taken.first() else { return coming_instead(scene, constraint) };
    let id = first.frame.id;
    match constraint {
        Constraint::Few => {
            let lost = Slip::new(format!("a frame {id} is not sent"));
            vec![lost.with(Change::once(first, Fate::Lost))]
        }
        Constraint::Many => {
            let last = taken.last().copied().unwrap_or(first);
            let twice = |heard: &Heard| {
                let after = scene.after(heard.at) + Duration::from_micros(200);
                Slip::new(format!("a frame {id} is sent twice")).and_unasked(after, heard.frame)
            };
            vec![twice(first), twice(last)]
        }
        Constraint::Length => {
            let edit = Fate::Edited(Edit::Length);
            let slip = Slip::new(format!("{id} has another length"));
            let always = Change::during(first, scene.moment.step, edit.clone());
            vec![slip.clone().with(Change::once(first, edit)), slip.with(always)]
        }
        _ => words(scene, first, constraint),
    }
}

fn coming_instead(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    match (scene.step, constraint) {
        (Step::Collect(collect), Constraint::Many) => coming(scene, &collect.frame),
        _ => Vec::new(),
    }
}

/// Another byte, where this part of the frame notices it.
fn words(scene: &Scene, heard: &Heard, constraint: &Constraint) -> Vec<Slip> {
    let Some(texts) = Texts::of(scene.step) else { return Vec::new() };
    let (Some(strict), Some(open)) =
        (scene.pattern(texts.strict), scene.open(texts.strict, constraint))
    else {
        return Vec::new();
    };
    let patterns = |texts: &[At<FrameText>]| -> Vec<Pattern> {
        texts.iter().filter_map(|text| scene.pattern(text)).collect()
    };
    let (lenient, or_else) = (patterns(texts.lenient), patterns(texts.or_else));
    let fits =
        |patterns: &[Pattern], frame: &Frame| patterns.iter().any(|pattern| pattern.matches(frame));
    let differs =
        |frame: &Frame| open.matches(frame) && !strict.matches(frame) && !fits(&or_else, frame);
    // Where each other byte is accepted, too, the verdict is LENIENT.
    let all = bytes(scene, heard).filter(|(.., frame)| differs(frame));
    let (lenient, breaking): (Vec<_>, Vec<_>) = all.partition(|(.., frame)| fits(&lenient, frame));
    let ways = if breaking.is_empty() { lenient } else { breaking };
    let mut slips = Vec::new();
    let lasts = !matches!(scene.step, Step::Reply(_) | Step::Ask(_));
    for (place, odd, frame) in ways.into_iter().take(WAYS) {
        let what = format!("byte {place} of {} {}", frame.id, odd.says());
        let edit = Fate::Edited(Edit::Byte(place, odd));
        slips.push(Slip::new(what.clone()).with(Change::once(heard, edit.clone())));
        if lasts {
            slips.push(Slip::new(what).with(Change::during(heard, scene.moment.step, edit)));
        }
    }
    slips
}

/// Each byte of the frame, in each way that changes it.
fn bytes<'s>(
    scene: &'s Scene,
    heard: &'s Heard,
) -> impl Iterator<Item = (usize, Odd, Frame)> + use<'s> {
    let before = scene.before(heard).map(|before| before.frame);
    let frame = heard.frame;
    (0..frame.data.len()).flat_map(move |place| {
        let stale = before.and_then(|before| before.data.get(place).copied());
        Odd::all(stale).filter_map(move |odd| {
            let edited = Edit::Byte(place, odd).apply(&frame, None);
            (edited != frame).then_some((place, odd, edited))
        })
    })
}

/// An unrequested frame while the step runs.
pub(super) fn coming(scene: &Scene, text: &At<FrameText>) -> Vec<Slip> {
    let Some(pattern) = scene.pattern(text) else { return Vec::new() };
    let moment = scene.moment;
    let last = scene.all.iter().rev().find(|heard| !heard.own && heard.frame.id == pattern.id());
    let frames = last.map(|last| last.frame).into_iter().chain(blanks());
    let mut frames: Vec<Frame> =
        frames.map(|frame| pattern.edit(&frame)).filter(|frame| pattern.matches(frame)).collect();
    frames.dedup();
    let span = moment.to.since(moment.from);
    let moments = [span / 2, span / 50, span - span / 50];
    let mut slips = Vec::new();
    for frame in frames.into_iter().take(3) {
        for after in moments {
            let slip = Slip::new(format!("{} comes of its own accord", frame.id));
            slips.push(slip.and_unasked(scene.after(moment.from) + after, frame));
        }
    }
    slips
}

/// Frames of every length with nothing in them.
fn blanks() -> impl Iterator<Item = Frame> {
    (0..=8).rev().map(|length| Frame::new(0, canopen::Data::new(&[0; 8][..length])))
}

/// The slips that use an allowance of the step.
pub(super) fn taking(scene: &Scene, allowance: Allowance) -> Vec<Slip> {
    let Some(texts) = Texts::of(scene.step) else { return Vec::new() };
    match allowance {
        Allowance::Lenient(place) => {
            let before = texts.lenient[..place - 1].iter().chain(texts.or_else);
            let before = [texts.strict].into_iter().chain(before).collect();
            instead(scene, &texts, &texts.lenient[place - 1], before)
        }
        Allowance::OrElse(place) => {
            let before = texts.or_else[..place - 1].iter().collect();
            instead(scene, &texts, &texts.or_else[place - 1], before)
        }
        Allowance::OrSilence | Allowance::AcceptSilence | Allowance::Optional => {
            let lost = |heard: &Heard| {
                let lost = Change::during(heard, scene.moment.step, Fate::Lost);
                let once = Change::once(heard, Fate::Lost);
                let what = format!("{} is not sent", heard.frame.id);
                [Slip::new(what.clone()).with(lost), Slip::new(what).with(once)]
            };
            taken(scene).first().into_iter().flat_map(|heard| lost(heard)).collect()
        }
        Allowance::Bounds(time) => times::accepted(scene, time),
        Allowance::Tolerated(_)
        | Allowance::Taken
        | Allowance::OrAnother
        | Allowance::OrRefused(_) => Vec::new(),
    }
}

/// The frame that is accepted instead of the one that is expected, and by none of those `before`.
fn instead(
    scene: &Scene,
    texts: &Texts,
    text: &At<FrameText>,
    before: Vec<&At<FrameText>>,
) -> Vec<Slip> {
    if matches!(scene.step, Step::Never(_)) {
        return unasked(scene, texts, text);
    }
    let Some(meant) = scene.pattern(text) else { return Vec::new() };
    let before: Vec<Pattern> = before.into_iter().filter_map(|text| scene.pattern(text)).collect();
    let Some(&heard) = taken(scene).first() else { return Vec::new() };
    let edited = meant.edit(&heard.frame);
    let other = Heard { frame: edited, ..*heard };
    let ways = bytes(scene, &other).map(|(.., frame)| frame);
    let all = [edited].into_iter().chain(blanks().map(|blank| meant.edit(&blank))).chain(ways);
    let fits = |frame: &Frame| {
        meant.matches(frame) && !before.iter().any(|pattern| pattern.matches(frame))
    };
    let mut slips = Vec::new();
    for frame in all.filter(fits).take(WAYS) {
        let edit = Fate::Edited(Edit::Frame(frame));
        let slip = Slip::new(format!("answers {frame}"));
        slips.push(slip.clone().with(Change::once(heard, edit.clone())));
        if matches!(scene.step, Step::Expect(_)) {
            slips.push(slip.with(Change::during(heard, scene.moment.step, edit)));
        }
    }
    slips
}

/// A frame that may come although others must not.
fn unasked(scene: &Scene, texts: &Texts, text: &At<FrameText>) -> Vec<Slip> {
    let (Some(strict), Some(meant)) = (scene.pattern(texts.strict), scene.pattern(text)) else {
        return Vec::new();
    };
    let moment = scene.moment;
    let after = scene.after(moment.from) + moment.to.since(moment.from) / 2;
    let last = scene.all.iter().rev().find(|heard| !heard.own && heard.frame.id == meant.id());
    let frames = last.map(|last| last.frame).into_iter().chain(blanks());
    let both = frames.flat_map(|frame| {
        let first = meant.edit(&strict.edit(&frame));
        [first, strict.edit(&meant.edit(&frame))]
    });
    let fits = both.filter(|frame| strict.matches(frame) && meant.matches(frame));
    let slip = |frame: Frame| Slip::new(format!("sends {frame}")).and_unasked(after, frame);
    fits.take(WAYS).map(slip).collect()
}
