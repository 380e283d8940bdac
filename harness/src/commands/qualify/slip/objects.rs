//! Slips of the SDO server, in what it gives and in what it refuses.

use std::ops::Range;

use canopen::sdo::REQUEST_COB_ID;
use canopen::sdo::block::crc;
use canopen::{Frame, Id};
use runner::suite::constraint::{Allowance, Constraint};
use runner::suite::literal::{Literal, ObjectRef};
use runner::suite::refusal::{Refusal, Refused};
use runner::suite::step::Step;

use super::edits::Edit;
use super::model::{Change, Fate, Slip};
use super::scene::{Heard, Scene};
use crate::source::At;

/// Codes that firmware gives where another one is due.
const CODES: [u32; 9] = [
    0x0800_0000,
    0x0609_0030,
    0x0601_0002,
    0x0604_0041,
    0x0609_0011,
    0x0602_0000,
    0x0607_0010,
    0x0800_0020,
    0x0800_0022,
];

/// The slips that break a part of a step about objects, or use one of its allowances.
pub(super) fn candidates(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    match constraint {
        Constraint::Refused => taken(scene),
        Constraint::AbortCode => other_codes(scene, &CODES),
        Constraint::Length => other_length(scene),
        Constraint::Transfer => other_protocol(scene),
        Constraint::Value | Constraint::Min | Constraint::Max | Constraint::Characters => {
            values(scene, constraint)
        }
        Constraint::Allowance(allowance) => taking(scene, *allowance),
        _ => Vec::new(),
    }
}

/// The refusal that the step requires.
fn refusal(step: &Step) -> Option<&Refusal> {
    match step {
        Step::Read(read) => read.refused.as_deref().map(|refusal| &refusal.value),
        Step::Write(write) => write.refused.as_deref().map(|refusal| &refusal.value),
        Step::Remap(remap) => remap.refused.as_ref().map(|refusal| &refusal.value),
        _ => None,
    }
}

/// The server does what it has to refuse.
fn taken(scene: &Scene) -> Vec<Slip> {
    let Some(aborted) = aborted(scene) else { return Vec::new() };
    let all = scene.answers().next().unwrap_or(aborted);
    let what = "what is to be refused is confirmed";
    vec![
        Slip::new(what).with(Change::during(all, scene.moment.step, Fate::Edited(Edit::Taken))),
        Slip::new(what).with(Change::once(aborted, Fate::Edited(Edit::Taken))),
    ]
}

/// The refusal that the step judges.
fn aborted<'s>(scene: &'s Scene) -> Option<&'s Heard> {
    let is_abort = |heard: &&Heard| heard.frame.data.first() == Some(&0x80);
    match scene.step {
        Step::Undeclared(_) => scene.answers().find(is_abort),
        _ => scene.answers().rev().find(is_abort),
    }
}

fn other_codes(scene: &Scene, codes: &[u32]) -> Vec<Slip> {
    let Some(aborted) = aborted(scene) else { return Vec::new() };
    let accepted = |code: u32| {
        refusal(scene.step).is_some_and(|refusal| {
            refusal.codes.contains(&code) || refusal.lenient.iter().any(|may| may.fits(code))
        })
    };
    let others = codes.iter().filter(|code| !accepted(**code));
    others.take(3).map(|code| with_code(aborted, *code)).collect()
}

fn with_code(aborted: &Heard, code: u32) -> Slip {
    let mut bytes = aborted.frame.data.padded();
    bytes[4..].copy_from_slice(&code.to_le_bytes());
    let frame = Frame { data: bytes.into(), ..aborted.frame };
    let edit = Fate::Edited(Edit::Frame(frame));
    Slip::new(format!("refuses with {code:08X}h")).with(Change::once(aborted, edit))
}

/// The slip that refuses a transfer of a step about objects.
pub(super) fn refusing(scene: &Scene) -> Vec<Slip> {
    let about_objects = matches!(
        scene.step,
        Step::Read(_)
            | Step::Write(_)
            | Step::Remap(_)
            | Step::Defaults(_)
            | Step::Until(_)
            | Step::Undeclared(_)
    );
    let Some(first) = scene.answers().next().filter(|_| about_objects) else { return Vec::new() };
    vec![refused(first, 0x0800_0000)]
}

fn refused(answer: &Heard, code: u32) -> Slip {
    let edit = Fate::Edited(Edit::Refused(code));
    Slip::new(format!("refuses with {code:08X}h")).with(Change::once(answer, edit))
}

/// The answers of an upload that hold its data, and where each byte is.
struct Uploaded<'s> {
    answers: Vec<&'s Heard>,
    data: Vec<u8>,
    /// The answer, and the byte in it.
    places: Vec<(usize, usize)>,
    /// The answer that ends a block upload, when a checksum is in it.
    end: Option<&'s Heard>,
}

