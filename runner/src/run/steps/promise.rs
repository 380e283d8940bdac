//! The data sheet in a finding: the line with the promise that the device does not keep, and the
//! steps that are about the data sheet alone.

use canopen::eds::{CODES, Diagnostic, Object};
use canopen::sdo::{Failure, Initiate, RESPONSE_COB_ID, Response};
use canopen::{Abort, Frame, Mux};
use reports::Excerpt;

use super::judge::{Difference, Judgement, Trouble, excerpt};
use super::run::Steps;
use crate::dut::Dut;
use crate::plan::{Binding, Instance, Scope, index_range};
use crate::run::link::sdo;
use crate::source::{At, Complaint, Place};
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::literal::{Literal, Name};
use crate::suite::step::{EdsStep, Step, Undeclared};

/// The line of the data sheet that a step found broken; `None` when it was not about the sheet.
pub(in crate::run) fn promised(
    step: &Step,
    difference: &Difference,
    scope: &Scope,
    dut: &Dut,
) -> Option<Excerpt> {
    let (mux, key) = claim(step, difference, scope, dut)?;
    dut.eds.entry(mux)?;
    Some(excerpt(&dut.sheet.source, dut.sheet.place_of(mux, key)?))
}

/// A step that cannot be carried out because the data sheet says something else than it needs.
pub(in crate::run) fn unfit(complaint: &Complaint, instance: &Instance, dut: &Dut) -> Difference {
    let about = instance.case();
    let place = complaint.place.unwrap_or(about.id.place);
    let before = about.all_steps().filter(|step| step.place <= place);
    let step = before.max_by_key(|step| step.place);
    let object = step.and_then(|step| Some(step.value.effect().access?.object));
    let mux = object.and_then(|object| instance.scope.mux(&object.value).ok());
    let place = mux.and_then(|mux| dut.sheet.place_of(mux, Some("DataType")));
    let sheet = place.map(|place| Box::new(excerpt(&dut.sheet.source, place)));
    let expected = "a data sheet by which the step can be carried out";
    Difference { sheet, ..Difference::new(expected, complaint.message.clone()) }
}

/// The entry and the key of its section.
fn claim(
    step: &Step,
    difference: &Difference,
    scope: &Scope,
    dut: &Dut,
) -> Option<(Mux, Option<&'static str>)> {
    // Of this entry the case says what the data sheet says.
    let of_sheet = match scope.get(&Name("mux".into())) {
        Ok(Binding::Mux(mux)) => Some(*mux),
        _ => None,
    };
    let access = step.effect().access;
    let mux = match &access {
        Some(access) => scope.mux(&access.object.value).ok()?,
        // Without an access, what failed is about the object only where an SDO answer was judged.
        None => of_sheet.filter(|_| judges_answer(step))?,
    };
    let (literals, refused) =
        access.map_or_else(Default::default, |access| (access.literals, access.refused));
    let answered = answered(difference.raw, mux, dut);
    if refused.is_some() && matches!(answered, Some(Some(_))) {
        // It refuses with another code, which no data sheet states.
        return None;
    }
    let wanted = refused.and_then(|refused| key_of(Abort(*refused.value.codes.first()?)));
    let named = literals.into_iter().find_map(|literal| key_of_name(&literal.value));
    match answered.or_else(|| wanted.map(Some)) {
        Some(key) => Some((mux, key)),
        // A value that the case itself states is not a promise of the sheet.
        None => (of_sheet == Some(mux)).then_some((mux, named)),
    }
}

/// Whether the step judges frames of the SDO server.
fn judges_answer(step: &Step) -> bool {
    let frame = match step {
        Step::Reply(reply) => &reply.frame,
        Step::Ask(ask) => &ask.reply,
        Step::Expect(expect) => &expect.frame,
        Step::Never(never) => &never.frame,
        Step::Collect(collect) => &collect.frame,
        _ => return false,
    };
    frame.value.pattern.function() == Some(RESPONSE_COB_ID.into())
}

