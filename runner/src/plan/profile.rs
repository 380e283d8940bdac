//! The parts of a profile that suites use: whether a device follows it, names, blocks of objects,
//! options.

use canopen::catalogue::{Block, Profile};

use super::scope::{Binding, Bound, Scope};
use crate::dut::Dut;
use crate::nearest::did_you_mean;
use crate::source::At;
use crate::suite::Suite;
use crate::suite::each::Blocks;
use crate::suite::literal::Literal;
use crate::suite::model::Requires;
use crate::suite::profile::{About, BlockNumber, CAPABILITIES, Capability};

/// Why the suite is not about this device.
pub(super) fn of_another_profile(suite: &Suite, dut: &Dut) -> Option<String> {
    match suite.file.profile.as_ref()?.value {
        About::Number(number) => of_another_number(number, dut),
        About::Named(_) => of_another_name(suite.profile()?, dut),
    }
}

fn of_another_number(about: u16, dut: &Dut) -> Option<String> {
    match dut.profile_number() {
        Some(profile) if profile == about => None,
        Some(0) => Some(format!("the device follows no profile, the case applies to CiA {about}")),
        Some(profile) => {
            Some(format!("the device follows profile {profile}, the case applies to CiA {about}"))
        }
        None => Some(format!("the data sheet does not say whether it follows CiA {about}")),
    }
}

fn of_another_name(profile: &Profile, dut: &Dut) -> Option<String> {
    let recognition = profile.recognised?;
    if dut.told.as_ref() == Some(&profile.name) {
        return None;
    }
    let (title, mux) = (profile.title(), recognition.object);
    if dut.eds.entry(mux).is_none() {
        return Some(format!("the device is no {title}: the data sheet has no object {mux}"));
    }
    match dut.default_int(mux).map(|value| value as u32) {
        Some(value) if recognition.fits(value) => None,
        Some(value) => Some(format!("the device is no {title}: {mux} is {value:08X}h")),
        None => Some(format!("the data sheet does not say whether it is a {title}, by {mux}")),
    }
}

/// The bits and codes that the profile of the suite has names for.
pub(super) fn names(suite: &Suite) -> impl Iterator<Item = (&str, Binding)> {
    let profiles = suite.profile().into_iter().flat_map(Profile::chain);
    let names = profiles.flat_map(|profile| &profile.names);
    names.map(|(name, value)| (name.as_str(), Binding::Literal(Literal::Int(i128::from(*value)))))
}

/// Checks that a capability which a case requires is one that can be known.
///
/// # Errors
/// The name, and what there is instead.
pub(super) fn check_capabilities(requires: &Requires, suite: &Suite) -> Result<(), At<String>> {
    if let Some(At { value, place }) = &requires.lacks
        && value.blocks().is_some()
    {
        let wrong = "whether a device lacks block transfer is found out by trying it";
        return Err(At::new(wrong.to_owned(), *place));
    }
    for capability in [&requires.supports, &requires.lacks].into_iter().flatten() {
        let At { value: Capability::Option(name), place } = capability else { continue };
        let profile = suite.profile();
        let options = || profile.into_iter().flat_map(|profile| profile.options.keys());
        if options().any(|option| option == name) {
            continue;
        }
        let known = || CAPABILITIES.into_iter().chain(options().map(String::as_str));
        let names = known().collect::<Vec<_>>().join(", ");
        let meant = did_you_mean(name, known());
        return Err(At::new(format!("no capability `{name}`: there are {names}{meant}"), *place));
    }
    Ok(())
}

/// Why the device's options are not those that the case is about.
pub(super) fn wrong_option(requires: &Requires, dut: &Dut, suite: &Suite) -> Option<String> {
    let option = |capability: &Option<At<Capability>>| match capability.as_ref()?.value {
        Capability::Option(ref name) => Some(name.clone()),
        _ => None,
    };
    let means = |name: &str| suite.profile()?.options.get(name).cloned();
    if let Some(name) = option(&requires.supports).filter(|name| dut.without.contains(name)) {
        let means = means(&name).unwrap_or_default();
        return Some(format!("the device is without {name}: {means}"));
    }
    let name = option(&requires.lacks).filter(|name| !dut.without.contains(name))?;
    Some(format!("the case applies to devices without {name}; `--without {name}` declares one"))
}

/// An instance for each of the blocks that the device has whole, among those asked for. The names
/// of the next block are bound, too: the one after it, of the last the first. Where a device has
/// but one, they are those of objects that it lacks.
///
/// # Errors
/// When the profile of the suite has no such block, or too few of them, with the place.
pub(super) fn block_scopes(
    blocks: &Blocks,
    pdo: &Scope,
    suite: &Suite,
    dut: &Dut,
) -> Result<Vec<Bound>, At<String>> {
    let At { value: name, place } = &blocks.name;
    let profile = suite.profile().ok_or_else(|| {
        let wrong = "`each: block` needs `profile:` in the suite, such as `profile: em66`";
        At::new(wrong.to_owned(), *place)
    })?;
    let block = profile.block(name).ok_or_else(|| {
        let known = || profile.chain().flat_map(|profile| profile.blocks.keys());
        let names = known().cloned().collect::<Vec<_>>().join(", ");
        let meant = did_you_mean(name, known().map(String::as_str));
        At::new(format!("no block `{name}`: there is {names}{meant}"), *place)
    })?;
    for number in &blocks.at {
        if let BlockNumber::At(at) = number.value
            && at > block.count
        {
            let wrong = format!("there are blocks 1 to {} of `{name}`", block.count);
            return Err(At::new(wrong, number.place));
        }
    }
    let offered = |number: &u8| blocks.undeclared || has(dut, block, *number);
    let whole: Vec<u8> = (1..=block.count).filter(offered).collect();
    let wanted = |number: &&u8| {
        blocks.at.is_empty()
            || blocks.at.iter().any(|at| match at.value {
                BlockNumber::At(at) => at == **number,
                BlockNumber::Last => whole.last() == Some(*number),
            })
    };
    let scopes = whole.iter().filter(wanted).map(|number| {
        let mut scope = pdo.clone();
        let mut others = whole.iter().filter(|other| *other != number);
        let next = others.clone().find(|other| *other > number).or_else(|| others.next());
        let next = next.copied().unwrap_or(number % block.count + 1);
        for (prefix, number) in [("", *number), ("next-", next)] {
            for object in block.objects.keys() {
                if let Some(mux) = block.object(object, number) {
                    scope.bind(format!("{prefix}{object}"), Binding::Mux(mux));
                }
            }
        }
        scope.bind("number", Binding::Literal(Literal::Int((*number).into())));
        (vec![format!("{name}={number}")], scope)
    });
    Ok(scopes.collect())
}

/// Whether the data sheet has every object of a block.
fn has(dut: &Dut, block: &Block, number: u8) -> bool {
    let mut objects = block.objects.keys().filter_map(|name| block.object(name, number));
    objects.all(|mux| dut.eds.entry(mux).is_some())
}