impl<'s> Uploaded<'s> {
    /// The last upload while the step ran; the first one of many objects.
    fn of(scene: &'s Scene) -> Option<Self> {
        let begins =
            |heard: &&Heard| scene.begins_upload(heard) && heard.frame.data.first() != Some(&0x80);
        let first = match scene.step {
            Step::Defaults(_) => scene.answers().find(begins)?,
            _ => scene.answers().rev().find(begins)?,
        };
        let command = first.frame.data.first()?;
        let (answers, data, places) = (vec![first], Vec::new(), Vec::new());
        let mut uploaded = Self { answers, data, places, end: None };
        let rest = scene.answers().filter(|heard| heard.at > first.at);
        match command & 0xE2 {
            0x42 => {
                let unused = if command & 1 == 0 { 0 } else { usize::from(command >> 2 & 3) };
                uploaded.take(4..8 - unused);
            }
            0x40 => {
                for segment in rest {
                    let Some(command) = segment.frame.data.first().filter(|first| **first < 0x20)
                    else {
                        break;
                    };
                    uploaded.answers.push(segment);
                    uploaded.take(1..8 - usize::from(command >> 1 & 7));
                }
            }
            _ => uploaded.take_blocks(command & 4 != 0, rest),
        }
        Some(uploaded)
    }

    fn take_blocks(&mut self, has_crc: bool, rest: impl Iterator<Item = &'s Heard>) {
        let mut last = false;
        for answer in rest {
            let first = answer.frame.data.first().copied().unwrap_or(0);
            if last {
                let unused = usize::from(first >> 2 & 7);
                let used = self.places.len().saturating_sub(unused);
                self.places.truncate(used);
                self.data.truncate(used);
                self.end = Some(answer).filter(|_| has_crc);
                return;
            }
            self.answers.push(answer);
            self.take(1..8);
            last = first & 0x80 != 0;
        }
    }

    fn take(&mut self, range: Range<usize>) {
        let answer = self.answers.len() - 1;
        for place in range {
            self.places.push((answer, place));
            self.data.extend(self.answers[answer].frame.data.get(place));
        }
    }

    /// The same answers with other data of this length.
    fn with(&self, scene: &Scene, data: &[u8]) -> Slip {
        let mut frames: Vec<[u8; 8]> =
            self.answers.iter().map(|answer| answer.frame.data.padded()).collect();
        for ((answer, place), byte) in self.places.iter().zip(data) {
            frames[*answer][*place] = *byte;
        }
        let hex: Vec<String> =
            data.iter().rev().take(8).map(|byte| format!("{byte:02X}")).collect();
        let mut slip = Slip::new(format!("the value is {}h", hex.concat()));
        if let (Step::Until(_), [only]) = (scene.step, &self.answers[..]) {
            let edit = Fate::Edited(Edit::Value(data.to_vec()));
            return slip.with(Change::during(only, scene.moment.step, edit));
        }
        let mut all: Vec<(&Heard, [u8; 8])> = self.answers.iter().copied().zip(frames).collect();
        if let Some(end) = self.end {
            let mut bytes = end.frame.data.padded();
            bytes[1..3].copy_from_slice(&crc(data).to_le_bytes());
            all.push((end, bytes));
        }
        for (answer, bytes) in all {
            let frame = Frame { data: bytes.into(), ..answer.frame };
            if frame != answer.frame {
                slip = slip.with(Change::once(answer, Fate::Edited(Edit::Frame(frame))));
            }
        }
        slip
    }

    /// Other data, in this answer and in every later one that would hold the same.
    fn held(&self, data: &[u8]) -> Option<Slip> {
        let [only] = self.answers[..] else { return None };
        let edit = Fate::Edited(Edit::Instead(self.data.clone(), data.to_vec()));
        let change = Change::always(only, edit);
        Some(Slip::new("the device holds another value").with(change))
    }

    /// A number that is larger by so much, in this answer and in every later one.
    fn larger(&self, by: u32) -> Option<Slip> {
        let [only] = self.answers[..] else { return None };
        let mux = *only.frame.data.get(1..)?.first_chunk::<3>()?;
        let edit = Fate::Edited(Edit::Larger(mux, by));
        let change = Change::always(only, edit);
        Some(Slip::new(format!("the value is larger by {:08X}h from now on", by)).with(change))
    }
}

impl Scene<'_> {
    /// Whether the request before this answer begins an upload.
    fn begins_upload(&self, answer: &Heard) -> bool {
        let id = Id::standard(REQUEST_COB_ID + u16::from(self.node));
        let requests = self.all.iter().take_while(|heard| heard.at < answer.at);
        let last = requests.filter(|heard| heard.own && heard.frame.id == id).last();
        let first = last.and_then(|request| request.frame.data.first().copied());
        first.is_some_and(|first| first >> 5 == 2 || first & 0xE3 == 0xA0)
    }
}