/// The answer's statement about the entry: that it does not exist, or which key it contradicts.
fn answered(raw: Option<Frame>, mux: Mux, dut: &Dut) -> Option<Option<&'static str>> {
    match Response::decode(&raw?.data).ok()? {
        Response::Abort(of, Abort::NO_OBJECT | Abort::NO_SUB_INDEX) if of == mux => Some(None),
        Response::Abort(of, abort) if of == mux => key_of(abort).map(Some),
        Response::Upload(of, initiate) if of == mux => {
            let size = dut.eds.entry(mux)?.data_type.size()?;
            let length = match initiate {
                Initiate::Expedited(data) => data.len(),
                Initiate::Unsized(_) => return None,
                Initiate::Segmented(length) => length? as usize,
            };
            (size != length).then_some(Some("DataType"))
        }
        _ => None,
    }
}

/// The key that a refusal is about.
fn key_of(abort: Abort) -> Option<&'static str> {
    Some(match abort.0 {
        0x0601_0000..=0x0601_0002 => "AccessType",
        0x0604_0041 => "PDOMapping",
        0x0607_0010..=0x0607_0013 => "DataType",
        0x0609_0031 => "HighLimit",
        0x0609_0032 => "LowLimit",
        _ => return None,
    })
}

/// The key that a name of `each: objects` stands for.
fn key_of_name(literal: &Literal) -> Option<&'static str> {
    let Literal::Named(name, _) = literal else { return None };
    Some(match &*name.0 {
        "value" => "DefaultValue",
        "low" | "below" => "LowLimit",
        "high" | "above" => "HighLimit",
        "size" | "longer" | "shorter" => "DataType",
        _ => return None,
    })
}

impl Steps<'_, '_> {
    /// The line of the data sheet with that key of an entry.
    pub(super) fn line_of(&self, mux: Mux, key: &'static str) -> Option<Box<Excerpt>> {
        let place = self.dut.sheet.place_of(mux, Some(key))?;
        Some(Box::new(excerpt(&self.dut.sheet.source, place)))
    }

    /// Judges what was found while the data sheet was read.
    pub(super) fn eds(&mut self, step: &EdsStep) -> Judgement {
        if let Some(wrong) = self.found(&step.without) {
            let codes = step.without.iter().filter(|code| self.finds(&code.value));
            let codes: Vec<Constraint> =
                codes.map(|code| Constraint::Finding(code.value.clone())).collect();
            self.broken(&codes, wrong)?;
        }
        for (code, place) in step.lenient.iter().zip(1..) {
            if self.finds(&code.value) {
                self.allows(Allowance::Lenient(place));
            }
        }
        Ok(self.found(&step.lenient))
    }

    /// Whether the data sheet has a finding of that kind.
    fn finds(&self, code: &str) -> bool {
        self.dut.sheet.diagnostics.iter().any(|found| found.code == code)
    }

    /// The first finding of that kind, the others below it.
    fn found(&self, codes: &[At<String>]) -> Option<Difference> {
        let sheet = &self.dut.sheet;
        let meant = |found: &&Diagnostic| codes.iter().any(|code| code.value == found.code);
        let mut found = sheet.diagnostics.iter().filter(meant);
        let first = found.next()?;
        let rule = CODES.iter().find(|code| code.name == first.code);
        let expected = rule.map_or_else(String::new, |code| code.meaning.to_owned());
        let mut actual = format!("{} [{}]", first.message, first.code);
        let name = &sheet.source.name;
        for other in found.clone().take(MORE) {
            let (line, column) = (other.line, other.column);
            actual.push_str(&format!("\nalso at {name}:{line}:{column}: {}", other.message));
        }
        if let more @ 1.. = found.count().saturating_sub(MORE) {
            actual.push_str(&format!("\nand {more} more"));
        }
        let place = Place { line: first.line, column: first.column };
        let sheet = Some(Box::new(excerpt(&sheet.source, place)));
        Some(Difference { sheet, ..Difference::new(expected, actual) })
    }