/// Another value of the same length. The likeliest to break a bound come first: values nearby lie
/// within most bounds.
fn values(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    let Some(uploaded) = Uploaded::of(scene) else { return Vec::new() };
    let data = &uploaded.data;
    let Some(top) = data.len().checked_sub(1) else { return Vec::new() };
    let mut others: Vec<Vec<u8>> = Vec::new();
    let mut add = |other: Vec<u8>| {
        if other != *data && !others.contains(&other) {
            others.push(other);
        }
    };
    let carried = |up: bool| {
        let mut bytes = data.clone();
        for byte in &mut bytes {
            let (sum, carry) = if up { byte.overflowing_add(1) } else { byte.overflowing_sub(1) };
            *byte = sum;
            if !carry {
                break;
            }
        }
        bytes
    };
    let limits = |low: u8, high: u8| {
        let mut bytes = vec![low; data.len()];
        bytes[top] = high;
        bytes
    };
    let bounds = [limits(0x00, 0x00), limits(0xFF, 0x7F), limits(0x00, 0x80), limits(0xFF, 0xFF)];
    match constraint {
        Constraint::Min => [0, 2].map(|place| add(bounds[place].clone())),
        Constraint::Max => [1, 3].map(|place| add(bounds[place].clone())),
        _ => [true, false].map(|up| add(carried(up))),
    };
    bounds.into_iter().for_each(&mut add);
    add(carried(true));
    add(carried(false));
    add(data.iter().map(|byte| !byte).collect());
    add(data.iter().rev().copied().collect());
    if data.len() == 4 {
        add(vec![0xFF, 0xFF, 0x7F, 0xFF]);
        add(vec![0xFF, 0xFF, 0x7F, 0x7F]);
    }
    let mut bell = data.clone();
    bell[0] = 0x07;
    add(bell);
    let number = data.first_chunk::<4>().map_or_else(
        || data.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)),
        |bytes| u32::from_le_bytes(*bytes),
    );
    let steps = [1, u32::MAX, number.wrapping_neg(), 0x400, 0x400_u32.wrapping_neg(), 0x40, 0x8000];
    let larger = steps.into_iter().filter_map(|by| uploaded.larger(by));
    let held = others.iter().take(3).filter_map(|other| uploaded.held(other));
    let others = others.iter().map(|other| uploaded.with(scene, other));
    others.chain(larger).chain(held).collect()
}

/// The value is a byte shorter, or longer.
fn other_length(scene: &Scene) -> Vec<Slip> {
    let Some(uploaded) = Uploaded::of(scene) else { return Vec::new() };
    let frames: Vec<[u8; 8]> =
        uploaded.answers.iter().map(|answer| answer.frame.data.padded()).collect();
    let last = frames.len() - 1;
    let mut slips = Vec::new();
    for (longer, what) in [(false, "shorter"), (true, "longer")] {
        let mut frames = frames.clone();
        let (shift, end) = if last == 0 { (2, 0) } else { (1, last) };
        let unused = frames[end][0] >> shift & if last == 0 { 3 } else { 7 };
        let other = if longer { unused.checked_sub(1) } else { Some(unused + 1) };
        let Some(other) = other.filter(|other| *other < if last == 0 { 4 } else { 8 }) else {
            continue;
        };
        frames[end][0] = frames[end][0] & !(7 << shift) | other << shift;
        match (last, longer) {
            (0, _) => frames[0][0] = 0x43 | other << 2,
            (_, true) => frames[0][4] = frames[0][4].wrapping_add(1),
            (_, false) => frames[0][4] = frames[0][4].wrapping_sub(1),
        }
        let mut slip = Slip::new(format!("the value is a byte {what}"));
        for (answer, bytes) in uploaded.answers.iter().zip(frames) {
            let frame = Frame { data: bytes.into(), ..answer.frame };
            slip = slip.with(Change::once(answer, Fate::Edited(Edit::Frame(frame))));
        }
        slips.push(slip);
    }
    slips
}