    /// Asks for objects, or sub-indices of objects, that the data sheet or the profile does not
    /// have.
    pub(super) fn undeclared(&mut self, step: &Undeclared) -> Judgement {
        let range = index_range(&step.range.value).map_err(Trouble::Impossible)?;
        let eds = &self.dut.eds;
        let profile = step.profile.as_ref();
        let profile = profile.and_then(|about| about.value.named(self.catalogue).ok()?);
        let whose = profile.map_or("the data sheet", |_| "the profile");
        let (first, absent, code): (Vec<Mux>, Vec<Mux>, _) = match (profile, step.subs) {
            (_, true) => {
                let objects = range.filter_map(|index| eds.object(index));
                (Vec::new(), objects.flat_map(absent_subs).collect(), Abort::NO_SUB_INDEX)
            }
            (profile, false) => {
                let known = |index: u16| match profile {
                    Some(profile) => profile
                        .chain()
                        .any(|each| each.lookup(index).is_some_and(|known| known.is_described())),
                    None => eds.object(index).is_some(),
                };
                let absent = range.filter(|index| !known(*index)).map(|index| Mux::new(index, 0));
                let (first, rest) = absent.partition(|mux| eds.object(mux.index).is_some());
                (first, rest, Abort::NO_OBJECT)
            }
        };
        let most = if self.policy.every_index { usize::MAX } else { step.most };
        let mut lenient = None;
        for mux in first.iter().copied().chain(spread(&absent, most, self.policy.seed)) {
            let ended = sdo::upload(self.link, self.policy, self.dut.node, mux)?;
            let expected = format!("{mux}, which {whose} does not have, refused with {code}");
            let (actual, broken) = match ended.result {
                Err(Failure::Aborted(abort)) if abort == code => continue,
                Err(failure @ Failure::Aborted(_)) => {
                    (failure.to_string(), vec![Constraint::AbortCode])
                }
                Err(failure) => (failure.to_string(), Vec::new()),
                Ok(data) => {
                    let answered = format!("answered {}", crate::plan::show_bytes(&data));
                    (answered, vec![Constraint::Refused])
                }
            };
            let tolerated = actual == Failure::Aborted(Abort::GENERAL).to_string();
            let difference = Difference { raw: ended.raw, ..Difference::new(expected, actual) };
            match tolerated {
                true => lenient = lenient.or(Some(difference)),
                false => _ = self.broken(&broken, difference)?,
            }
        }
        Ok(lenient)
    }
}

/// How many findings of the same kind are listed one by one.
const MORE: usize = 5;

/// The sub-indices up to the one after the last, and FFh, that the object does not have.
fn absent_subs(object: &Object) -> impl Iterator<Item = Mux> {
    let subs = object.entries.iter().map(|entry| entry.mux.sub).filter(|sub| *sub != 0xFF);
    let last = subs.max().unwrap_or(0).saturating_add(1);
    let all = (0..=last).chain((last < 0xFF).then_some(0xFF));
    all.filter(|sub| object.entry(*sub).is_none()).map(|sub| Mux::new(object.index, sub))
}

/// At most `most` of them, evenly spread; which ones is a matter of the seed.
fn spread(all: &[Mux], most: usize, seed: u64) -> impl Iterator<Item = Mux> {
    let step = all.len().div_ceil(most.max(1)).max(1);
    let first = fastrand::Rng::with_seed(seed).usize(..step);
    all.iter().skip(first).step_by(step).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_spread_and_never_too_large() {
        let all: Vec<Mux> = (0x1000..0x2000).map(|index| Mux::new(index, 0)).collect();
        for seed in 0..20 {
            let some: Vec<Mux> = spread(&all, 64, seed).collect();
            assert_eq!(some.len(), 64);
            assert!(some.windows(2).all(|pair| pair[1].index - pair[0].index == 64));
        }
        assert_eq!(spread(&all, usize::MAX, 1).count(), all.len());
        assert_eq!(spread(&[], 64, 1).count(), 0);
    }
}