/// The value comes in one frame, or in segments though it would fit.
fn other_protocol(scene: &Scene) -> Vec<Slip> {
    let Some(uploaded) = Uploaded::of(scene) else { return Vec::new() };
    let first = uploaded.answers[0];
    let mut bytes = first.frame.data.padded();
    let begin: Vec<u8> = uploaded.data.iter().copied().chain([0; 4]).take(4).collect();
    if bytes[0] & 0xE2 == 0x42 {
        return vec![in_segments(first, &uploaded.data)];
    }
    bytes[4..].copy_from_slice(&begin);
    let commands = [0x43, 0x47, 0x4B, 0x4F].map(|command| {
        bytes[0] = command;
        let frame = Frame { data: bytes.into(), ..first.frame };
        Fate::Edited(Edit::Frame(frame))
    });
    let what = "the value comes in one frame";
    let once = commands.iter().map(|edit| Slip::new(what).with(Change::once(first, edit.clone())));
    // In this step and in every later one that asks for the same.
    let always = commands.iter().filter_map(|edit| {
        let Fate::Edited(Edit::Frame(frame)) = edit else { return None };
        let swapped = Fate::Edited(Edit::Swapped(first.frame, *frame));
        let change = Change::always(first, swapped);
        Some(Slip::new(what).with(change))
    });
    once.chain(always).collect()
}

/// The value of at most four bytes in a segment, which the device refuses to send.
fn in_segments(first: &Heard, data: &[u8]) -> Slip {
    let mut initiate = first.frame.data.padded();
    (initiate[0], initiate[4]) = (0x41, data.len() as u8);
    initiate[5..].fill(0);
    let mut segment = [0; 8];
    segment[0] = ((7 - data.len() as u8) << 1) | 1;
    segment[1..=data.len()].copy_from_slice(data);
    let with =
        |bytes: [u8; 8]| Fate::Edited(Edit::Frame(Frame { data: bytes.into(), ..first.frame }));
    let mut next = Change::once(first, with(segment));
    (next.from.1, next.to.1) = (next.from.1 + 1, next.to.1 + 1);
    Slip::new("the value comes in segments").with(Change::once(first, with(initiate))).with(next)
}

/// The slips that use an allowance of the step.
fn taking(scene: &Scene, allowance: Allowance) -> Vec<Slip> {
    match (scene.step, allowance) {
        (Step::Read(read), Allowance::Tolerated(place)) => {
            tolerated(scene, &read.object, &read.tolerated[place - 1])
        }
        (Step::Until(until), Allowance::Tolerated(place)) => {
            tolerated(scene, &until.object, &until.tolerated[place - 1])
        }
        (Step::Read(read), Allowance::Lenient(place)) if read.refused.is_none() => {
            let first = scene.answers().next();
            let codes = codes_of(read.lenient[place - 1], &read.lenient[..place - 1], &[]);
            let slips = first.into_iter().flat_map(|first| {
                codes.iter().map(|code| refused(first, *code)).collect::<Vec<_>>()
            });
            slips.collect()
        }
        (Step::Write(write), Allowance::OrRefused(place)) => {
            let all: Vec<Refused> = write.or_refused.iter().map(|may| may.value).collect();
            let codes = codes_of(all[place - 1], &all[..place - 1], &[]);
            let last = scene.answers().next_back();
            let slips = last
                .into_iter()
                .flat_map(|last| codes.iter().map(|code| refused(last, *code)).collect::<Vec<_>>());
            slips.collect()
        }
        (_, Allowance::Lenient(place)) => {
            let (Some(refusal), Some(aborted)) = (refusal(scene.step), aborted(scene)) else {
                return Vec::new();
            };
            let before = &refusal.lenient[..place - 1];
            let codes = codes_of(refusal.lenient[place - 1], before, &refusal.codes);
            codes.iter().map(|code| with_code(aborted, *code)).collect()
        }
        (_, Allowance::Taken) => taken(scene),
        _ => Vec::new(),
    }
}

/// The codes that this refusal alone means.
fn codes_of(meant: Refused, before: &[Refused], strict: &[u32]) -> Vec<u32> {
    let all = meant.code().map_or_else(|| CODES.to_vec(), |code| vec![code]);
    let own = |code: &u32| {
        meant.fits(*code) && !strict.contains(code) && !before.iter().any(|other| other.fits(*code))
    };
    all.into_iter().filter(own).take(2).collect()
}

fn tolerated(scene: &Scene, object: &At<ObjectRef>, value: &At<Literal>) -> Vec<Slip> {
    let scope = &scene.moment.scope;
    let Some(mux) = scope.mux(&object.value).ok() else { return Vec::new() };
    let bytes = scene.eds.entry(mux).and_then(|entry| scope.bytes(&value.value, entry).ok());
    let (Some(bytes), Some(uploaded)) = (bytes, Uploaded::of(scene)) else { return Vec::new() };
    vec![uploaded.with(scene, &bytes)]
}

/// The device takes what it may refuse in this step: the confirmation of the write, or the answer
/// that does not end the steps.
pub(super) fn not_declining(scene: &Scene) -> Option<Slip> {
    let Step::Write(_) = scene.step else { return None };
    let aborted = aborted(scene)?;
    let edit = Fate::Edited(Edit::Taken);
    Some(Slip::new("what may be refused is confirmed").with(Change::once(aborted, edit)))
}
